from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.distribution.p2gd.information import (
    StartUncertainty,
    cell_information,
    imu_information,
    pose_information,
)
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, transform
from p2gd_fgo.types import BoolArray, FloatArray

SIGMA = 1.0 / 700.0
NOISE = ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4)
DENSITIES = [field.name for field in fields(ImuNoise)][:4]
FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # camera looks along x


def drive(steps: int, speed: float = 0.7, yaw_rate: float = 0.0) -> FloatArray:
    """Cameras (steps + 1, 4, 4) of a car; speed and yaw per step."""
    time = np.arange(steps + 1.0)
    yaw = yaw_rate * time
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    centres = np.cumsum(speed * heading, axis=0) - speed * heading[0] + [3.0, -2.0, 1.5]
    R = so3.exp(yaw[:, None] * np.array([0.0, 0.0, 1.0])) @ FORWARD
    return from_rotation_translation(R, centres)


def points_at(T_world_cam: FloatArray, seen: FloatArray, depth: FloatArray) -> FloatArray:
    """Points in the world at normalised coordinates (P, 2) of the first camera."""
    rays = np.column_stack([seen, np.ones(len(seen))])
    return transform(T_world_cam[0], rays * np.asarray(depth, dtype=np.float64)[:, None])


def until(lengths: list[int], views: int) -> BoolArray:
    return np.arange(views) < np.array(lengths)[:, None]


def sightings(x: FloatArray, T_world_cam: FloatArray, visible: BoolArray) -> FloatArray:
    """All measurements at x = (δθ, δp, points), written out without any derivative."""
    points, out = x[6:].reshape(-1, 3), []
    last = len(T_world_cam) - 1
    for i, T in enumerate(T_world_cam):
        R, c = so3.exp(i / last * x[:3]) @ T[:3, :3], T[:3, 3] + i / last * x[3:6]
        for point in points[visible[:, i]]:
            q = R.T @ (point - c)
            out.extend(q[:2] / q[2])
    return np.array(out)


def brute_force(
    points: FloatArray, T_world_cam: FloatArray, visible: BoolArray, prior: FloatArray
) -> FloatArray:
    """Information about the motion: all parameters' Fisher matrix, inverted, its corner, back."""
    x = np.concatenate([np.zeros(6), points.ravel()])
    columns = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-5 * max(1.0, abs(x[k]))
        ahead = sightings(x + step, T_world_cam, visible)
        behind = sightings(x - step, T_world_cam, visible)
        columns.append((ahead - behind) / (2.0 * step[k]))
    J = np.column_stack(columns) / SIGMA
    fisher = J.T @ J
    fisher[:6, :6] += prior
    return np.asarray(np.linalg.inv(np.linalg.inv(fisher)[:6, :6]))


@pytest.mark.parametrize("yaw_rate", [0.0, 0.03])
@pytest.mark.parametrize("chosen", [[0], [3], [0, 1, 2, 3, 4, 5]], ids=["one", "far", "all"])
def test_agrees_with_the_inverse_of_the_full_fisher_matrix(
    yaw_rate: float, chosen: list[int]
) -> None:
    cameras = drive(8, yaw_rate=yaw_rate)
    seen = np.array([[-0.6, 0.2], [0.5, -0.1], [0.1, 0.3], [0.05, -0.05], [-0.3, 0.1], [0.2, -0.3]])
    points = points_at(cameras, seen, np.array([9.0, 12.0, 15.0, 60.0, 25.0, 40.0]))[chosen]
    visible = until([3, 6, 9, 9, 4, 7], 9)[chosen]
    prior = imu_information(NOISE, 2.0)
    expected = brute_force(points, cameras, visible, prior)
    actual = prior + pose_information(points, cameras, visible, SIGMA).sum(axis=0)
    whitening = np.linalg.inv(np.linalg.cholesky(expected))
    np.testing.assert_allclose(whitening @ actual @ whitening.T, np.eye(6), atol=2e-5)


def test_every_feature_has_its_own_share() -> None:
    cameras = drive(8, yaw_rate=0.02)
    points = points_at(cameras, np.array([[-0.4, 0.2], [0.3, -0.1]]), np.array([10.0, 30.0]))
    visible = until([4, 9], 9)
    both = pose_information(points, cameras, visible, SIGMA)
    for k in range(2):
        alone = pose_information(points[[k]], cameras, visible[[k]], SIGMA)
        np.testing.assert_allclose(both[k], alone[0], rtol=1e-12, atol=1e-12 * alone.max())


def test_information_turns_with_the_world() -> None:
    cameras = drive(6, yaw_rate=0.03)
    points = points_at(cameras, np.array([[-0.4, 0.2], [0.3, -0.1]]), np.array([10.0, 30.0]))
    visible = until([4, 7], 7)
    R = so3.exp(np.array([0.4, -0.9, 0.3]))
    T = from_rotation_translation(R, np.array([100.0, -50.0, 7.0]))
    turned = pose_information(transform(T, points), T @ cameras, visible, SIGMA)
    straight = pose_information(points, cameras, visible, SIGMA)
    both = np.kron(np.eye(2), R)
    expected = both @ straight @ both.T
    np.testing.assert_allclose(turned, expected, rtol=1e-6, atol=1e-8 * expected.max())


def rotation_known(information: FloatArray, translation_sigma: float) -> float:
    """Trace of the information about δθ when δp is only known to a sigma."""
    pp = information[3:, 3:] + np.eye(3) / translation_sigma**2
    reduced = information[:3, :3] - information[:3, 3:] @ np.linalg.solve(pp, information[3:, :3])
    return float(np.trace(reduced))


def test_a_far_point_tells_rotation_and_hardly_translation() -> None:
    cameras = drive(10)
    seen = np.array([[0.3, 0.1], [0.3, 0.1]])
    points = points_at(cameras, seen, np.array([10.0, 1000.0]))
    near, far = pose_information(points, cameras, until([11, 11], 11), SIGMA)
    assert np.trace(far[3:, 3:]) < 1e-3 * np.trace(near[3:, 3:])
    assert np.trace(far[:3, :3]) > 0.3 * np.trace(near[:3, :3])
    assert rotation_known(far, 0.1) > 5.0 * rotation_known(near, 0.1)


def test_speed_along_a_straight_path_stays_unknown() -> None:
    """Scale: a faster camera among points farther away sees the same."""
    cameras = drive(10)
    points = points_at(cameras, np.array([[0.3, 0.1], [-0.2, 0.3]]), np.array([9.0, 30.0]))
    for information in pose_information(points, cameras, until([11, 8], 11), SIGMA):
        translation = information[3:, 3:]
        assert translation[0, 0] < 1e-6 * np.trace(translation)


def test_points_that_are_not_tracked_bring_nothing() -> None:
    cameras = drive(5)
    points = points_at(cameras, np.zeros((4, 2)), np.array([5.0, 5.0, -3.0, 0.0]))
    visible = until([1, 0, 0, 0], 6)
    assert not pose_information(points, cameras, visible, SIGMA).any()
    assert pose_information(points[:0], cameras, visible[:0], SIGMA).shape == (0, 6, 6)
    assert not pose_information(points[:1], cameras[:1], visible[:1, :1], SIGMA).any()


def test_a_point_behind_a_later_camera_is_harmless() -> None:
    cameras = drive(10, speed=2.0)
    points = points_at(cameras, np.array([[0.5, 0.1]]), np.array([8.0]))
    visible = until([3], 11)
    short = pose_information(points, cameras, visible, SIGMA)
    moved = cameras.copy()
    moved[5:] = cameras[4]
    np.testing.assert_array_equal(short, pose_information(points, moved, visible, SIGMA))


@pytest.mark.parametrize(("ahead", "directions"), [(True, 2), (False, 1)])
def test_a_point_at_infinity_tells_rotation_only(ahead: bool, directions: int) -> None:
    """Off the direction of travel, a turn along the epipolar line looks like an inverse depth."""
    cameras = drive(10)
    seen = np.array([[0.0, 0.0] if ahead else [0.3, 0.1]])
    points = points_at(cameras, seen, np.array([1e9]))
    information = pose_information(points, cameras, until([11], 11), SIGMA)[0]
    values = np.linalg.eigvalsh(information[:3, :3])
    assert (values[3 - directions :] > 1e5).all()
    assert abs(values[: 3 - directions]).max() < 1.0
    assert abs(information[3:, 3:]).max() < 1e-6


def test_a_camera_at_rest_learns_two_directions_from_a_point() -> None:
    """Its depth can't be seen at all: without what is assumed about it nothing could be solved."""
    cameras = drive(10, speed=0.0)
    points = points_at(cameras, np.array([[0.3, 0.1]]), np.array([8.0]))
    values = np.linalg.eigvalsh(pose_information(points, cameras, until([11], 11), SIGMA)[0])
    assert values[4] > 1e5
    assert abs(values[:4]).max() < 1e-9 * values[4]


@pytest.mark.parametrize(
    "louder",
    [{}, *({name: 0.1} for name in ("velocity", "tilt", "gyro_bias", "accel_bias"))]
    + [{name: 0.1} for name in DENSITIES],
    ids=lambda louder: next(iter(louder), "all"),
)
def test_imu_information_is_the_integrated_covariance(louder: dict[str, float]) -> None:
    """Against the covariance of the error state carried forward in small steps."""
    quiet = dict.fromkeys(DENSITIES, 1e-3)
    noise = ImuNoise(**{name: louder.get(name, value) for name, value in quiet.items()})
    quiet = dict.fromkeys(("velocity", "tilt", "gyro_bias", "accel_bias"), 1e-3)
    start = StartUncertainty(**{name: louder.get(name, value) for name, value in quiet.items()})
    gravity, horizon, steps = 9.7, 1.5, 2000
    dt = horizon / steps
    F = np.zeros((15, 15))  # attitude, velocity, position, gyro bias, accel bias; world axes
    F[0:3, 9:12] = F[3:6, 12:15] = F[6:9, 3:6] = np.eye(3)
    F[3:6, 0:3] = -so3.hat(np.array([0.0, 0.0, gravity]))
    step = np.eye(15) + F * dt + F @ F * dt**2 / 2.0
    density = [noise.gyro_noise_density, noise.accel_noise_density, 0.0]
    density += [noise.gyro_random_walk, noise.accel_random_walk]
    Q = np.diag(np.repeat(density, 3)) ** 2 * dt
    sigmas = [0.0, start.velocity, 0.0, start.gyro_bias, start.accel_bias]
    P = np.diag(np.repeat(sigmas, 3)) ** 2
    tilted = np.zeros((15, 15))  # the tilt moves the end's position, and is no motion itself
    tilted[:2, :2] = start.tilt**2 * np.eye(2)
    for _ in range(steps):
        P = step @ P @ step.T + Q
        tilted = step @ tilted @ step.T
    ends = [0, 1, 2, 6, 7, 8]
    tilted[:3] = tilted[:, :3] = 0.0
    expected = (P + tilted)[np.ix_(ends, ends)]
    actual = np.linalg.inv(imu_information(noise, horizon, gravity, start))
    np.testing.assert_allclose(actual, expected, rtol=2e-3, atol=1e-5 * abs(expected).max())


def test_cells_hold_the_mean_of_their_features() -> None:
    information = np.stack([1.0 * np.eye(6), 3.0 * np.eye(6), 5.0 * np.eye(6), 0.0 * np.eye(6)])
    cells = cell_information(information, np.array([2, 2, 0, 3]), 5)
    expected = [5.0, 0.0, 2.0, 0.0, 0.0]
    np.testing.assert_allclose(cells, np.array(expected)[:, None, None] * np.eye(6))
