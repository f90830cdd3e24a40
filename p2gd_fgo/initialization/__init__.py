"""How an estimator gets its first state, and how standing still is recognised."""

from __future__ import annotations

from p2gd_fgo.config import Config
from p2gd_fgo.initialization.base import Initializer, Start
from p2gd_fgo.initialization.given import GivenStart
from p2gd_fgo.initialization.static import StaticStart
from p2gd_fgo.initialization.stationary import Stillness, imu_is_quiet, stillness
from p2gd_fgo.types import Truth

__all__ = [
    "GivenStart",
    "Initializer",
    "Start",
    "StaticStart",
    "Stillness",
    "imu_is_quiet",
    "make_initializer",
    "stillness",
]


def make_initializer(config: Config, truth: Truth | None) -> Initializer:
    """Build what ``config.initialization.kind`` names.

    Raises
    ------
    DataError
        A start from truth without truth.
    """
    if config.initialization.kind == "given":
        return GivenStart(config.initialization.given, truth, config.runtime.seed)
    return StaticStart(config.initialization.static, config.stationary, config.imu.gravity)
