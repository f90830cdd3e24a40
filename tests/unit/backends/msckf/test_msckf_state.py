"""Augmentation, marginalisation, correction."""

from __future__ import annotations

import numpy as np
from msckf_samples import filter_state, nav_state

from p2gd_fgo.backends.msckf.state import FilterState
from p2gd_fgo.geometry import so3


def test_moving_on_is_cloning_then_the_papers_equation_11() -> None:
    rng = np.random.default_rng(0)
    state, predicted = filter_state(rng, 3), nav_state(rng)
    Phi, Q = rng.normal(size=(15, 15)), np.eye(15)
    moved = state.propagated(predicted, Phi, Q)
    # By the book: the newest pose is copied, then the IMU's error goes through Φ.
    n = len(state.covariance)
    copied = np.concatenate([np.eye(n)[:18], np.eye(n)[-15:]])
    transition = np.eye(n + 6)
    transition[-15:, -15:] = Phi
    noise = np.zeros((n + 6, n + 6))
    noise[-15:, -15:] = Q
    J = transition @ copied
    np.testing.assert_allclose(moved.covariance, J @ state.covariance @ J.T + noise, atol=1e-12)
    assert len(moved) == 4
    np.testing.assert_array_equal(moved.poses.R[2], state.poses.R[2])
    np.testing.assert_array_equal(moved.newest().T_world_imu, predicted.T_world_imu)


def test_first_positions_are_a_chain_of_motions_without_the_corrections() -> None:
    rng = np.random.default_rng(1)
    state = FilterState.begin(nav_state(rng), np.eye(15))
    begin = state.poses.p[0].copy()
    corrected = state.corrected(np.r_[np.zeros(3), 5.0, 5.0, 5.0, np.zeros(9)], np.eye(15))
    predicted = nav_state(rng)
    moved = corrected.propagated(predicted, np.eye(15), np.eye(15))
    motion = predicted.T_world_imu[:3, 3] - corrected.poses.p[0]
    np.testing.assert_allclose(moved.first_poses.p, [begin, begin + motion])
    np.testing.assert_allclose(moved.first_poses.R[1], predicted.T_world_imu[:3, :3])


def test_correction_moves_each_part_by_its_own_error() -> None:
    rng = np.random.default_rng(2)
    state = filter_state(rng, 2)
    error = 0.1 * rng.normal(size=21)
    moved = state.corrected(error, state.covariance)
    for k in range(2):
        turn = so3.log(state.poses.R[k].T @ moved.poses.R[k])
        np.testing.assert_allclose(turn, error[6 * k : 6 * k + 3], atol=1e-12)
        shift = moved.poses.p[k] - state.poses.p[k]
        np.testing.assert_allclose(shift, error[6 * k + 3 : 6 * k + 6], atol=1e-12)
    new, old = moved.newest(), state.newest()
    change = [new.velocity - old.velocity, new.gyro_bias - old.gyro_bias]
    change.append(new.accel_bias - old.accel_bias)
    np.testing.assert_allclose(np.concatenate(change), error[12:], atol=1e-12)
    np.testing.assert_array_equal(moved.first_poses.p, state.first_poses.p)


def test_marginalising_the_oldest_image_leaves_all_else() -> None:
    state = filter_state(np.random.default_rng(3), 3)
    rest = state.without_oldest()
    assert rest.stamps_ns == state.stamps_ns[1:]
    np.testing.assert_array_equal(rest.covariance, state.covariance[6:, 6:])
    np.testing.assert_array_equal(rest.newest_covariance(), state.newest_covariance())
    np.testing.assert_array_equal(rest.trajectory().T_world_imu, state.trajectory().T_world_imu[1:])


def test_an_error_about_one_state_is_seen_from_another() -> None:
    rng = np.random.default_rng(3)
    state = filter_state(rng, 3)
    size = len(state.covariance)
    error = 0.3 * rng.normal(size=size)
    other = state.corrected(error, state.covariance)
    found, there = state.moved_to(other, np.eye(size))
    np.testing.assert_allclose(found, error, atol=1e-12)
    small = 1e-6 * rng.normal(size=size)
    beside = state.corrected(error + small, state.covariance)
    np.testing.assert_allclose(other.moved_to(beside, np.eye(size))[0], there @ small, atol=1e-11)
    nothing, same = state.moved_to(state, there)
    assert not nothing.any() and same is there
