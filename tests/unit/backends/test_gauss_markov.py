"""Biases that are pulled back to zero, in every back end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from p2gd_fgo.backends.base import Backend
from p2gd_fgo.backends.factory import make_backend
from p2gd_fgo.config import load_config, override
from p2gd_fgo.evaluation.feature_runs import run_features
from p2gd_fgo.simulation.features import CAR_FEATURES
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.world_features import record_world_features
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import ImuBatch, NavState, Observations

STEP_NS = 100_000_000
TAU_GYRO_S, TAU_ACCEL_S = 5.0, 3.0
DENSITIES = {
    "gyro_noise_density": 1.7e-4,
    "gyro_random_walk": 1.0e-4,
    "accel_noise_density": 5.9e-3,
    "accel_random_walk": 1.0e-3,
}
KINDS = ["dead_reckoning", "msckf", "smoother"]
NONE = (np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)))


def backend(kind: str, **imu: float) -> Backend:
    chosen = {f"imu.{name}": value for name, value in (DENSITIES | imu).items()}
    config = override(load_config(), {"backend.kind": kind, "backend.window": 5} | chosen)
    scenario = load_scenario(find_preset("kaist_like"), {"duration_s": 1.0})
    calibration = record_world_features(scenario, model=CAR_FEATURES, build=False).calibration
    return make_backend(config, calibration, StageTimer())


@pytest.mark.parametrize("kind", KINDS)
def test_unseen_bias_forgets_its_start_and_keeps_the_stationary_sigma(kind: str) -> None:
    estimator = backend(kind, gyro_correlation_s=TAU_GYRO_S, accel_correlation_s=TAU_ACCEL_S)
    gyro_bias, accel_bias = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3])
    P = np.diag(np.repeat([1e-4, 1e-4, 1e-4, 4e-6, 4e-4], 3))
    estimator.start(NavState(0, np.eye(4), np.zeros(3), gyro_bias, accel_bias), P)
    estimate = estimator.update(Observations(0, *NONE), False)
    steps = 40
    for k in range(steps):
        stamps = k * STEP_NS + np.arange(11, dtype=np.int64) * 10_000_000
        state = estimate.state
        up = state.T_world_imu[2, :3] * 9.81  # it hangs still as far as it knows
        imu = ImuBatch(
            stamps, np.tile(state.gyro_bias, (11, 1)), np.tile(up + state.accel_bias, (11, 1))
        )
        estimator.propagate(imu)
        estimate = estimator.update(Observations(int(stamps[-1]), *NONE), False)
    t = steps * 0.1
    for name, bias, tau_s, walk, start, index in (
        ("gyro", gyro_bias, TAU_GYRO_S, DENSITIES["gyro_random_walk"], 4e-6, slice(9, 12)),
        ("accel", accel_bias, TAU_ACCEL_S, DENSITIES["accel_random_walk"], 4e-4, slice(12, 15)),
    ):
        left = np.exp(-t / tau_s)
        np.testing.assert_allclose(getattr(estimate.state, f"{name}_bias"), bias * left, rtol=1e-6)
        expected = start * left**2 + 0.5 * walk**2 * tau_s * (1.0 - left**2)
        variance = np.diagonal(estimate.covariance)[index]
        np.testing.assert_allclose(variance, expected, rtol=0.05)


@pytest.mark.parametrize("kind", ["msckf", "smoother"])
def test_only_the_right_model_is_exact(kind: str) -> None:
    """Biases decay without being driven, nothing else is wrong: all of the error is the model's."""
    quiet = {f"imu.{name}": 0.0 for name in DENSITIES}
    settings = {
        "duration_s": 15.0,
        "imu.bias_model": "gauss_markov",
        "imu.gyro_correlation_s": TAU_GYRO_S,
        "imu.accel_correlation_s": TAU_ACCEL_S,
        "imu.gyro_bias_sigma": 0.01,
        "imu.accel_bias_sigma": 0.1,
    }
    scenario = load_scenario(find_preset("kaist_like"), settings | quiet)
    model = replace(CAR_FEATURES, pixel_noise_px=0.0, camera_height_m=1.7)
    recording = record_world_features(scenario, model=model, build=False)
    right = run_features(
        backend(kind, gyro_correlation_s=TAU_GYRO_S, accel_correlation_s=TAU_ACCEL_S), recording
    )
    walking = run_features(backend(kind), recording)
    assert right.position_error.max() < 2e-3
    assert walking.position_error.max() > 20.0 * right.position_error.max()
