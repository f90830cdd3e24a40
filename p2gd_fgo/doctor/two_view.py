"""Rotation between two images from tracked points alone, without the gyro."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from p2gd_fgo.geometry import so3
from p2gd_fgo.types import BoolArray, FloatArray

MIN_POINTS = 20
"""Fewer points, or fewer that agree, give no rotation."""

_CONFIDENCE = 0.999
_MAX_TRIALS = 300
_STEPS = 8
_RANSAC_PX = 1.5
_SCALE_PX = 0.3  # of KLT on real images; the weight of a residual halves here
_TINY = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class TwoView:
    """Motion of the camera between two images.

    Attributes
    ----------
    phi
        (3,) rotation vector, rad: R_first_second = Exp(phi); the integral of the camera's rate.
    direction
        (3,) unit vector of the second camera's centre in the second camera's axes, sign unknown.
    inliers
        (N,) which points agree.
    """

    phi: FloatArray
    direction: FloatArray
    inliers: BoolArray


def two_view_motion(first: FloatArray, second: FloatArray, focal_px: float) -> TwoView | None:
    """Essential matrix by RANSAC (Nistér's five points), then least squares on what agrees.

    Of the two rotations of an essential matrix the smaller one is taken: the images are
    neighbours. None where too few points agree.

    Parameters
    ----------
    first, second
        (N, 2) undistorted points on the plane z = 1.
    focal_px
        Scale from that plane to pixels.
    """
    if len(first) < MIN_POINTS:
        return None
    E, mask = cv2.findEssentialMat(
        first, second, np.eye(3), method=cv2.RANSAC, prob=_CONFIDENCE,
        threshold=_RANSAC_PX / focal_px, maxIters=_MAX_TRIALS,
    )  # fmt: skip
    if np.shape(E) != (3, 3) or mask.sum() < MIN_POINTS:  # None or several where degenerate
        return None
    R1, R2, t = cv2.decomposeEssentialMat(E)
    R = np.asarray(R1 if np.trace(R1) > np.trace(R2) else R2, dtype=np.float64)
    inliers = np.asarray(mask[:, 0] == 1)
    scale = _SCALE_PX / focal_px
    R, direction = refine(first[inliers], second[inliers], R, t.astype(np.float64)[:, 0], scale)
    return TwoView(-so3.log(R), direction, inliers)


def refine(
    first: FloatArray, second: FloatArray, R: FloatArray, t: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton on Sampson distances, reweighted after Cauchy.

    Parameters
    ----------
    first, second
        (N, 2) points on z = 1.
    R, t
        (3, 3) takes the first camera's vectors to the second's, (3,) unit vector;
        x₂ · t × R x₁ = 0.
    scale
        Residual, on z = 1, at which a point counts half.
    """
    for _ in range(_STEPS):
        r, J = sampson(first, second, R, t)
        w = 1.0 / (1.0 + (r / scale) ** 2)
        H = (J * w[:, None]).T @ J
        H[np.diag_indices(5)] += 1e-9 * np.trace(H) + _TINY
        step = np.asarray(-np.linalg.solve(H, (J * w[:, None]).T @ r), dtype=np.float64)
        R = so3.exp(step[:3]) @ R
        t = t + tangent(t) @ step[3:]
        t = t / np.linalg.norm(t)
        if np.linalg.norm(step[:3]) < 1e-7:
            break
    return R, t


def tangent(t: FloatArray) -> FloatArray:
    """Two directions (3, 2) across a unit vector (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(t)))]
    a = np.cross(t, helper)
    a /= np.linalg.norm(a)
    return np.stack([a, np.cross(t, a)], axis=1)


def sampson(
    first: FloatArray, second: FloatArray, R: FloatArray, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signed Sampson distances (N,) on z = 1, and their Jacobian (N, 5).

    By a rotation vector δ, R ← Exp(δ) R, and by :func:`tangent`; the denominator counts as fixed.
    """
    ones = np.ones((len(first), 1))
    x1, x2 = np.hstack([first, ones]), np.hstack([second, ones])
    y = x1 @ R.T
    line2 = np.cross(t, y)  # E x1
    c = np.cross(x2, t)  # e = y · c
    line1 = c @ R  # Eᵀ x2 up to sign
    e = np.einsum("ni,ni->n", y, c)
    norm = np.sqrt(
        line1[:, 0] ** 2 + line1[:, 1] ** 2 + line2[:, 0] ** 2 + line2[:, 1] ** 2 + _TINY
    )
    by_rotation = np.cross(y, c)
    by_direction = np.cross(y, x2) @ tangent(t)
    return e / norm, np.hstack([by_rotation, by_direction]) / norm[:, None]
