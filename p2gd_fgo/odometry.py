"""The online visual-inertial odometry: one method takes an image and gives an estimate."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict

import numpy as np

from p2gd_fgo.backends.base import Backend, check_sane
from p2gd_fgo.backends.factory import make_backend
from p2gd_fgo.config import Config, resolve
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.distribution import DistributionContext, make_distribution
from p2gd_fgo.errors import DataError
from p2gd_fgo.frontend import Frontend, TrackSummary
from p2gd_fgo.imu import ImuBuffer, between, rotation_over
from p2gd_fgo.initialization import make_initializer, stillness
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import (
    NANOSECONDS,
    Estimate,
    FloatArray,
    Image,
    ImuBatch,
    NavState,
    Observations,
    PriorPoses,
    Trajectory,
    Truth,
    Waiting,
)


class Odometry:
    """Front end, feature distribution and back end, joined as in the paper's Fig. 2.

    Parameters
    ----------
    calibration
        Camera, extrinsic, IMU noise.
    config
        Fields that depend on the image are filled here.
    truth
        For a start from truth; otherwise not looked at.
    mask
        Features only where this image of the camera's size is not 0.
    timer
        Every stage of an image is timed in it.

    Raises
    ------
    ConfigError
        No IMU noise in the calibration or the configuration.
    DataError
        A start from truth without truth.
    """

    def __init__(
        self,
        calibration: Calibration,
        config: Config,
        *,
        truth: Truth | None = None,
        mask: Image | None = None,
        timer: StageTimer | None = None,
    ) -> None:
        camera = calibration.camera
        self.config = config = resolve(config, camera.width)
        self.timer = timer or StageTimer()
        self._calibration = calibration
        offset_s = config.dataset.time_offset_s
        self.offset_ns = round(
            (calibration.time_offset_s if offset_s is None else offset_s) * NANOSECONDS
        )
        self._frontend = Frontend(camera, config.frontend, config.runtime.seed, mask)
        f = config.frontend
        assert f.max_features is not None and f.min_distance_px is not None
        self._distribution = make_distribution(
            config.distribution, self._frontend.grid, f.max_features, f.min_distance_px
        )
        self._backend: Backend = make_backend(config, calibration, self.timer)
        self._initializer = make_initializer(config, truth)
        self._imu = ImuBuffer()
        self._history_ns = round(
            (max(config.stationary.window_s, config.initialization.static.window_s) + 0.5)
            * NANOSECONDS
        )
        self._last_ns: int | None = None
        self._estimate: Estimate | None = None
        self.tracked = TrackSummary()
        self.extracted = 0
        self.start_note: str | None = None

    def add_imu(self, imu: ImuBatch) -> None:
        """Hand in samples, in order; those up to an image must be in before it.

        Raises
        ------
        DataError
            Not finite or not increasing in time.
        """
        self._imu.add(imu)

    def add_image(
        self, stamp_ns: int, image: Image, priors: PriorPoses | None = None
    ) -> Estimate | Waiting:
        """Track, distribute, extract, estimate.

        Parameters
        ----------
        stamp_ns
            On the camera's clock.
        image
            (height, width) grey.
        priors
            Where the planner will drive, relative to the body at this image.

        Raises
        ------
        DataError
            The image's size or stamp, or IMU samples that don't reach it.
        InitializationError
            The start is refused.
        EstimatorError
            The back end diverged.
        """
        stamp_ns += self.offset_ns
        with self.timer.stage("frame"):
            imu = self._imu_to(stamp_ns)
            with self.timer.stage("track"):
                self.tracked = self._frontend.track(stamp_ns, image, self._camera_turn(imu))
                still = self._is_still(stamp_ns)
            with self.timer.stage("propagate"):
                predicted = self._backend.propagate(imu) if self._estimate and imu else None
            with self.timer.stage("distribute"):
                quotas = self._distribution.quotas(self._context(predicted, priors))
            with self.timer.stage("extract"):
                self.extracted = self._frontend.extract(quotas)
                observations = self._frontend.observations()
            self._last_ns = stamp_ns
            self._imu.drop_before(stamp_ns - self._history_ns)
            if self._estimate is None:
                return self._try_to_start(observations)
            return self._update(observations, still)

    def finish(self) -> Trajectory:
        """The lag-smoothed poses; call once, after the last image.

        Raises
        ------
        InitializationError
            The estimator never started.
        """
        if self._estimate is None:
            raise self._initializer.refusal()
        return self._backend.finish()

    @property
    def counts(self) -> dict[str, int]:
        """The back end's account of observations."""
        return self._backend.counts

    @property
    def features(self) -> int:
        """Features seen in the newest image."""
        return len(self._frontend.buffer)

    def count_into(self, counts: Counter[str]) -> None:
        """Add what the front end did with the newest image."""
        counts["images"] += 1
        counts["features"] += self.features
        counts["features_new"] += self.extracted
        for fate, number in asdict(self.tracked).items():
            counts[f"features_{fate}"] += number

    def _try_to_start(self, observations: Observations) -> Estimate | Waiting:
        start = self._initializer.attempt(
            observations.stamp_ns, self._imu.samples(), self._frontend.buffer
        )
        if isinstance(start, Waiting):
            return start
        self.start_note = start.note
        self._backend.start(start.state, start.covariance)
        return self._update(observations, still=False)

    def _update(self, observations: Observations, still: bool) -> Estimate:
        with self.timer.stage("update"):
            estimate = self._backend.update(observations, still)
        check_sane(estimate)
        self._estimate = estimate
        return estimate

    def _imu_to(self, stamp_ns: int) -> ImuBatch | None:
        """Samples from the last image to this one; None at the first image."""
        held = self._imu.samples()
        if len(held) == 0 or not held.stamps_ns[0] <= stamp_ns <= held.stamps_ns[-1]:
            raise DataError(
                f"the image at {stamp_ns} ns lies outside the IMU samples handed in: hand in the "
                "samples up to an image, and one beyond, before the image"
            )
        if self._last_ns is None:
            return None
        if stamp_ns <= self._last_ns:
            raise DataError(
                f"the image at {stamp_ns} ns is not later than the one before, at {self._last_ns}"
            )
        return between(held, self._last_ns, stamp_ns)

    def _camera_turn(self, imu: ImuBatch | None) -> FloatArray | None:
        """R (3, 3) that takes vectors of the previous camera frame to the current one.

        None before the start: a gyro bias of some 0.1 rad/s, not yet known, points the tracker
        further away than no prediction at all.
        """
        if imu is None or self._estimate is None:
            return None
        R_imu_cam = self._calibration.T_imu_cam[:3, :3]
        turn = rotation_over(imu, self._estimate.state.gyro_bias)
        return np.asarray(R_imu_cam.T @ turn.T @ R_imu_cam)

    def _is_still(self, stamp_ns: int) -> bool:
        config = self.config.stationary
        if not config.enabled:
            return False
        was_still = self._estimate is not None and self._estimate.stationary
        return stillness(
            stamp_ns,
            self._imu.samples(),
            self._frontend.buffer,
            config.window_s,
            config,
            was_still=was_still,
        ).still

    def _context(
        self, predicted: NavState | None, priors: PriorPoses | None
    ) -> DistributionContext:
        empty = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
        return DistributionContext(
            self._calibration.camera,
            self._calibration.T_imu_cam,
            self._frontend.buffer,
            self._estimate.window if self._estimate else empty,
            predicted.T_world_imu if predicted else None,
            priors,
        )
