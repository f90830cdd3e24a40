"""Where the refinement of a window begins: a guess or the linear solution, and the points."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.geometry.triangulation import triangulate
from p2gd_fgo.initialization.bundle import WindowStates
from p2gd_fgo.initialization.linear import LinearStart
from p2gd_fgo.initialization.preintegration import Intervals, preintegrate
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.initialization.static import heading_frame
from p2gd_fgo.initialization.visual import Points
from p2gd_fgo.types import BoolArray, FloatArray, NavState

NEAR = 2.0  # 1/m
_FAR = 0.02  # 1/m, for tracks that can't be triangulated


def carried(
    guess: NavState, s: WindowSightings, pieces: Intervals, noise: ImuNoise, gravity: float
) -> WindowStates:
    """The IMU's path through the window from the image next to the guess, both ways."""
    m = preintegrate(pieces, guess.gyro_bias, guess.accel_bias, noise)
    count = len(s.stamps_ns)
    R, v, p = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    at = int(np.argmin(np.abs(s.stamps_ns - guess.stamp_ns)))
    R[at], v[at], p[at] = guess.T_world_imu[:3, :3], guess.velocity, guess.T_world_imu[:3, 3]
    fall = np.array([0.0, 0.0, -gravity])
    for n in range(at, count - 1):
        dt = m.duration_s[n]
        R[n + 1] = R[n] @ m.R[n]
        v[n + 1] = v[n] + fall * dt + R[n] @ m.v[n]
        p[n + 1] = p[n] + v[n] * dt + 0.5 * fall * dt**2 + R[n] @ m.p[n]
    for n in range(at - 1, -1, -1):
        dt = m.duration_s[n]
        R[n] = R[n + 1] @ m.R[n].T
        v[n] = v[n + 1] - fall * dt - R[n] @ m.v[n]
        p[n] = p[n + 1] - v[n] * dt - 0.5 * fall * dt**2 - R[n] @ m.p[n]
    return _pinned(
        WindowStates(R, p, v, np.tile(guess.gyro_bias, (count, 1)),
                     np.tile(guess.accel_bias, (count, 1)))
    )  # fmt: skip


def _pinned(states: WindowStates) -> WindowStates:
    """Moved and turned about the vertical to the frame that is pinned at the newest image."""
    turn = heading_frame(states.R[-1, 2]) @ states.R[-1].T
    R = so3.from_quaternion(so3.to_quaternion(turn @ states.R))
    return WindowStates(
        R, (states.p - states.p[-1]) @ turn.T, states.v @ turn.T,
        states.gyro_bias, states.accel_bias,
    )  # fmt: skip


def in_world(linear: LinearStart, gyro_bias: FloatArray) -> WindowStates:
    """With z up."""
    R = heading_frame(-linear.gravity / np.linalg.norm(linear.gravity))
    count = len(linear.R)
    return _pinned(
        WindowStates(
            R @ linear.R, linear.p @ R.T, linear.v @ R.T,
            np.tile(gyro_bias, (count, 1)), np.tile(linear.accel_bias, (count, 1)),
        )
    )  # fmt: skip


def first_points(s: WindowSightings, states: WindowStates, T_imu_cam: FloatArray) -> Points:
    """Triangulated, each in the frame of the first camera that saw it."""
    T = from_rotation_translation(states.R, states.p) @ T_imu_cam
    seen = np.full((s.tracks, len(T), 2), np.nan)
    seen[s.track, s.image] = s.normalized
    triangulated = triangulate(seen, T)
    first = s.image[s.starts]
    R, center = T[first, :3, :3], T[first, :3, 3]
    local = (np.swapaxes(R, -1, -2) @ (triangulated.points - center)[..., None])[..., 0]
    abr = np.column_stack([s.normalized[s.starts], np.full(s.tracks, _FAR)])
    good: BoolArray = np.isfinite(local).all(axis=1) & (triangulated.depth > 1.0 / NEAR)
    abr[good, 2] = 1.0 / local[good, 2]
    return Points(R, center, abr)
