"""What an error of the calibration costs in pixels, and from where on that matters.

One rule for all: an error is worth a warning where the rotation that it gets wrong moves a feature
by more than the back end's ``pixel_noise_px``, a fault where it moves it by more than its
``outlier_px``, for then tracks are rejected; and only the part of it that three sigmas of its
estimate leave standing counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.doctor.report import Status
from p2gd_fgo.types import FloatArray

_SIGMAS = 3.0
_FAST = 95.0  # percentile of the rates that stands for the recording's turns
_SYSTEMATIC = np.radians(0.2)  # of rotations from flow: moving bodies, rolling shutter


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Scales of a recording.

    Attributes
    ----------
    noise_px, outlier_px
        Of the configuration.
    focal_px
        Of the camera.
    rate
        Rate in the recording's turns, rad/s, as the images see it.
    imu_step_s, image_step_s
        Sample intervals.
    window
        Images in the back end's window.
    """

    noise_px: float
    outlier_px: float
    focal_px: float
    rate: float
    imu_step_s: float
    image_step_s: float
    window: int

    def judge(self, px: float) -> Status:
        """Status of an error of so many pixels."""
        if px > self.outlier_px:
            return "fault"
        return "warning" if px > self.noise_px else "ok"

    def shift_px(self, seconds: float) -> float:
        """Pixels that an error in time costs in a turn."""
        return abs(seconds) * self.rate * self.focal_px

    def tilt_px(self, angle: float) -> float:
        """Pixels that an error of the axes, rad, costs across the window in a turn.

        The turn is at most a right angle: features don't stay in view for longer.
        """
        turned = min(self.rate * self.image_step_s * self.window, np.pi / 2)
        return angle * turned * self.focal_px

    @property
    def shift_thresholds_s(self) -> tuple[float, float]:
        """Offsets in time of a warning and of a fault.

        Below one interval of the IMU nothing is said: drivers stamp a sample at its beginning or
        its end.
        """
        per_px = 1.0 / max(self.rate * self.focal_px, 1e-9)
        return (
            max(self.noise_px * per_px, self.imu_step_s),
            max(self.outlier_px * per_px, self.imu_step_s),
        )

    @property
    def tilt_thresholds(self) -> tuple[float, float]:
        """Errors of the axes, rad, of a warning and of a fault."""
        per_rad = max(self.tilt_px(1.0), 1e-9)
        return (
            max(self.noise_px / per_rad, _SYSTEMATIC),
            max(self.outlier_px / per_rad, _SYSTEMATIC),
        )


def make_tolerances(
    config: Config, focal_px: float, phi: FloatArray, image_step_s: float, imu_step_s: float
) -> Tolerances:
    """Scales from the rotations (N, 3) between images."""
    back_end = config.backend
    spread = phi - np.median(phi, axis=0)
    rate = float(np.percentile(np.linalg.norm(spread, axis=1), _FAST)) / image_step_s
    outlier = (
        back_end.msckf.outlier_px if back_end.kind == "msckf" else back_end.smoother.outlier_px
    )
    return Tolerances(
        back_end.pixel_noise_px, outlier, focal_px, rate, imu_step_s, image_step_s, back_end.window
    )


def beyond(value: float, sigma: float) -> float:
    """What three sigmas leave of a value."""
    return max(abs(value) - _SIGMAS * sigma, 0.0)


def grade(value: float, thresholds: tuple[float, float]) -> Status:
    """Status of a value against the thresholds of a warning and of a fault."""
    if value > thresholds[1]:
        return "fault"
    return "warning" if value > thresholds[0] else "ok"
