"""Where the tracks' points are: a linear solution, refined by Gauss-Newton.

All tracks at once, as flat lists of sightings: sums over a track are ``reduceat``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.backends.msckf.state import Poses
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.types import BoolArray, FloatArray

LEAST_DEPTH_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """M points.

    Attributes
    ----------
    position
        (M, 3) in the world.
    condition
        (M,) condition number of the linear system: large where the rays are nearly parallel.
    in_front
        (M,) before all cameras that saw it, by 0.1 m or more.
    distance
        (M,) m, from the farthest of these cameras.
    """

    position: FloatArray
    condition: FloatArray
    in_front: BoolArray
    distance: FloatArray


def camera_poses(poses: Poses, T_imu_cam: FloatArray) -> Poses:
    """World from camera, of world from IMU."""
    return Poses(poses.R @ T_imu_cam[:3, :3], poses.p + poses.R @ T_imu_cam[:3, 3])


def triangulate(sightings: Sightings, cameras: Poses, steps: int) -> Points:
    """Each track's point, as seen from ``cameras``, after ``steps`` of Gauss-Newton.

    A point that has no solution is not in front.
    """
    R, p = cameras.R[sightings.view], cameras.p[sightings.view]
    rays = np.concatenate([sightings.normalized, np.ones((len(R), 1))], axis=1)
    position, condition = linear(sightings, R, p, rays)
    # The first camera that saw a point holds it, as (x/z, y/z, 1/z): nearly linear in pixels.
    anchor = sightings.starts[sightings.track]
    Rt = np.swapaxes(R, -1, -2)
    turn = Rt @ R[anchor]
    shift = (Rt @ (p[anchor] - p)[..., None])[..., 0]
    held = (Rt[sightings.starts] @ (position - p[sightings.starts])[..., None])[..., 0]
    held[:, 2] = np.where(np.abs(held[:, 2]) > LEAST_DEPTH_M, held[:, 2], LEAST_DEPTH_M)
    held = np.column_stack([held[:, :2], np.ones(len(held))]) / held[:, 2:]
    for _ in range(steps):
        held = held + gauss_newton_step(sightings, turn, shift, held)
    return _points(sightings, R, p, condition, held)


def linear(
    sightings: Sightings, R: FloatArray, p: FloatArray, rays: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points (M, 3) nearest to their rays, least squares of Σ (I − d dᵀ), and condition (M,).

    R (O, 3, 3), p (O, 3) and rays (O, 3) are of each sighting. Positions are counted from the
    last camera, so that the result doesn't depend on where the world begins.
    """
    d = (R @ rays[..., None])[..., 0]
    d /= np.linalg.norm(d, axis=1)[:, None]
    origin = p[-1]
    offset = p - origin
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    A = np.add.reduceat(across, sightings.starts)
    b = np.add.reduceat(offset - d * np.sum(d * offset, axis=1)[:, None], sightings.starts)
    eigenvalues = np.maximum(np.linalg.eigvalsh(A), 1e-15)
    condition = eigenvalues[:, 2] / eigenvalues[:, 0]
    A += (1e-14 * eigenvalues[:, 2])[:, None, None] * np.eye(3)
    return origin + np.linalg.solve(A, b[..., None])[..., 0], condition


def gauss_newton_step(
    sightings: Sightings, turn: FloatArray, shift: FloatArray, held: FloatArray
) -> FloatArray:
    """Step (M, 3) of (a, b, ρ), the point being (a, b, 1)/ρ in its first camera.

    ``turn`` (O, 3, 3) and ``shift`` (O, 3) take its first camera's frame to the sighting's; the
    point there is turn (a, b, 1) + ρ shift, up to scale.
    """
    x = held[sightings.track]
    h = turn[:, :, 0] * x[:, 0:1] + turn[:, :, 1] * x[:, 1:2] + turn[:, :, 2] + shift * x[:, 2:3]
    depth = np.where(np.abs(h[:, 2]) > 1e-6, h[:, 2], 1e-6)
    z = h[:, :2] / depth[:, None]
    columns = np.concatenate([turn[:, :, :2], shift[:, :, None]], axis=2)
    J = (columns[:, :2] - z[:, :, None] * columns[:, 2:]) / depth[:, None, None]
    residual = sightings.normalized - z
    Jt = np.swapaxes(J, -1, -2)
    A = np.add.reduceat(Jt @ J, sightings.starts)
    b = np.add.reduceat((Jt @ residual[..., None])[..., 0], sightings.starts)
    size = np.einsum("mii->mi", A)
    size += 1e-12 * size + 1e-18
    return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])


def _points(
    sightings: Sightings, R: FloatArray, p: FloatArray, condition: FloatArray, held: FloatArray
) -> Points:
    ahead = np.isfinite(held).all(axis=1) & (held[:, 2] > 1e-9)
    held = np.where(ahead[:, None], held, 1.0)
    local = np.column_stack([held[:, :2], np.ones(len(held))]) / held[:, 2:]
    first = sightings.starts
    position = p[first] + (R[first] @ local[..., None])[..., 0]
    away = position[sightings.track] - p
    depth = np.sum(R[:, :, 2] * away, axis=1)
    return Points(
        position,
        condition,
        ahead & (np.minimum.reduceat(depth, first) > LEAST_DEPTH_M),
        np.maximum.reduceat(np.linalg.norm(away, axis=1), first),
    )
