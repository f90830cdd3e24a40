"""Points from tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msckf_samples import T_IMU_CAM, filter_state, flat, numerical_jacobian, sightings

from p2gd_fgo.backends.msckf.state import Poses
from p2gd_fgo.backends.msckf.triangulation import camera_poses, gauss_newton_step, triangulate
from p2gd_fgo.types import FloatArray

SPANS = [(0, 6), (1, 4), (2, 6), (0, 2), (3, 6)]


def test_exact_rays_give_the_point_wherever_the_world_begins() -> None:
    rng = np.random.default_rng(0)
    poses = filter_state(rng, 6).poses
    seen, points = sightings(rng, poses, SPANS)
    for shift in (np.zeros(3), np.array([1e5, -2e5, 1e3])):
        cameras = camera_poses(Poses(poses.R, poses.p + shift), T_IMU_CAM)
        found = triangulate(seen, cameras, 2)
        np.testing.assert_allclose(found.position, points + shift, atol=1e-6)
        assert found.in_front.all()
        np.testing.assert_allclose(found.distance, farthest(points + shift, cameras), rtol=1e-9)


def farthest(points: FloatArray, cameras: Poses) -> list[float]:
    return [
        float(np.linalg.norm(cameras.p[a:b] - point, axis=1).max())
        for point, (a, b) in zip(points, SPANS, strict=True)
    ]


def test_refinement_reaches_the_least_reprojection_error() -> None:
    rng = np.random.default_rng(1)
    poses = filter_state(rng, 6).poses
    seen, _ = sightings(rng, poses, SPANS, noise=2e-3)
    cameras = camera_poses(poses, T_IMU_CAM)
    found = triangulate(seen, cameras, 6)
    for k in range(len(seen)):
        rows = seen.track == k

        def error(step: FloatArray, k: int = k, rows: FloatArray = rows) -> FloatArray:
            R, p = cameras.R[seen.view[rows]], cameras.p[seen.view[rows]]
            local = (np.swapaxes(R, 1, 2) @ (found.position[k] + step - p)[..., None])[..., 0]
            return np.asarray((local[:, :2] / local[:, 2:] - seen.normalized[rows]).ravel())

        J = numerical_jacobian(error, 3)
        gradient = J.T @ error(np.zeros(3)) / np.linalg.norm(J, axis=0)
        assert np.abs(gradient).max() < 1e-8


def test_gauss_newton_step_is_by_the_true_jacobian() -> None:
    """From a point nearby, one step of an exact Jacobian leaves an error of second order."""
    rng = np.random.default_rng(2)
    poses = filter_state(rng, 4).poses
    seen, points = sightings(rng, poses, [(0, 4)])
    cameras = camera_poses(poses, T_IMU_CAM)
    Rt = np.swapaxes(cameras.R, 1, 2)
    turn = Rt @ cameras.R[0]
    shift = (Rt @ (cameras.p[0] - cameras.p)[..., None])[..., 0]
    local = cameras.R[0].T @ (points[0] - cameras.p[0])
    truth = np.array([local[0], local[1], 1.0]) / local[2]
    left = []
    for size in (1e-3, 1e-4):
        start = truth + size * np.array([1.0, -1.0, 0.5])
        step = gauss_newton_step(seen, turn, shift, start[None])[0]
        left.append(np.linalg.norm(start + step - truth))
    assert left[0] < 1e-4 and left[1] < 0.02 * left[0]


def test_parallel_rays_and_points_behind_are_told() -> None:
    rng = np.random.default_rng(3)
    poses = filter_state(rng, 4).poses
    still = Poses(np.repeat(poses.R[:1], 4, axis=0), np.repeat(poses.p[:1], 4, axis=0))
    seen, _ = sightings(rng, still, [(0, 4), (1, 4)])
    found = triangulate(seen, camera_poses(still, T_IMU_CAM), 3)
    assert (found.condition > 1e12).all()
    assert np.isfinite(found.position).all()

    # Rays that meet behind the cameras: the second camera is moved the other way.
    table = np.array([[[0.0, 0.0], [0.1, 0.0]]])
    apart = Poses(np.stack([np.eye(3)] * 2), np.array([[0.0, 0, 0], [1.0, 0, 0]]))
    crossing = flat(table, np.array([0]), np.array([2]))
    assert not triangulate(crossing, apart, 3).in_front[0]
    ahead = replace(crossing, normalized=-crossing.normalized)
    assert triangulate(ahead, apart, 3).in_front[0]
