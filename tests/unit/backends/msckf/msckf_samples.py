"""Random states, cameras and tracks for the tests of the filter's parts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from p2gd_fgo.backends.msckf.measurement import Sensor
from p2gd_fgo.backends.msckf.state import POSE_DIM, FilterState, Poses
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import FloatArray, IntArray, NavState

T_IMU_CAM = from_rotation_translation(
    so3.exp(np.array([-1.2, 1.1, -1.3])), np.array([0.3, -0.1, 0.2])
)
CAMERA = RadTanCamera(800, 600, 500.0, 480.0, 400.0, 300.0, -0.1, 0.05, 0.001, -0.002)
SENSOR = Sensor(CAMERA, T_IMU_CAM, 0.8)


def nav_state(rng: np.random.Generator) -> NavState:
    T = from_rotation_translation(so3.exp(rng.normal(size=3)), 5.0 * rng.normal(size=3))
    return NavState(
        1_000_000_000, T, rng.normal(size=3), 0.02 * rng.normal(size=3), 0.1 * rng.normal(size=3)
    )


def filter_state(rng: np.random.Generator, images: int, spread_m: float = 1.0) -> FilterState:
    """Poses that look the same way within some degrees; first estimates a little beside them."""
    nav = nav_state(rng)
    R = nav.T_world_imu[:3, :3] @ so3.exp(0.1 * rng.normal(size=(images, 3)))
    p = nav.T_world_imu[:3, 3] + spread_m * rng.normal(size=(images, 3))
    first = Poses(
        R @ so3.exp(0.01 * rng.normal(size=(images, 3))), p + 0.05 * rng.normal(size=(images, 3))
    )
    size = POSE_DIM * images + 9
    A = rng.normal(size=(size, size)) * 0.01
    return FilterState(
        tuple(range(0, 100 * images, 100)),
        Poses(R, p),
        nav.velocity,
        nav.gyro_bias,
        nav.accel_bias,
        first,
        nav.velocity + 0.1 * rng.normal(size=3),
        A @ A.T + 1e-6 * np.eye(size),
    )


def sightings(
    rng: np.random.Generator, poses: Poses, spans: list[tuple[int, int]], noise: float = 0.0
) -> tuple[Sightings, FloatArray]:
    """Points (M, 3) some 5 to 15 m ahead of the cameras, seen from image a up to b of each span."""
    first, end = (np.array(column) for column in zip(*spans, strict=True))
    ahead = np.column_stack([rng.uniform(-2, 2, (len(spans), 2)), rng.uniform(5, 15, len(spans))])
    T0 = from_rotation_translation(poses.R[0], poses.p[0]) @ T_IMU_CAM
    points = ahead @ T0[:3, :3].T + T0[:3, 3]
    table = np.zeros((len(spans), len(poses), 2))
    for view in range(len(poses)):
        table[:, view] = project(points, poses, view)
    table += noise * rng.standard_normal(table.shape)
    return flat(table, first, end), points


def flat(table: FloatArray, first: IntArray, end: IntArray) -> Sightings:
    """Each track from its first column up to its own end."""
    parts = [
        Sightings.of_table(table[k : k + 1], first[k : k + 1], int(end[k])) for k in range(len(end))
    ]
    out = parts[0]
    for part in parts[1:]:
        out = out.with_others(part)
    return out


def project(points: FloatArray, poses: Poses, view: int) -> FloatArray:
    q = (points - poses.p[view]) @ poses.R[view]
    c = (q - T_IMU_CAM[:3, 3]) @ T_IMU_CAM[:3, :3]
    return np.asarray(c[:, :2] / c[:, 2:])


def gauge(poses: Poses, velocity: FloatArray | None = None) -> FloatArray:
    """(6 N + 9, 4): how the errors change as the world moves along x, y, z and turns about z.

    Without a velocity the last 9 rows are left away.
    """
    up = np.array([0.0, 0.0, 1.0])
    N = np.zeros((len(poses), 2, 3, 4))
    N[:, 1, :, :3] = np.eye(3)
    N[:, 0, :, 3] = np.swapaxes(poses.R, -1, -2) @ up
    N[:, 1, :, 3] = np.cross(up, poses.p)
    out = N.reshape(-1, 4)
    if velocity is None:
        return np.asarray(out)
    motion = np.zeros((9, 4))
    motion[:3, 3] = np.cross(up, velocity)
    return np.concatenate([out, motion])


def numerical_jacobian(
    function: Callable[[FloatArray], FloatArray], size: int, step: float = 1e-6
) -> FloatArray:
    """Central differences at zero."""
    columns = [(function(step * e) - function(-step * e)) / (2.0 * step) for e in np.eye(size)]
    return np.stack(columns, axis=-1)
