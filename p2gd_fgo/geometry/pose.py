"""Rigid transforms as 4x4 matrices, batched over leading axes."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.geometry import so3
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray, IntArray, Trajectory

MAX_TRUTH_GAP_S = 0.5
"""Nothing is said about the time between two poses of the truth farther apart than this."""


def from_rotation_translation(R: FloatArray, p: FloatArray) -> FloatArray:
    """T (..., 4, 4) of a rotation (..., 3, 3) and a translation (..., 3)."""
    R, p = np.asarray(R, dtype=np.float64), np.asarray(p, dtype=np.float64)
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], p.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def inverse(T: FloatArray) -> FloatArray:
    """T_b_a of T_a_b (..., 4, 4)."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    return from_rotation_translation(Rt, -(Rt @ T[..., :3, 3:])[..., 0])


def transform(T_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Points in a: T_a_b (..., 4, 4) applied to points_b (..., N, 3)."""
    Rt = np.swapaxes(T_a_b[..., :3, :3], -1, -2)
    return np.asarray(points_b @ Rt + T_a_b[..., None, :3, 3])


def interpolation_weights(
    stamps_ns: IntArray, query_ns: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Neighbours and weight for linear interpolation: value = (1 − w) v[i] + w v[j].

    ``stamps_ns`` (N,) strictly increasing; queries outside its range take the nearest end.
    """
    stamps_ns = np.asarray(stamps_ns, dtype=np.int64)
    clipped = np.clip(np.asarray(query_ns, dtype=np.int64), stamps_ns[0], stamps_ns[-1])
    j = np.clip(np.searchsorted(stamps_ns, clipped), 1, max(len(stamps_ns) - 1, 1))
    if len(stamps_ns) == 1:
        j = np.zeros_like(j)
    i = np.maximum(j - 1, 0)
    span = np.maximum(stamps_ns[j] - stamps_ns[i], 1)
    return i, j, (clipped - stamps_ns[i]) / span


def covered(trajectory: Trajectory, query_ns: IntArray) -> BoolArray:
    """Whether times (M,) lie inside the trajectory and in no hole of it longer than 0.5 s."""
    known = trajectory.stamps_ns
    if not len(known):
        return np.zeros(len(query_ns), np.bool_)
    i, j, w = interpolation_weights(known, query_ns)
    near = (known[j] - known[i] <= MAX_TRUTH_GAP_S * NANOSECONDS) | (w == 0.0) | (w == 1.0)
    return np.asarray(near & (query_ns >= known[0]) & (query_ns <= known[-1]))


def interpolate(trajectory: Trajectory, query_ns: IntArray) -> FloatArray:
    """Poses (M, 4, 4) at query_ns (M,): positions linearly, rotations along the geodesic.

    Queries outside the trajectory take the nearest end: the caller decides what is covered.
    """
    i, j, w = interpolation_weights(trajectory.stamps_ns, query_ns)
    R, p = trajectory.T_world_imu[:, :3, :3], trajectory.T_world_imu[:, :3, 3]
    step = so3.log(np.swapaxes(R[i], -1, -2) @ R[j])
    return from_rotation_translation(
        R[i] @ so3.exp(w[:, None] * step), p[i] + w[:, None] * (p[j] - p[i])
    )
