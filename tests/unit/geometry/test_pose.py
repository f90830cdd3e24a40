"""Rigid transforms and the interpolation between them."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.geometry import pose, so3
from p2gd_fgo.types import FloatArray, Trajectory

EPOCH_NS = 1_700_000_000_123_456_789


def random_poses(*shape: int) -> FloatArray:
    rng = np.random.default_rng(2)
    R = so3.exp(rng.standard_normal((*shape, 3)))
    return pose.from_rotation_translation(R, rng.standard_normal((*shape, 3)))


def test_inverse() -> None:
    T = random_poses(3, 4)
    expected = np.broadcast_to(np.eye(4), T.shape)
    np.testing.assert_allclose(pose.inverse(T) @ T, expected, atol=1e-14)
    np.testing.assert_allclose(pose.inverse(T), np.linalg.inv(T), atol=1e-14)


def test_a_rotation_is_shared_by_many_translations() -> None:
    p = np.arange(6.0).reshape(2, 3)
    T = pose.from_rotation_translation(np.eye(3), p)
    assert T.shape == (2, 4, 4)
    np.testing.assert_array_equal(T[:, :3, 3], p)
    np.testing.assert_array_equal(T[:, 3], [[0, 0, 0, 1]] * 2)


def test_transform_takes_points_of_b_to_a() -> None:
    T_a_b = random_poses(3)
    points = np.random.default_rng(4).standard_normal((3, 5, 3))
    homogeneous = np.concatenate([points, np.ones((3, 5, 1))], -1)
    expected = np.einsum("nij,nkj->nki", T_a_b, homogeneous)[..., :3]
    np.testing.assert_allclose(pose.transform(T_a_b, points), expected, atol=1e-14)
    np.testing.assert_allclose(pose.transform(T_a_b[0], points[0]), expected[0], atol=1e-14)


def test_interpolation_is_linear_in_position_and_geodesic_in_rotation() -> None:
    axis = np.array([0.0, 0.6, 0.8])
    T = pose.from_rotation_translation(
        so3.exp(np.outer([0.2, 1.2, 1.0], axis)), np.array([[0.0] * 3, [1.0, 2.0, 3.0], [0.0] * 3])
    )
    stamps = EPOCH_NS + np.array([0, 1_000_000_000, 1_500_000_000])
    trajectory = Trajectory(stamps, T)
    query = EPOCH_NS + np.array([0, 250_000_000, 1_000_000_000, 1_250_000_000, 1_500_000_000])
    got = pose.interpolate(trajectory, query)
    share = np.array([0.0, 0.25, 1.0, 0.5, 0.0])
    np.testing.assert_allclose(got[:, :3, 3], np.outer(share, [1.0, 2.0, 3.0]), atol=1e-12)
    angles = so3.log(got[:, :3, :3]) @ axis
    np.testing.assert_allclose(angles, [0.2, 0.45, 1.2, 1.1, 1.0], atol=1e-12)


def test_the_knots_themselves_come_back() -> None:
    T = random_poses(6)
    trajectory = Trajectory(EPOCH_NS + 7 * np.arange(6), T)
    np.testing.assert_allclose(pose.interpolate(trajectory, trajectory.stamps_ns), T, atol=1e-14)


def test_the_way_from_170_to_190_degrees_is_short() -> None:
    R = so3.exp(np.radians([[0.0, 0.0, 170.0], [0.0, 0.0, 190.0]]))
    trajectory = Trajectory(np.array([0, 10]), pose.from_rotation_translation(R, np.zeros(3)))
    middle = pose.interpolate(trajectory, np.array([5]))[0, :3, :3]
    np.testing.assert_allclose(middle, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)


def test_outside_the_nearest_end_is_taken() -> None:
    T = random_poses(3)
    trajectory = Trajectory(EPOCH_NS + np.array([0, 10, 30]), T)
    got = pose.interpolate(trajectory, EPOCH_NS + np.array([-(10**18), -1, 31, 10**18]))
    np.testing.assert_allclose(got, T[[0, 0, 2, 2]], atol=1e-14)


@pytest.mark.parametrize("query", [-5, 0, 5])
def test_a_single_pose_is_everywhere(query: int) -> None:
    T = random_poses(1)
    got = pose.interpolate(Trajectory(np.array([EPOCH_NS]), T), np.array([EPOCH_NS + query]))
    np.testing.assert_allclose(got, T, atol=1e-14)


def test_weights_keep_nanoseconds_of_epoch_stamps() -> None:
    stamps = EPOCH_NS + np.array([0, 3, 10])
    i, j, w = pose.interpolation_weights(stamps, EPOCH_NS + np.arange(11))
    got = (1.0 - w) * (stamps[i] - EPOCH_NS) + w * (stamps[j] - EPOCH_NS)
    np.testing.assert_allclose(got, np.arange(11.0), atol=1e-14)
    assert (j == i + 1).all()
