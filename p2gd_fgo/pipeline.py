"""One function runs a recording."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Protocol

import numpy as np

from p2gd_fgo.config import Config, resolve
from p2gd_fgo.datasets import Sequence, load_mask
from p2gd_fgo.datasets.base import stamps_on_imu_clock
from p2gd_fgo.errors import DataError, EstimatorError, InitializationError
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.priors import PriorSource, make_prior_source
from p2gd_fgo.recorder import Recorder, RunResult
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import (
    NANOSECONDS,
    Estimate,
    Event,
    Image,
    ImuBatch,
    Trajectory,
    Waiting,
)
from p2gd_fgo.user_paths import user_path


class Observer(Protocol):
    """Told about a run as it goes on: progress bar, viewer, recorder."""

    def begin(self, sequence: Sequence, config: Config) -> None:
        """The run starts, with its resolved configuration."""
        ...

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Image ``index`` has been processed; what else is known is read from the odometry."""
        ...


class NoObserver:
    """Looks on and does nothing."""

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Nothing."""

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Nothing."""


def run_sequence(
    sequence: Sequence,
    config: Config,
    observer: Observer | None = None,
    *,
    priors: PriorSource | None = None,
) -> RunResult:
    """Run a recording from its first image to its last.

    An image that can't be decoded, whose mask can't, or that lies outside the IMU's time is left
    out with an event; one without a mask where there are masks is counted and used whole. A
    refused start or a diverged back end ends the run with ``status`` failed.

    Parameters
    ----------
    priors
        Asked for prior poses instead of what ``config.priors`` names.

    Raises
    ------
    ConfigError, DataError
        Before the first image: noise not known, start from truth without overlapping truth, a
        mask of another size, a source of prior poses that can't be had.
    """
    observer = observer or NoObserver()
    timer = StageTimer()
    fixed_mask = (
        load_mask(user_path(config.dataset.mask, "dataset.mask"), sequence.calibration.camera)
        if config.dataset.mask
        else None
    )
    source = priors or prior_source(sequence, config)
    odometry = Odometry(
        sequence.calibration,
        config,
        truth=sequence.truth,
        mask=fixed_mask,
        priors=source,
        timer=timer,
    )
    _check_start(sequence, odometry)
    observer.begin(sequence, odometry.config)

    recorder = Recorder(sequence.events)
    counts, events = recorder.counts, recorder.events
    first_ns = int(sequence.image_stamps_ns[0]) + odometry.offset_ns
    status: Literal["done", "failed"] = "done"
    reason, smoothed = None, Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    try:
        for index, stamp_ns, imu in _images_with_imu(sequence, odometry.offset_ns):
            odometry.add_imu(imu)
            on_imu_clock = stamp_ns + odometry.offset_ns
            try:
                with timer.stage("decode"):
                    image: Image = sequence.image(index)
                    mask = sequence.mask(index)
            except DataError as error:
                counts["images_unreadable"] += 1
                events.append(Event(on_imu_clock, "image_unreadable", str(error)))
                timer.take()
                continue
            if config.dataset.masks is not None and mask is None:
                counts["masks_missing"] += 1
            outcome = odometry.add_image(stamp_ns, image, mask=mask)
            recorder.add(on_imu_clock, outcome, odometry, timer.take())
            observer.frame(index, outcome, image, odometry)
        smoothed = odometry.finish()
    except (InitializationError, EstimatorError) as error:
        status, reason = "failed", str(error)
        kind = "start_refused" if isinstance(error, InitializationError) else "diverged"
        last = recorder.last_stamp_ns
        events.append(Event(first_ns if last is None else last, kind, reason))
    if counts["masks_missing"]:
        message = f"{counts['masks_missing']} images have no mask and were used whole"
        events.append(Event(first_ns, "masks_missing", message))
    total = len(sequence.image_stamps_ns)
    return recorder.result(status, reason, smoothed, odometry, total, source.description)


def prior_source(sequence: Sequence, config: Config) -> PriorSource:
    """What ``config.priors`` names, for a recording.

    Raises
    ------
    ConfigError, DataError
        It needs what is not there: a truth, a file.
    """
    config = resolve(config, sequence.calibration.camera.width)
    horizon = config.distribution.p2gd.horizon
    assert horizon is not None
    return make_prior_source(
        config.priors,
        horizon,
        truth=sequence.truth,
        image_stamps_ns=stamps_on_imu_clock(sequence, config.dataset.time_offset_s),
        seed=config.runtime.seed,
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
