"""Drive a route that was recorded: a smooth trajectory through the poses of a truth file."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.simulation.driving import Drive
from p2gd_fgo.simulation.scenario import RouteScenario
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.trajectory_files import read_trajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, Trajectory

_KNOT_S = 0.05
_MARGIN_S = 0.5
_HILL_S = 4.0  # 1 sigma; slower changes of height and slope are the terrain's
_MAX_GAP_S = 2.0
_FASTEST = 60.0  # m/s


def drive_recorded(route: RouteScenario, duration_s: float, start_ns: int) -> Drive:
    """Smooth the recorded poses and resample them on knots of 50 ms.

    The first position becomes the origin. Where ``route.level`` is set, slow changes of height,
    roll and pitch are taken out, and the faster ones kept as the suspension's.

    Raises
    ------
    DataError
        The file can't be read, holds NaN, is too short, has holes or jumps, or is not the one
        that the scenario was made with.
    """
    path = Path(str(route.file))
    recorded = read_trajectory(path)
    if route.sha256 is not None and file_hash(path) != route.sha256:
        raise DataError(f"{path}: not the file that route.sha256 names: put that one back")
    t = (recorded.stamps_ns - recorded.stamps_ns[0]) / NANOSECONDS
    _check(path, recorded, t, route, duration_s)
    first = recorded.stamps_ns[0] + round(route.start_s * NANOSECONDS)
    offsets = np.round(
        np.arange(-_MARGIN_S, duration_s + _MARGIN_S + 0.5 * _KNOT_S, _KNOT_S) * NANOSECONDS
    ).astype(np.int64)
    reach = np.arange(1, 2 + int(6.0 * max(_HILL_S, route.smooth_s) / _KNOT_S))
    step = round(_KNOT_S * NANOSECONDS)
    wide = np.concatenate([offsets[0] - reach[::-1] * step, offsets, offsets[-1] + reach * step])
    inside = np.clip(first + wide, recorded.stamps_ns[0], recorded.stamps_ns[-1])
    T = interpolate(recorded, inside)
    inner = slice(len(reach), -len(reach))
    sigma = route.smooth_s / _KNOT_S
    position = gaussian_filter1d(T[:, :3, 3], sigma, axis=0, mode="nearest")
    position = position - position[inner][round(_MARGIN_S / _KNOT_S)]
    rotation = Rotation.from_matrix(_smooth_rotations(T[:, :3, :3], sigma))
    if route.level:
        position[:, 2] -= _slow(position[:, 2])
        yaw, pitch, roll = np.unwrap(rotation.as_euler("ZYX"), axis=0).T
        level = np.stack([yaw, pitch - _slow(pitch), roll - _slow(roll)], -1)
        rotation = Rotation.from_euler("ZYX", level)
    position, matrices = position[inner], np.asarray(rotation.as_matrix())[inner]
    way = position[:, :2]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    trajectory = SplineTrajectory(start_ns + offsets, position, matrices)
    moving = np.concatenate([[True], np.diff(arc) > 1e-4])
    return Drive(trajectory, offsets / NANOSECONDS, arc, way[moving])


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes, 64 hex digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _check(
    path: Path, recorded: Trajectory, t: FloatArray, route: RouteScenario, duration_s: float
) -> None:
    if len(t) < 2 or t[-1] < route.start_s + duration_s:
        raise DataError(
            f"{path}: the route lasts {t[-1]:.1f} s, but route.start_s and duration_s ask for "
            f"{route.start_s + duration_s:.1f} s: shorten the drive"
        )
    gaps = np.diff(t)
    k = int(np.argmax(gaps))
    if gaps[k] > _MAX_GAP_S:
        raise DataError(
            f"{path}: a hole of {gaps[k]:.1f} s after {t[k]:.1f} s: give a route without holes "
            f"longer than {_MAX_GAP_S:g} s"
        )
    speed = np.linalg.norm(np.diff(recorded.T_world_imu[:, :3, 3], axis=0), axis=1) / gaps
    smooth = gaussian_filter1d(speed, max(0.5 / np.median(gaps), 0.5), mode="nearest")
    k = int(np.argmax(smooth))
    if smooth[k] > _FASTEST:
        raise DataError(
            f"{path}: the route jumps at {t[k]:.1f} s ({smooth[k]:.0f} m/s): positions must be in m"
        )


def _slow(values: FloatArray) -> FloatArray:
    return np.asarray(gaussian_filter1d(values, _HILL_S / _KNOT_S, mode="nearest"))


def _smooth_rotations(R: FloatArray, sigma: float) -> FloatArray:
    """Gaussian mean of rotations (N, 3, 3), projected back onto SO(3)."""
    mean = gaussian_filter1d(R, sigma, axis=0, mode="nearest")
    u, _, vt = np.linalg.svd(mean)
    u[:, :, -1] *= np.linalg.det(u @ vt)[:, None]
    return np.asarray(u @ vt)
