"""The gyro's bias from the images alone, before anything is known of translation.

Between two images the normals n = f × R f' of the epipolar planes all lie across the translation,
so the least eigenvalue of Σ n nᵀ is zero at the true rotation (Kneip and Lynen, ICCV 2013). The
bias is what makes the gyro's rotations do so for all pairs of images.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.preintegration import Intervals, preintegrate
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.types import FloatArray

_STEPS = (1, 3)  # images between the two of a pair
_LEAST_SHARED = 15  # tracks of a pair
_ROUNDS = 3


_Pair = tuple[int, int, FloatArray, FloatArray]
_PlanesOf = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def align_gyro(
    sightings: WindowSightings,
    pieces: Intervals,
    R_imu_cam: FloatArray,
    noise: ImuNoise,
    sigma_bias: float,
    sigma_ray: float,
) -> FloatArray | None:
    """Gyro bias (3,), rad/s; None where no two images share enough tracks.

    Parameters
    ----------
    sigma_bias
        rad/s, of the bias before anything was seen.
    sigma_ray
        rad, of a sighting.
    """
    pairs = [
        pair
        for step in _STEPS
        for i in range(len(sightings.stamps_ns) - 1 - step)
        if (pair := _shared(sightings, i, i + step)) is not None
    ]
    if not pairs:
        return None
    counts = np.array([len(f) for _, _, f, _ in pairs])
    bias = np.zeros(3)
    weights = [np.ones(len(f)) for _, _, f, _ in pairs]
    for _ in range(_ROUNDS):
        motion = preintegrate(pieces, bias, np.zeros(3), noise)
        chained = [_turn(motion.R, motion.by_bias[:, :3, :3], i, j) for i, j, _, _ in pairs]
        turns, by_bias = np.array([R for R, _ in chained]), np.array([J for _, J in chained])

        planes = partial(_planes, pairs, weights, turns, by_bias, R_imu_cam)

        def cost(
            delta: FloatArray, planes: _PlanesOf = planes, bias: FloatArray = bias
        ) -> FloatArray:
            least = np.maximum(np.linalg.eigvalsh(planes(delta)[0])[:, 0], 0.0)
            seen = np.sqrt(counts * least) / sigma_ray
            return np.concatenate([seen, (bias + delta) / sigma_bias])

        solution = least_squares(cost, np.zeros(3), loss="soft_l1", f_scale=30.0, x_scale=1e-3)
        white, L = planes(solution.x)
        along = np.linalg.eigh(white)[1][:, :, :1]
        along = np.linalg.solve(np.swapaxes(L, -1, -2), along)[..., 0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        for n, pair in enumerate(pairs):
            slant = np.linalg.norm(np.cross(along[n], pair[2]), axis=1)
            weights[n] = 1.0 / np.maximum(slant, 0.05)
        bias = bias + solution.x
    return np.asarray(bias)


def _planes(
    pairs: list[_Pair],
    weights: list[FloatArray],
    turns: FloatArray,
    by_bias: FloatArray,
    R_imu_cam: FloatArray,
    delta: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Scatter (P, 3, 3) of each pair's normals, whitened by its noise's L Lᵀ, and L."""
    R = R_imu_cam.T @ turns @ so3.exp(by_bias @ delta) @ R_imu_cam
    M, N = np.empty((2, len(pairs), 3, 3))
    for n, ((_, _, f, g), w) in enumerate(zip(pairs, weights, strict=True)):
        turned = g @ R[n].T
        normal = np.cross(f, turned) * w[:, None]
        M[n] = normal.T @ normal
        f, turned = f * w[:, None], turned * w[:, None]
        N[n] = 2.0 * np.sum(w * w) * np.eye(3) - f.T @ f - turned.T @ turned
    L = np.asarray(np.linalg.cholesky(N), dtype=np.float64)
    half = np.linalg.solve(L, M)
    return np.asarray(np.linalg.solve(L, np.swapaxes(half, -1, -2))), L


def _shared(s: WindowSightings, i: int, j: int) -> tuple[int, int, FloatArray, FloatArray] | None:
    """Unit rays of the tracks that images i and j share."""
    in_i, in_j = np.flatnonzero(s.image == i), np.flatnonzero(s.image == j)
    _, a, b = np.intersect1d(s.track[in_i], s.track[in_j], return_indices=True)
    if len(a) < _LEAST_SHARED:
        return None
    return i, j, _rays(s.normalized[in_i[a]]), _rays(s.normalized[in_j[b]])


def _rays(normalized: FloatArray) -> FloatArray:
    rays = np.concatenate([normalized, np.ones((len(normalized), 1))], axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _turn(R: FloatArray, J: FloatArray, i: int, j: int) -> tuple[FloatArray, FloatArray]:
    """Rotation from image j to image i, and its derivative by the bias (a turn on its right)."""
    turn, by_bias = np.eye(3), np.zeros((3, 3))
    for k in range(i, j):
        by_bias = R[k].T @ by_bias + J[k]
        turn = turn @ R[k]
    return turn, by_bias
