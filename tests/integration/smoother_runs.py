"""The smoother over simulated feature recordings, as all tests of it run it."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.base import Backend
from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.config import load_config, override
from p2gd_fgo.evaluation.feature_runs import FeatureRun, detected_still, run_features
from p2gd_fgo.simulation.feature_recording import (
    CAR_PLATFORM,
    ROBOT_PLATFORM,
    FeatureRecording,
    record_features,
)
from p2gd_fgo.simulation.imu import MEMS_NOISE

PLATFORMS = {"car": CAR_PLATFORM, "robot": ROBOT_PLATFORM}
SETTLED = 50  # frames of the first 5 s, not judged


def record(
    name: str,
    seed: int,
    duration_s: float,
    *,
    noise: bool = True,
    stops_s: tuple[tuple[float, float], ...] = (),
    outlier_share: float = 0.0,
    image_offset_ns: int = 0,
) -> FeatureRecording:
    return record_features(
        PLATFORMS[name],
        duration_s,
        np.random.default_rng(seed),
        noise=noise,
        stops_s=stops_s,
        outlier_share=outlier_share,
        image_offset_ns=image_offset_ns,
    )


def smoother(
    recording: FeatureRecording, kind: type[Smoother] = Smoother, **settings: float
) -> Smoother:
    config = override(load_config(), {f"backend.{k}": v for k, v in settings.items()})
    return kind(recording.calibration, MEMS_NOISE, 9.81, config.backend)


def run(
    backend: Backend, recording: FeatureRecording, seed: int | None, delay_s: float | None = None
) -> FeatureRun:
    """With an erroneous start if ``seed`` is given, stops detected after ``delay_s``."""
    return run_features(
        backend,
        recording,
        None if seed is None else np.random.default_rng([seed, 1]),
        stationary=None if delay_s is None else detected_still(recording, delay_s),
    )


def fates(counts: dict[str, int]) -> int:
    """Observations that something became of."""
    others = ("observations", "iterations", "gate_opened")
    return sum(n for name, n in counts.items() if name not in others)
