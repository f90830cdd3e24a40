"""The filter over simulated feature recordings, as all tests of it run it."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.msckf import Msckf
from p2gd_fgo.config import load_config, override
from p2gd_fgo.evaluation.consistency import free_sigmas
from p2gd_fgo.evaluation.feature_runs import FeatureRun
from p2gd_fgo.simulation.feature_recording import FeatureRecording
from p2gd_fgo.simulation.imu import MEMS_NOISE


def msckf(
    recording: FeatureRecording,
    kind: type[Msckf] = Msckf,
    *,
    window: int = 20,
    **settings: float,
) -> Msckf:
    values = {f"backend.msckf.{k}": v for k, v in settings.items()}
    config = override(load_config(), {"backend.window": window, **values})
    return kind(recording.calibration, MEMS_NOISE, 9.81, config.backend)


def least_free_sigma(result: FeatureRun) -> float:
    """The lowest standard deviation of x, y, z or yaw, as a share of its first."""
    sigmas = free_sigmas(
        np.array([e.state.T_world_imu for e in result.estimates]),
        np.array([e.covariance for e in result.estimates]),
    )
    return float((sigmas / sigmas[0]).min())
