"""Drives with a constant twist, and ways of going through them image by image."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.priors import ImageTimes, PriorIntake, PriorProblem, PriorSource
from p2gd_fgo.priors.recorded import RecordedPriors
from p2gd_fgo.priors.screw import along_screw
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, PriorPoses, Trajectory

EPOCH_NS = 1_700_000_000_123_456_789
IMAGE_NS = NANOSECONDS // 10
HORIZON = 20
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


def stamps(count: int, step_ns: int = IMAGE_NS) -> IntArray:
    return EPOCH_NS + step_ns * np.arange(count)


def arc(stamps_ns: IntArray, speed: float = 10.0, turn_deg: float = 20.0) -> Trajectory:
    """Along x at first, m/s and degrees per second about z, with a little climb and roll."""
    half_second = along_screw(one_second(speed, turn_deg), np.array([0.5]))[0]
    seconds = (stamps_ns - EPOCH_NS) / NANOSECONDS
    return Trajectory(stamps_ns, along_screw(half_second, 2.0 * seconds))


def one_second(speed: float, turn_deg: float) -> FloatArray:
    """(4, 4) motion of one second, by a thousand small steps of its own."""
    angle = np.radians(turn_deg) / 1000
    step = np.eye(4)
    step[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    step[:3, 3] = speed / 1000, 0.0, 0.1 / 1000
    return np.asarray(np.linalg.matrix_power(step, 1000))


def window(drive: Trajectory, index: int, length: int = HORIZON + 1) -> Trajectory:
    """What is estimated at image ``index``."""
    part = slice(max(0, index + 1 - length), index + 1)
    return Trajectory(drive.stamps_ns[part], drive.T_world_imu[part])


class Spoilt:
    """Another source's poses, changed."""

    def __init__(
        self, source: PriorSource, change: Callable[[PriorPoses], PriorPoses | None]
    ) -> None:
        self.independent = source.independent
        self.image_times = source.image_times
        self.description = "spoilt"
        self._source, self._change = source, change

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        ahead = self._source.poses(stamp_ns, recent)
        return None if ahead is None else self._change(ahead)


def planner(drive: Trajectory, plan: Trajectory | None = None) -> RecordedPriors:
    """Looks ahead on ``plan``, by default on the drive itself, at the drive's images."""
    plan = drive if plan is None else plan
    return RecordedPriors(plan, ImageTimes(drive.stamps_ns), HORIZON, "plan")


def go_through(
    drive: Trajectory, source: PriorSource, config: PriorsConfig | None = None
) -> list[str | None]:
    """The kind of problem of every image from the second on, None where there is none."""
    intake = PriorIntake(source, HORIZON, config)
    kinds = []
    for index in range(1, len(drive)):
        taken = intake.take(int(drive.stamps_ns[index]), None, window(drive, index))
        kinds.append(taken.kind if isinstance(taken, PriorProblem) else None)
    return kinds
