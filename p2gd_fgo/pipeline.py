"""One function runs a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence, load_mask
from p2gd_fgo.errors import DataError, EstimatorError, InitializationError
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import (
    NANOSECONDS,
    Estimate,
    Event,
    FloatArray,
    Image,
    ImuBatch,
    IntArray,
    Trajectory,
    Waiting,
)


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
        For each image processed: (CPU ms, wall ms) by stage.
    events
        What a reader of the report must know.
    counts
        Observations by fate, images by fate, features by fate.
    start_note
        How it was started.
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


class Observer(Protocol):
    """Told about a run as it goes on: progress bar, viewer, recorder."""

    def begin(self, sequence: Sequence, config: Config) -> None:
        """The run starts, with its resolved configuration."""
        ...

    def frame(self, index: int, outcome: Estimate | Waiting, features: int) -> None:
        """Image ``index`` has been processed; ``features`` are seen in it."""
        ...


class NoObserver:
    """Looks on and does nothing."""

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Nothing."""

    def frame(self, index: int, outcome: Estimate | Waiting, features: int) -> None:
        """Nothing."""


def run_sequence(sequence: Sequence, config: Config, observer: Observer | None = None) -> RunResult:
    """Run a recording from its first image to its last.

    An image that can't be decoded, or lies outside the IMU's time, is left out with an event. A
    refused start or a diverged back end ends the run with ``status`` failed.

    Raises
    ------
    ConfigError, DataError
        Before the first image: noise not known, start from truth without overlapping truth, a
        mask of another size.
    """
    observer = observer or NoObserver()
    timer = StageTimer()
    mask = (
        load_mask(Path(config.dataset.mask), sequence.calibration.camera)
        if (config.dataset.mask)
        else None
    )
    odometry = Odometry(sequence.calibration, config, truth=sequence.truth, mask=mask, timer=timer)
    _check_start(sequence, odometry)
    observer.begin(sequence, odometry.config)

    estimates: list[Estimate] = []
    timed: list[tuple[int, dict[str, tuple[float, float]]]] = []
    events = list(sequence.events)
    counts: Counter[str] = Counter()
    status: Literal["done", "failed"] = "done"
    reason, smoothed = None, _trajectory([])
    try:
        for index, stamp_ns, imu in _images_with_imu(sequence, odometry.offset_ns):
            odometry.add_imu(imu)
            try:
                with timer.stage("decode"):
                    image: Image = sequence.image(index)
            except DataError as error:
                counts["images_unreadable"] += 1
                events.append(Event(stamp_ns, "image_unreadable", str(error)))
                timer.take()
                continue
            outcome = odometry.add_image(stamp_ns, image)
            timed.append((stamp_ns, timer.take()))
            if isinstance(outcome, Estimate):
                if not estimates:
                    note = f"started {odometry.start_note}"
                    events.append(Event(stamp_ns, "started", note))
                estimates.append(outcome)
            odometry.count_into(counts)
            observer.frame(index, outcome, odometry.features)
        smoothed = odometry.finish()
    except (InitializationError, EstimatorError) as error:
        status, reason = "failed", str(error)
        last = timed[-1][0] if timed else int(sequence.image_stamps_ns[0])
        kind = "start_refused" if isinstance(error, InitializationError) else "diverged"
        events.append(Event(last, kind, reason))
    counts.update(odometry.counts)
    events += _standstills(estimates)
    return RunResult(
        status,
        reason,
        odometry.config,
        _trajectory(estimates),
        smoothed,
        np.array([e.covariance for e in estimates]).reshape(-1, 15, 15),
        np.array([e.state.velocity for e in estimates]).reshape(-1, 3),
        np.array([e.state.gyro_bias for e in estimates]).reshape(-1, 3),
        np.array([e.state.accel_bias for e in estimates]).reshape(-1, 3),
        len(sequence.image_stamps_ns),
        np.array([stamp for stamp, _ in timed], dtype=np.int64),
        [row for _, row in timed],
        tuple(sorted(events, key=lambda e: e.stamp_ns)),
        dict(counts),
        odometry.start_note,
    )


def _images_with_imu(sequence: Sequence, offset_ns: int) -> Iterator[tuple[int, int, ImuBatch]]:
    """Index and stamp of each image inside the IMU's time, and the samples that lead to it.

    The samples reach one beyond the image, so that the value at its stamp can be interpolated.
    """
    imu = sequence.imu
    given = 0
    for index, stamp_ns in enumerate(sequence.image_stamps_ns.tolist()):
        on_imu_clock = stamp_ns + offset_ns
        if not imu.stamps_ns[0] <= on_imu_clock <= imu.stamps_ns[-1]:
            continue
        upto = int(np.searchsorted(imu.stamps_ns, on_imu_clock, side="left")) + 1
        part = slice(given, max(upto, given))
        given = part.stop
        yield index, stamp_ns, ImuBatch(imu.stamps_ns[part], imu.gyro[part], imu.accel[part])


def _check_start(sequence: Sequence, odometry: Odometry) -> None:
    """Refuse a start from truth that lies outside the recording."""
    start = odometry.config.initialization
    if start.kind != "given" or start.given.source != "truth" or sequence.truth is None:
        return
    truth = sequence.truth.trajectory.stamps_ns
    images = sequence.image_stamps_ns + odometry.offset_ns
    if not ((images >= truth[0]) & (images <= truth[-1])).any():
        gap_s = max(truth[0] - images[-1], images[0] - truth[-1]) / NANOSECONDS
        raise DataError(
            f"initialization.kind is 'given' from truth, but no image of {sequence.name} lies "
            f"within the truth's time, {gap_s:.1f} s apart: check the truth's stamps, or use "
            "'static'"
        )


def _trajectory(estimates: list[Estimate]) -> Trajectory:
    return Trajectory(
        np.array([e.state.stamp_ns for e in estimates], dtype=np.int64),
        np.array([e.state.T_world_imu for e in estimates]).reshape(-1, 4, 4),
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
