"""How an estimator gets its first state, and how standing still is recognised."""

from __future__ import annotations

from p2gd_fgo.config import Config
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.initialization.automatic import AutoStart
from p2gd_fgo.initialization.base import Initializer, Start
from p2gd_fgo.initialization.dynamic import DynamicStart
from p2gd_fgo.initialization.given import GivenStart
from p2gd_fgo.initialization.static import StaticStart
from p2gd_fgo.initialization.stationary import Stillness, imu_is_quiet, stillness
from p2gd_fgo.types import Truth

__all__ = [
    "AutoStart",
    "DynamicStart",
    "GivenStart",
    "Initializer",
    "Start",
    "StaticStart",
    "Stillness",
    "imu_history_s",
    "imu_is_quiet",
    "make_initializer",
    "stillness",
]


def make_initializer(
    config: Config, calibration: Calibration, noise: ImuNoise, truth: Truth | None
) -> Initializer:
    """Build what ``config.initialization.kind`` names.

    Parameters
    ----------
    noise
        Of the IMU, as the back end takes it.
    truth
        For a start from it.

    Raises
    ------
    DataError
        A start from truth without truth.
    """
    c, gravity = config.initialization, config.imu.gravity
    if c.kind == "given":
        return GivenStart(c.given, truth, config.runtime.seed)
    static = StaticStart(c.static, config.stationary, gravity)
    if c.kind == "static":
        return static
    dynamic = DynamicStart(
        c.dynamic, calibration, noise, gravity, config.backend.pixel_noise_px, config.imu.max_gap_s
    )
    return dynamic if c.kind == "dynamic" else AutoStart(static, dynamic)


def imu_history_s(config: Config) -> float:
    """How far back an initializer looks at the samples."""
    c = config.initialization
    moving = c.dynamic.max_window_s if c.kind in ("auto", "dynamic") else 0.0
    return max(c.static.window_s, moving)
