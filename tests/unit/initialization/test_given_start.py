"""The given start: what truth gives, what is derived, what is guessed, and what is drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from p2gd_fgo.config import Config, GivenStartConfig, override
from p2gd_fgo.errors import DataError, InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization import GivenStart, Start
from p2gd_fgo.initialization.given import disturbed
from p2gd_fgo.simulation.routes import CAR, make_route
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, NavState, Trajectory, Truth, Waiting

BEGIN_NS = 100 * NANOSECONDS
ROUTE = make_route(CAR, 5.0, np.random.default_rng(1), start_ns=BEGIN_NS)
STAMPS = BEGIN_NS + 10_000_000 * np.arange(501)
NO_IMU = ImuBatch(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
BIAS = np.column_stack([0.01 * np.ones(501), np.zeros(501), 1e-4 * np.arange(501)])


def truth(*, velocity: bool = True, biases: bool = True) -> Truth:
    full = ROUTE.truth(STAMPS)
    return Truth(
        full.trajectory,
        full.velocity if velocity else None,
        BIAS if biases else None,
        2.0 * BIAS if biases else None,
    )


def start_at(initializer: GivenStart, stamp_ns: int, imu: ImuBatch = NO_IMU) -> Start:
    answer = initializer.attempt(stamp_ns, imu, FeatureBuffer(5))
    assert isinstance(answer, Start)
    return answer


def sigmas(start: Start) -> FloatArray:
    """Of velocity, gyro bias, accelerometer bias."""
    return np.asarray(np.sqrt(np.diag(start.covariance))[6:].reshape(3, 3)[:, 0])


def test_truth_is_interpolated_at_the_image() -> None:
    c = GivenStartConfig()
    stamp = BEGIN_NS + 2_003_456_789
    start = start_at(GivenStart(c, truth(), 0), stamp)
    exact = ROUTE.sample(np.array([stamp]))
    assert start.state.stamp_ns == stamp
    np.testing.assert_allclose(start.state.T_world_imu, exact.T_world_imu[0], atol=1e-4)
    np.testing.assert_allclose(start.state.velocity, exact.velocity[0], atol=1e-3)
    np.testing.assert_array_equal(start.state.gyro_bias, BIAS[200])
    np.testing.assert_array_equal(start.state.accel_bias, 2.0 * BIAS[200])
    np.testing.assert_allclose(
        sigmas(start), [c.sigma_velocity, c.sigma_gyro_bias, c.sigma_accel_bias]
    )
    assert start.note == "given, from truth"


@pytest.mark.parametrize("at_s", [0.0, 2.5, 5.0])
def test_what_truth_lacks_is_derived_or_guessed_and_trusted_less(at_s: float) -> None:
    c = GivenStartConfig(loosening=3.0)
    stamp = BEGIN_NS + int(at_s * NANOSECONDS)
    start = start_at(GivenStart(c, truth(velocity=False, biases=False), 0), stamp)
    exact = ROUTE.sample(np.array([stamp])).velocity[0]
    # A central difference, one-sided at the ends.
    assert np.linalg.norm(start.state.velocity - exact) < (0.02 if at_s == 2.5 else 0.15)
    np.testing.assert_array_equal(start.state.gyro_bias, 0.0)
    np.testing.assert_array_equal(start.state.accel_bias, 0.0)
    expected = 3.0 * np.array([c.sigma_velocity, c.sigma_gyro_bias, c.sigma_accel_bias])
    np.testing.assert_allclose(sigmas(start), expected)


def test_biases_of_the_configuration_win_over_truth() -> None:
    c = GivenStartConfig(gyro_bias=(0.1, 0.2, 0.3), accel_bias=(0.0, 0.0, 0.0))
    start = start_at(GivenStart(c, truth(), 0), BEGIN_NS)
    np.testing.assert_array_equal(start.state.gyro_bias, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(start.state.accel_bias, 0.0)
    np.testing.assert_allclose(sigmas(start)[1:], [c.sigma_gyro_bias, c.sigma_accel_bias])


def test_tilt_and_yaw_are_the_worlds() -> None:
    config = GivenStartConfig(sigma_tilt_deg=0.5, sigma_yaw_deg=0.1)
    start = start_at(GivenStart(config, truth(), 0), BEGIN_NS + 3 * NANOSECONDS)
    R = start.state.T_world_imu[:3, :3]
    world = R @ start.covariance[:3, :3] @ R.T
    np.testing.assert_allclose(np.degrees(np.sqrt(np.diag(world))), [0.5, 0.5, 0.1])
    np.testing.assert_allclose(world - np.diag(np.diag(world)), 0.0, atol=1e-15)


def test_it_waits_for_the_truth_and_gives_up_behind_it() -> None:
    initializer = GivenStart(GivenStartConfig(), truth(), 0)
    before = initializer.attempt(BEGIN_NS - 1, NO_IMU, FeatureBuffer(5))
    assert isinstance(before, Waiting) and "truth" in before.reason
    with pytest.raises(InitializationError, match="no image within the time that the truth covers"):
        initializer.attempt(int(STAMPS[-1]) + 1, NO_IMU, FeatureBuffer(5))
    start_at(initializer, BEGIN_NS)


def test_a_hole_in_the_truth_is_not_bridged() -> None:
    full = truth().trajectory
    kept = (STAMPS <= BEGIN_NS + NANOSECONDS // 10) | (STAMPS >= BEGIN_NS + NANOSECONDS)
    holed = Truth(Trajectory(STAMPS[kept], full.T_world_imu[kept]))
    initializer = GivenStart(GivenStartConfig(), holed, 0)
    answer = initializer.attempt(BEGIN_NS + NANOSECONDS // 2, NO_IMU, FeatureBuffer(5))
    assert isinstance(answer, Waiting) and "hole" in answer.reason
    for edge in (BEGIN_NS, BEGIN_NS + NANOSECONDS // 10, BEGIN_NS + NANOSECONDS):
        start = start_at(initializer, edge)
        exact = ROUTE.sample(np.array([edge])).velocity[0]  # one-sided: half the base's change
        assert np.linalg.norm(start.state.velocity - exact) < 0.15


def test_a_lone_pose_between_two_holes_gives_no_velocity() -> None:
    full = truth()
    alone = BEGIN_NS + NANOSECONDS
    kept = (alone == STAMPS) | (STAMPS >= BEGIN_NS + 2 * NANOSECONDS)
    trajectory = Trajectory(STAMPS[kept], full.trajectory.T_world_imu[kept])
    initializer = GivenStart(GivenStartConfig(), Truth(trajectory), 0)
    answer = initializer.attempt(alone, NO_IMU, FeatureBuffer(5))
    assert isinstance(answer, Waiting) and "hole" in answer.reason
    assert full.velocity is not None
    measured = Truth(trajectory, full.velocity[kept])
    start_at(GivenStart(GivenStartConfig(), measured, 0), alone)


def test_a_state_from_the_configuration() -> None:
    c = GivenStartConfig(
        source="config",
        position=(1.0, 2.0, 3.0),
        rotation_vector=(0.1, -0.2, 1.5),
        velocity=(4.0, 0.0, -1.0),
        gyro_bias=(0.01, 0.0, 0.0),
    )
    start = start_at(GivenStart(c, None, 0), 42)
    np.testing.assert_allclose(
        start.state.T_world_imu[:3, :3], so3.exp(np.array(c.rotation_vector)), atol=1e-15
    )
    np.testing.assert_array_equal(start.state.T_world_imu[:3, 3], c.position)
    np.testing.assert_array_equal(start.state.velocity, c.velocity)
    np.testing.assert_array_equal(start.state.gyro_bias, [0.01, 0.0, 0.0])
    np.testing.assert_array_equal(start.state.accel_bias, 0.0)


def test_without_truth_it_is_refused() -> None:
    config = override(Config(), {"initialization.kind": "given"})
    with pytest.raises(DataError, match=r"no truth: use 'static', or .*source=config"):
        GivenStart(config.initialization.given, None, 0)
    assert isinstance(GivenStart(config.initialization.given, truth(), 0), GivenStart)


def error_of(told: NavState, true: NavState) -> FloatArray:
    """R = R̂ Exp(δθ), the rest additive."""
    turn = so3.log(told.T_world_imu[:3, :3].T @ true.T_world_imu[:3, :3])
    return np.concatenate(
        [
            turn,
            true.T_world_imu[:3, 3] - told.T_world_imu[:3, 3],
            true.velocity - told.velocity,
            true.gyro_bias - told.gyro_bias,
            true.accel_bias - told.accel_bias,
        ]
    )


def test_drawn_errors_have_the_covariance() -> None:
    stamp = BEGIN_NS + 2 * NANOSECONDS
    exact = start_at(GivenStart(GivenStartConfig(), truth(), 0), stamp)
    noisy = GivenStartConfig(noise=True)
    errors = np.array(
        [error_of(start_at(GivenStart(noisy, truth(), k), stamp).state, exact.state)
         for k in range(500)]
    )  # fmt: skip
    nees = np.einsum("ni,ni->n", errors, np.linalg.solve(exact.covariance, errors.T).T)
    low, high = (float(chi2.ppf(p, 15 * 500)) / 500 for p in (0.001, 0.999))
    assert low < nees.mean() < high
    np.testing.assert_allclose(errors.std(0), np.sqrt(np.diag(exact.covariance)), rtol=0.12)


def test_correlated_errors_are_drawn_too() -> None:
    state = start_at(GivenStart(GivenStartConfig(), truth(), 0), BEGIN_NS).state
    rng = np.random.default_rng(3)
    L = 0.01 * np.tril(rng.standard_normal((15, 15))) + 0.02 * np.eye(15)
    errors = np.array([error_of(disturbed(state, L @ L.T, rng), state) for _ in range(3000)])
    whitened = np.linalg.solve(L, errors.T)
    np.testing.assert_allclose(np.cov(whitened), np.eye(15), atol=0.12)


def test_the_seed_decides_the_draw() -> None:
    made = [start_at(GivenStart(GivenStartConfig(noise=True), truth(), k), BEGIN_NS)
            for k in (1, 1, 2)]  # fmt: skip
    np.testing.assert_array_equal(made[0].state.T_world_imu, made[1].state.T_world_imu)
    assert (made[0].state.velocity != made[2].state.velocity).all()


def test_one_seed_draws_another_error_on_another_recording() -> None:
    """Routes whose starts err alike are not independent, as intervals over routes take them."""
    stamps = np.array([BEGIN_NS])
    imus = [ImuBatch(stamps, np.full((1, 3), g), np.array([[0.0, 0.0, 9.81]])) for g in (0.0, 0.1)]
    noisy = GivenStartConfig(noise=True)
    made = [start_at(GivenStart(noisy, truth(), 1), BEGIN_NS, imus[k]) for k in (0, 0, 1)]
    np.testing.assert_array_equal(made[0].state.velocity, made[1].state.velocity)
    assert (made[0].state.velocity != made[2].state.velocity).all()
