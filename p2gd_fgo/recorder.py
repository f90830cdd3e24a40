"""Writes down what a run gives, image by image."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.priors import PriorProblem
from p2gd_fgo.troubles import Trouble, trouble_events
from p2gd_fgo.types import (
    NANOSECONDS,
    BoolArray,
    Estimate,
    Event,
    FloatArray,
    IntArray,
    Observations,
    TrackRecord,
    Trajectory,
    Waiting,
)

_GATED = ("rejected_chi_square", "rejected_outlier", "rejected_behind_camera")


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """All of a run.

    Attributes
    ----------
    status, reason
        ``failed`` with one sentence if it ended early; what was estimated is kept.
    config
        Resolved: what was used.
    estimate
        The online poses, one for each image from the start on.
    smoothed
        The poses as they left the window.
    covariances
        (N, 15, 15) of the online estimates.
    velocities, gyro_biases, accel_biases
        (N, 3) of the online estimates.
    frames_total
        Images in the recording.
    timing_stamps_ns, timing
        For each image processed: (CPU ms, wall ms) by stage. All stamps are on the IMU's clock.
    events
        What a reader of the report must know.
    counts
        Observations by fate, images by fate, features by fate.
    start_note
        How it was started.
    priors
        Where prior poses came from.
    tracks
        Which features every image saw.
    outliers, gated
        (F,) at each of these images: tracks against the motion of the rest; observations that the
        back end's gates rejected.
    still
        (N,) whether an online estimate was made as standing still.
    """

    status: Literal["done", "failed"]
    reason: str | None
    config: Config
    estimate: Trajectory
    smoothed: Trajectory
    covariances: FloatArray
    velocities: FloatArray
    gyro_biases: FloatArray
    accel_biases: FloatArray
    frames_total: int
    timing_stamps_ns: IntArray
    timing: list[dict[str, tuple[float, float]]]
    events: tuple[Event, ...]
    counts: dict[str, int]
    start_note: str | None
    priors: str
    tracks: TrackRecord
    outliers: IntArray
    gated: IntArray
    still: BoolArray


class Recorder:
    """Collects what :class:`RunResult` holds.

    Attributes
    ----------
    events, counts
        The caller adds to them.
    """

    def __init__(self, events: Iterable[Event]) -> None:
        self.events = list(events)
        self.counts: Counter[str] = Counter()
        self._estimates: list[Estimate] = []
        self._timed: list[tuple[int, dict[str, tuple[float, float]]]] = []
        self._seen: list[Observations] = []
        self._asked: list[int] = []
        self._outliers: list[int] = []
        self._gated: list[int] = []
        self._gated_so_far = 0
        self._problems: list[tuple[int, PriorProblem | None]] = []
        self._troubles: list[Trouble] = []

    def add(
        self,
        stamp_ns: int,
        outcome: Estimate | Waiting,
        odometry: Odometry,
        times: dict[str, tuple[float, float]],
    ) -> None:
        """Write down one image that the odometry has processed; its stamp is on the IMU's clock."""
        assert odometry.decision is not None
        self._timed.append((stamp_ns, times))
        if isinstance(outcome, Estimate):
            if not self._estimates:
                self.events.append(Event(stamp_ns, "started", f"started {odometry.start_note}"))
            self._estimates.append(outcome)
        odometry.count_into(self.counts)
        self._seen.append(odometry.observations)
        self._asked.append(odometry.decision.selection.asked)
        self._outliers.append(odometry.tracked.lost_outlier)
        fates = odometry.counts
        gated = sum(fates.get(name, 0) for name in _GATED)
        self._gated.append(gated - self._gated_so_far)
        self._gated_so_far = gated
        self._troubles += odometry.troubles
        self._problems.append((odometry.observations.stamp_ns, odometry.decision.problem))

    @property
    def last_stamp_ns(self) -> int | None:
        """Of the last image written down."""
        return self._timed[-1][0] if self._timed else None

    def result(
        self,
        status: Literal["done", "failed"],
        reason: str | None,
        smoothed: Trajectory,
        odometry: Odometry,
        frames_total: int,
        priors: str,
    ) -> RunResult:
        """Everything, at the end of the run."""
        estimates = self._estimates
        self.counts.update(odometry.counts)
        events = [
            *self.events,
            *trouble_events(self._troubles),
            *_standstills(estimates),
            *_prior_problems(self._problems),
        ]
        return RunResult(
            status,
            reason,
            odometry.config,
            Trajectory(
                np.array([e.state.stamp_ns for e in estimates], dtype=np.int64),
                np.array([e.state.T_world_imu for e in estimates]).reshape(-1, 4, 4),
            ),
            smoothed,
            np.array([e.covariance for e in estimates]).reshape(-1, 15, 15),
            np.array([e.state.velocity for e in estimates]).reshape(-1, 3),
            np.array([e.state.gyro_bias for e in estimates]).reshape(-1, 3),
            np.array([e.state.accel_bias for e in estimates]).reshape(-1, 3),
            frames_total,
            np.array([stamp for stamp, _ in self._timed], dtype=np.int64),
            [row for _, row in self._timed],
            tuple(sorted(events, key=lambda e: e.stamp_ns)),
            dict(self.counts),
            odometry.start_note,
            priors,
            self._track_record(),
            np.array(self._outliers, dtype=np.int64),
            np.array(self._gated, dtype=np.int64),
            np.array([e.stationary for e in estimates], dtype=np.bool_),
        )

    def _track_record(self) -> TrackRecord:
        seen = self._seen
        return TrackRecord(
            np.array([o.stamp_ns for o in seen], dtype=np.int64),
            np.array([len(o) for o in seen], dtype=np.int64),
            np.array(self._asked, dtype=np.int64),
            np.concatenate([np.zeros(0, np.int64), *(o.ids for o in seen)]),
            np.concatenate([np.zeros((0, 2)), *(o.normalized for o in seen)]),
        )


def _standstills(estimates: list[Estimate]) -> list[Event]:
    """One event for each standstill, with its length up to the first image that moves."""
    events = []
    begin: int | None = None
    for k, estimate in enumerate(estimates):
        last = k == len(estimates) - 1
        if estimate.stationary and begin is None:
            begin = k
        if begin is not None and (last or not estimate.stationary):
            first_ns = estimates[begin].state.stamp_ns
            seconds = (estimate.state.stamp_ns - first_ns) / NANOSECONDS
            message = f"standing still for {seconds:.1f} s: vision muted, zero velocity"
            events.append(Event(first_ns, "standstill", message, {"duration_s": seconds}))
            begin = None
    return events


def _prior_problems(problems: list[tuple[int, PriorProblem | None]]) -> list[Event]:
    """One event for each stretch of images whose quotas fell back for the same kind of reason."""
    events = []
    for kind, stretch in groupby(problems, key=lambda item: item[1] and item[1].kind):
        images = list(stretch)
        first_ns, problem = images[0]
        if kind is None or problem is None:
            continue
        seconds = (images[-1][0] - first_ns) / NANOSECONDS
        message = f"{problem.message}: quotas of the grid for {len(images)} images"
        data: dict[str, float | int | str] = {"images": len(images), "duration_s": seconds}
        events.append(Event(first_ns, kind, message, data))
    return events
