"""Equal poses, said to the filter."""

from __future__ import annotations

import numpy as np
from msckf_samples import filter_state, gauge, numerical_jacobian

from p2gd_fgo.backends.msckf.standstill import relative_pose, relative_pose_jacobian
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray


def test_jacobian_is_that_of_the_relative_pose() -> None:
    state = filter_state(np.random.default_rng(0), 4)
    size = len(state.covariance)

    def moved(error: FloatArray) -> FloatArray:
        return relative_pose(state.corrected(error, state.covariance).poses, 1, 2)

    H = relative_pose_jacobian(state.poses, 1, 2, size)
    np.testing.assert_allclose(H, numerical_jacobian(moved, size), atol=1e-8)


def test_relative_pose_of_a_known_step() -> None:
    state = filter_state(np.random.default_rng(1), 2)
    R, p = state.poses.R, state.poses.p
    R[1] = R[0] @ so3.exp(np.array([0.1, -0.2, 0.3]))
    p[1] = p[0] + R[0] @ np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(relative_pose(state.poses, 0, 1), [0.1, -0.2, 0.3, 1, 2, 3])


def test_nothing_is_learnt_of_where_the_world_is_and_how_it_is_turned() -> None:
    state = filter_state(np.random.default_rng(2), 3)
    at = state.first_poses
    H = relative_pose_jacobian(at, 1, 2, len(state.covariance))
    assert np.abs(H @ gauge(at, state.first_velocity)).max() < 1e-12
    assert np.abs(H @ gauge(state.poses, state.velocity)).max() > 1e-3
