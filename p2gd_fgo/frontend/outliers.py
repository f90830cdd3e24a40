"""Which tracks agree with one motion of the camera.

With the rotation known from the gyro, two points give the direction of the translation t, because
the epipolar constraint t · (R x₁ × x₂) = 0 is linear in it: few hypotheses are needed, points that
don't move (standing still, pure rotation) fit any t, and the sign of t tells points that move the
wrong way along their epipolar line. Without a rotation a fundamental matrix has to do.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p2gd_fgo.types import BoolArray, FloatArray, IntArray

MIN_POINTS = 8
"""Fewer points are not judged."""

_HYPOTHESES = 64  # finds a pair of inliers with 99.7 % at an inlier share of 30 %
_SUPPORT = 3  # moving points that must agree: any two do
_REFINEMENTS = 2
_DOUBTFUL_SHARE = 0.5  # so few inliers may mean a wrong rotation
_FUNDAMENTAL_CONFIDENCE = 0.995
_TINY = 1e-12


def motion_inliers(
    previous: FloatArray,
    current: FloatArray,
    R_cam_prev: FloatArray | None,
    focal_px: float,
    threshold_px: float,
    rng: np.random.Generator,
) -> BoolArray:
    """Which points (N,) fit one rigid motion of the camera.

    Parameters
    ----------
    previous, current
        (N, 2) undistorted points on the plane z = 1 of two images.
    R_cam_prev
        (3, 3) takes vectors of the previous camera frame to the current one; None if unknown.
    focal_px
        Scale from the plane to pixels.
    threshold_px
        Largest distance from the epipolar line.
    rng
        Draws the order of the points and the hypotheses.
    """
    if len(previous) < MIN_POINTS:
        return np.ones(len(previous), np.bool_)
    order = rng.permutation(len(previous))
    a, b = previous[order], current[order]
    if R_cam_prev is None:
        good = fundamental_inliers(a, b, focal_px, threshold_px)
    else:
        good = two_point_inliers(a, b, R_cam_prev, threshold_px / focal_px, rng)
        if good.mean() < _DOUBTFUL_SHARE:
            other = fundamental_inliers(a, b, focal_px, threshold_px)
            good = other if other.sum() > good.sum() else good
    out = np.empty_like(good)
    out[order] = good
    return out


def fundamental_inliers(
    previous: FloatArray, current: FloatArray, focal_px: float, threshold_px: float
) -> BoolArray:
    """Inliers (N,) of a fundamental matrix, and every point that hardly moved."""
    still = np.linalg.norm(current - previous, axis=1) * focal_px < threshold_px
    mask: NDArray[Any] | None = cv2.findFundamentalMat(
        previous * focal_px,
        current * focal_px,
        cv2.FM_RANSAC,
        threshold_px,
        _FUNDAMENTAL_CONFIDENCE,
    )[1]
    if mask is None:  # no model at all: nothing can be said against any point
        return np.ones(len(previous), np.bool_)
    return np.asarray(still | (mask[:, 0] == 1))


def two_point_inliers(
    previous: FloatArray,
    current: FloatArray,
    R_cam_prev: FloatArray,
    threshold: float,
    rng: np.random.Generator,
) -> BoolArray:
    """Inliers (N,) of the best translation, the rotation being known; threshold on z = 1."""
    ones = np.ones(len(previous))
    ray = np.column_stack([previous, ones]) @ R_cam_prev.T
    depth = np.where(np.abs(ray[:, 2]) < _TINY, _TINY, ray[:, 2])
    a = ray / depth[:, None]
    b = np.column_stack([current, ones])
    still = np.asarray(np.linalg.norm(a - b, axis=1) < threshold)
    moving = np.flatnonzero(~still)
    if len(moving) < _SUPPORT:
        return still
    normals = np.cross(a, b)
    t = _best_hypothesis(a, normals, moving, threshold, rng)
    for _ in range(_REFINEMENTS):
        t = _least_squares(a, normals, t, threshold)
    fits = (_epipolar_distances(a, normals, t[None])[0] < threshold) & _moves_forward(
        a, b, t, threshold
    )
    if fits[moving].sum() < _SUPPORT:
        return still
    return np.asarray(still | fits)


def _best_hypothesis(
    a: FloatArray,
    normals: FloatArray,
    moving: IntArray,
    threshold: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Direction of translation (3,) with the smallest truncated squared distance."""
    first = rng.integers(0, len(moving), _HYPOTHESES)
    second = (first + rng.integers(1, len(moving), _HYPOTHESES)) % len(moving)
    t = np.cross(normals[moving[first]], normals[moving[second]])
    t /= np.maximum(np.linalg.norm(t, axis=1), _TINY)[:, None]
    squares = np.minimum(_epipolar_distances(a, normals, t) ** 2, threshold**2)
    return np.asarray(t[np.argmin(squares.sum(axis=1))])


def _epipolar_distances(a: FloatArray, normals: FloatArray, t: FloatArray) -> FloatArray:
    """Distances (H, N) of the current points to the epipolar lines t x a, t (H, 3)."""
    return np.asarray(np.abs(t @ normals.T) / _line_scale(a, t))


def _line_scale(a: FloatArray, t: FloatArray) -> FloatArray:
    """Norm (H, N) of the first two entries of t x a, a having z = 1."""
    x = t[:, 1:2] - t[:, 2:3] * a[:, 1]
    y = t[:, 2:3] * a[:, 0] - t[:, 0:1]
    return np.asarray(np.maximum(np.sqrt(x * x + y * y), _TINY))


def _least_squares(
    a: FloatArray, normals: FloatArray, t: FloatArray, threshold: float
) -> FloatArray:
    """Fit the translation (3,) to the inliers of t."""
    scale = _line_scale(a, t[None])[0]
    inlier = np.abs(normals @ t) < threshold * scale
    weighted = normals[inlier] / scale[inlier, None]
    _, vectors = np.linalg.eigh(weighted.T @ weighted)
    return np.asarray(vectors[:, 0])


def _moves_forward(a: FloatArray, b: FloatArray, t: FloatArray, threshold: float) -> BoolArray:
    """Whether points (N,) move along the line the way that most do (positive depth)."""
    direction = t[:2] - t[2] * a[:, :2]
    direction /= np.maximum(np.linalg.norm(direction, axis=1), _TINY)[:, None]
    along = np.einsum("ni,ni->n", (b - a)[:, :2], direction)
    sign = 1.0 if np.clip(along, -threshold, threshold).sum() >= 0.0 else -1.0
    return np.asarray(sign * along > -threshold)
