"""The error's transition and noise against drawn and differenced integrations."""

from __future__ import annotations

import numpy as np
import pytest
from msckf_samples import filter_state, gauge, nav_state, numerical_jacobian

from p2gd_fgo.backends.msckf.propagation import propagate
from p2gd_fgo.backends.msckf.state import FilterState
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.imu import integrate
from p2gd_fgo.simulation.imu import MEMS_NOISE
from p2gd_fgo.types import FloatArray, ImuBatch, NavState

GRAVITY = 9.81
NO_NOISE = ImuNoise(0.0, 0.0, 0.0, 0.0)


def shaken(rng: np.random.Generator, samples: int = 11, rate_hz: int = 100) -> ImuBatch:
    stamps = 1_000_000_000 + np.arange(samples) * (1_000_000_000 // rate_hz)
    gyro = np.array([0.5, -0.8, 0.6]) + 0.3 * rng.normal(size=(samples, 3))
    return ImuBatch(stamps, gyro, np.array([1.0, 2.0, 9.0]) + rng.normal(size=(samples, 3)))


def moved(state: NavState, error: FloatArray) -> NavState:
    T = state.T_world_imu.copy()
    T[:3, :3] = T[:3, :3] @ so3.exp(error[:3])
    T[:3, 3] += error[3:6]
    return NavState(
        state.stamp_ns, T, state.velocity + error[6:9], state.gyro_bias + error[9:12],
        state.accel_bias + error[12:15],
    )  # fmt: skip


def difference(state: NavState, truth: NavState) -> FloatArray:
    R, p = state.T_world_imu[:3, :3], state.T_world_imu[:3, 3]
    return np.concatenate(
        [
            so3.log(R.T @ truth.T_world_imu[:3, :3]),
            truth.T_world_imu[:3, 3] - p,
            truth.velocity - state.velocity,
            truth.gyro_bias - state.gyro_bias,
            truth.accel_bias - state.accel_bias,
        ]
    )


def transition(state: FilterState, imu: ImuBatch, *, fej: bool) -> FloatArray:
    """Φ, read off the cross covariance that it leaves between the clone and the IMU."""
    eye = FilterState(
        state.stamps_ns, state.poses, state.velocity, state.gyro_bias, state.accel_bias,
        state.first_poses, state.first_velocity, np.eye(len(state.covariance)),
    )  # fmt: skip
    P = propagate(eye, imu, NO_NOISE, GRAVITY, fej=fej).covariance[-15:, -15:]
    cross = propagate(eye, imu, NO_NOISE, GRAVITY, fej=fej).covariance[-15:, :-15]
    Phi = np.eye(15)
    Phi[:, :6] = cross[:, -6:]
    # The columns of velocity and biases: P = Φ Φᵀ, where these rows of Φ are known.
    Phi[0:3, 9:12] = P[0:3, 9:12]
    Phi[3:9, 9:15] = P[3:9, 9:15]
    Phi[3:6, 6:9] = np.eye(3) * (imu.stamps_ns[-1] - imu.stamps_ns[0]) * 1e-9
    return Phi


def test_mean_is_what_the_smoother_integrates() -> None:
    rng = np.random.default_rng(0)
    start, imu = nav_state(rng), shaken(rng)
    ours = propagate(FilterState.begin(start, np.eye(15)), imu, MEMS_NOISE, GRAVITY, fej=False)
    theirs = integrate(start, imu, GRAVITY)
    np.testing.assert_array_equal(ours.newest().T_world_imu, theirs.T_world_imu)
    np.testing.assert_array_equal(ours.newest().velocity, theirs.velocity)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_transition_is_the_integrals_jacobian(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, imu = nav_state(rng), shaken(rng)
    end = integrate(start, imu, GRAVITY)
    expected = numerical_jacobian(
        lambda e: difference(end, integrate(moved(start, e), imu, GRAVITY)), 15
    )
    Phi = transition(FilterState.begin(start, np.eye(15)), imu, fej=False)
    np.testing.assert_allclose(Phi, expected, atol=2e-5)


def test_noise_is_that_of_the_samples() -> None:
    """White and walking noise of each sample at 100 Hz for 0.2 s, through numerical derivatives."""
    rng = np.random.default_rng(3)
    start, imu, dt = nav_state(rng), shaken(rng, 21), 0.01
    # Bias walks loud enough to be seen beside the white noise.
    noise = ImuNoise(1e-3, 2e-2, 1e-2, 2e-1)
    begin = FilterState.begin(start, np.zeros((15, 15)))
    Q = propagate(begin, imu, noise, GRAVITY, fej=False).covariance[-15:, -15:]
    clean = integrate(start, imu, GRAVITY)

    def by_samples(errors: FloatArray) -> FloatArray:
        gyro, accel = errors.reshape(2, 21, 3)
        noisy = ImuBatch(imu.stamps_ns, imu.gyro + gyro, imu.accel + accel)
        return difference(clean, integrate(start, noisy, GRAVITY))

    J = numerical_jacobian(by_samples, 126).reshape(15, 2, 21, 3)
    white = J * np.array([noise.gyro_noise_density, noise.accel_noise_density])[:, None, None]
    expected = flat_square(white / np.sqrt(dt))
    # A step of the walk before sample k is in all samples from k on, and with the other sign in
    # the error of the bias at the end: the estimate has not followed it.
    steps = -np.cumsum(J[:, :, ::-1], axis=2)[:, :, ::-1]
    steps[9:12, 0] += np.eye(3)[:, None]
    steps[12:15, 1] += np.eye(3)[:, None]
    walks = np.array([noise.gyro_random_walk, noise.accel_random_walk])[:, None, None]
    expected += flat_square((steps * walks * np.sqrt(dt))[:, :, 1:])
    scale = np.sqrt(np.outer(np.diagonal(Q), np.diagonal(Q)))
    np.testing.assert_allclose(expected / scale, Q / scale, atol=0.04)


def flat_square(columns: FloatArray) -> FloatArray:
    flat = columns.reshape(15, -1)
    return np.asarray(flat @ flat.T)


@pytest.mark.parametrize("fej", [False, True])
def test_transition_carries_the_worlds_turn_and_shift_along(fej: bool) -> None:
    """Φ N = N at the next image: exactly between first estimates, not between those of now."""
    rng = np.random.default_rng(4)
    state, imu = filter_state(rng, 2), shaken(rng)
    Phi = transition(state, imu, fej=fej)
    after = propagate(state, imu, NO_NOISE, GRAVITY, fej=fej)
    before = gauge(state.first_poses, state.first_velocity)[-15:]
    expected = gauge(after.first_poses, after.first_velocity)[-15:]
    wrong = np.abs(Phi @ before - expected).max()
    assert wrong < 1e-12 if fej else wrong > 1e-3
