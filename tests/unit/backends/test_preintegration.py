"""The IMU factor against strapdown integration and its error dynamics."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest

from p2gd_fgo.backends.dead_reckoning import DeadReckoning
from p2gd_fgo.backends.smoother.preintegration import Preintegrator
from p2gd_fgo.backends.smoother.window import WindowStates, window_covariance
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.imu import between, integrate
from p2gd_fgo.simulation.imu import MEMS_NOISE
from p2gd_fgo.types import FloatArray, ImuBatch, NavState, Observations

GRAVITY = 9.81
BIAS = np.array([0.05, -0.1, 0.2, 0.01, -0.02, 0.005])  # accelerometer, gyroscope


def swaying(rate_hz: int) -> ImuBatch:
    stamps = np.arange(0, 1_000_000_001, 1_000_000_000 // rate_hz)
    t = stamps[:, None] * 1e-9
    gyro = np.array([0.1, -0.2, 0.45]) + 0.2 * np.sin(6.0 * t + np.array([0.0, 1.0, 2.0]))
    accel = np.array([1.0, 4.0, 9.8]) + 2.0 * np.sin(9.0 * t + np.array([2.0, 0.0, 1.0]))
    return ImuBatch(stamps, gyro + BIAS[3:], accel + BIAS[:3])


def start(stamp_ns: int) -> NavState:
    T = from_rotation_translation(so3.exp(np.array([0.1, -0.2, 1.0])), np.array([3.0, 1.0, 2.0]))
    return NavState(stamp_ns, T, np.array([9.0, 1.0, -0.5]), BIAS[3:], BIAS[:3])


def residual(imu: ImuBatch, first: NavState, second: NavState) -> FloatArray:
    """Rotation, position and velocity part of the factor's error between two states."""
    states = WindowStates.empty().append(0, first).append(1, second)
    (factor,) = Preintegrator(MEMS_NOISE, GRAVITY).factors(imu, BIAS, 0, 1)
    assert isinstance(factor, gtsam.CombinedImuFactor)
    return np.asarray(factor.unwhitenedError(states.values(np.zeros(3))))[:9]


@pytest.mark.parametrize("start_ns", [300_000_000, 305_000_000, 302_347_111])
def test_factor_agrees_with_the_prediction_on_and_off_the_grid(start_ns: int) -> None:
    first = start(start_ns)
    imu = between(swaying(100), start_ns, start_ns + 100_000_000)
    assert np.abs(residual(imu, first, integrate(first, imu, GRAVITY))).max() < 2e-6


def test_interval_off_the_grid_is_not_cut_to_the_samples() -> None:
    """5 ms at 9 m/s are 4.5 cm: the factor must see the motion from image to image."""
    fine = swaying(1000)
    first = start(305_000_000)
    truth = integrate(first, between(fine, 305_000_000, 405_000_000), GRAVITY)
    imu = between(swaying(100), 305_000_000, 405_000_000)
    assert np.abs(residual(imu, first, truth)).max() < 5e-4


def test_noise_is_that_of_the_error_dynamics() -> None:
    """Every covariance is set: GTSAM's defaults are the identity."""
    imu = between(swaying(200), 305_000_000, 405_000_000)
    reckoning = DeadReckoning(MEMS_NOISE, GRAVITY)
    at_rest = NavState(305_000_000, np.eye(4), np.zeros(3), BIAS[3:], BIAS[:3])
    reckoning.start(at_rest, np.zeros((15, 15)))
    reckoning.propagate(imu)
    none = Observations(0, np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)))
    expected = window_covariance(reckoning.update(none, False).covariance, np.eye(3))
    (measured,) = Preintegrator(MEMS_NOISE, GRAVITY).factors(imu, BIAS, 0, 1)
    assert isinstance(measured, gtsam.CombinedImuFactor)
    covariance = np.asarray(measured.preintegratedMeasurements().preintMeasCov())
    scale = np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected)))
    np.testing.assert_allclose(covariance / scale, expected / scale, atol=0.06)
