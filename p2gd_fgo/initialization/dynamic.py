"""Start in motion: wait until the images and the IMU of a window explain each other well enough."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import DynamicStartConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.imu import whole_since
from p2gd_fgo.initialization.base import Start
from p2gd_fgo.initialization.sightings import SightingStore
from p2gd_fgo.initialization.window import WindowMotion, WindowSolver
from p2gd_fgo.types import NANOSECONDS, ImuBatch, Waiting

_LEAST_IMAGES = 5
_MAX_SPEED = 60.0  # m/s


class DynamicStart:
    """Tries every ``every_s``, over a window that grows to ``max_window_s`` and then slides.

    A try begins at the last one's motion if that made sense, and otherwise at the linear solution.
    What was seen before a hole in the IMU, longer than ``max_gap_s``, is in no window.
    """

    def __init__(
        self,
        config: DynamicStartConfig,
        calibration: Calibration,
        noise: ImuNoise,
        gravity: float,
        pixel_noise_px: float,
        max_gap_s: float = 0.1,
    ) -> None:
        self._config = config
        self._max_gap_s = max_gap_s
        self._solver = WindowSolver(calibration, noise, gravity, pixel_noise_px, config)
        self._store = SightingStore(config.max_window_s)
        self._first_ns: int | None = None
        self._last_ns = 0
        self._tried_ns: int | None = None
        self._last: WindowMotion | None = None
        self._best: tuple[float, str] | None = None

    def attempt(self, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer) -> Start | Waiting:
        """Start here if the motion over the window is known well enough."""
        c = self._config
        if self._first_ns is None:
            self._first_ns = stamp_ns
        self._last_ns = stamp_ns
        self._store.add(stamp_ns, buffer)
        self._store.drop_before(whole_since(imu, stamp_ns, self._max_gap_s))
        waiting = Waiting(stamp_ns, "waiting for motion that shows velocity and scale")
        enough = (
            len(self._store) >= _LEAST_IMAGES
            and stamp_ns - self._store.oldest_ns >= c.min_window_s * NANOSECONDS
        )
        rested = self._tried_ns is None or stamp_ns - self._tried_ns >= c.every_s * NANOSECONDS
        if rested and enough:
            self._tried_ns = stamp_ns
            start = self._try(imu)
            if start is not None:
                return start
        if (stamp_ns - self._first_ns) / NANOSECONDS > c.max_wait_s:
            raise self.refusal()
        return waiting

    def refusal(self) -> InitializationError:
        """The value that came nearest to its threshold."""
        waited = (self._last_ns - (self._first_ns or self._last_ns)) / NANOSECONDS
        why = (
            f"less than {self._config.min_window_s:g} s of images and IMU data, or fewer than "
            f"{self._config.min_tracks} tracks, were there at a time"
            if self._best is None
            else f"at best {self._best[1]}"
        )
        return InitializationError(
            f"the dynamic start found no motion to start from in {waited:.1f} s: {why}"
        )

    def _try(self, imu: ImuBatch) -> Start | None:
        guess = None if self._last is None else self._last.state
        motion = self._solver.solve(self._store.window(self._config.max_images), imu, guess)
        self._last = None
        if motion is None:
            return None
        wrong = implausible(motion, self._config)
        waited_s = (motion.state.stamp_ns - (self._first_ns or 0)) / NANOSECONDS
        vague = uncertain(motion, self._config, waited_s)
        if wrong is None:
            self._last = motion
        score, reason = wrong or vague
        if wrong is not None:
            score += 1e3  # a motion that makes no sense is worse than a vague one
        if wrong is None and score <= 1.0:
            return self._start(motion)
        if self._best is None or score < self._best[0]:
            self._best = score, reason
        return None

    def _start(self, motion: WindowMotion) -> Start:
        assert self._first_ns is not None
        waited = (motion.state.stamp_ns - self._first_ns) / NANOSECONDS
        return Start(
            motion.state,
            motion.covariance,
            f"dynamic, after {waited:.1f} s: {motion.images} images, {motion.tracks} tracks, "
            f"speed {motion.speed:.2f} ± {motion.speed_sigma:.2f} m/s, tilt ± "
            f"{motion.tilt_sigma_deg:.2f}°",
        )


def implausible(motion: WindowMotion, config: DynamicStartConfig) -> tuple[float, str] | None:
    """What can't be true, worst first: how many times its threshold, and a clause about it."""
    state = motion.state
    gyro = float(np.linalg.norm(state.gyro_bias))
    accel = float(np.linalg.norm(state.accel_bias))
    most_gyro = config.max_bias_sigmas * config.sigma_gyro_bias
    most_accel = config.max_bias_sigmas * config.sigma_accel_bias
    limits = (
        (
            motion.pixel_rms,
            config.max_residual,
            "reprojection errors of {:.3g} standard deviations",
        ),
        (motion.imu_rms, config.max_residual, "IMU residuals of {:.3g} standard deviations"),
        (gyro, most_gyro, "a gyro bias of {:.3g} rad/s"),
        (accel, most_accel, "an accelerometer bias of {:.3g} m/s²"),
        (motion.speed, _MAX_SPEED, "a speed of {:.3g} m/s"),
    )
    found = [
        (value / most, f"{text.format(value)} (threshold {most:.3g})")
        for value, most, text in limits
        if not value <= most
    ]
    if motion.inliers < config.min_inliers:
        found.append(
            (
                config.min_inliers / max(motion.inliers, 1e-3),
                f"only {motion.inliers:.0%} of the sightings agree (threshold "
                f"{config.min_inliers:.0%})",
            )
        )
    if not motion.converged:
        found.append((10.0, "a refinement that didn't come to rest"))
    return max(found, default=None)


def uncertain(
    motion: WindowMotion, config: DynamicStartConfig, waited_s: float
) -> tuple[float, str]:
    """The larger of the uncertainties over their thresholds, and a clause about it."""
    late = waited_s >= config.patience_s
    allowed = config.late_speed_sigma if late else config.max_speed_sigma
    most = max(allowed * motion.speed, config.still_speed_sigma)
    share = motion.speed_sigma / max(motion.speed, 1e-9)
    speed = (
        motion.speed_sigma / most,
        f"speed and scale are uncertain by {share:.0%} (threshold {allowed:.0%}; "
        f"{motion.speed_sigma:.3g} m/s at {motion.speed:.3g} m/s)",
    )
    tilt = (
        motion.tilt_sigma_deg / config.max_tilt_sigma_deg,
        f"roll and pitch are uncertain by {motion.tilt_sigma_deg:.2g}° (threshold "
        f"{config.max_tilt_sigma_deg:g}°)",
    )
    return max(speed, tilt)
