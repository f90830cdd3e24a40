"""Which tracks agree with one motion of the camera.

With the rotation known from the gyro, two points give the direction of the translation t, because
the epipolar constraint t · (R x₁ × x₂) = 0 is linear in it: few hypotheses are needed, points that
don't move (standing still, pure rotation) fit any t, and the sign of t tells points that move the
wrong way along their epipolar line. Without a rotation a fundamental matrix has to do.

Constraints hold on the plane z = 1, distances are counted in pixels of the image, to first order in
them: far from the axis of a wide lens a pixel covers several times as much of that plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import BoolArray, FloatArray, IntArray

MIN_POINTS = 8
"""Fewer points are not judged."""

_HYPOTHESES = 64  # finds a pair of inliers with 99.7 % at an inlier share of 30 %
_SUPPORT = 3  # moving points that must agree: any two do
_REFINEMENTS = 2
_DOUBTFUL_SHARE = 0.5  # so few inliers may mean a wrong rotation
_FUNDAMENTAL_CONFIDENCE = 0.995
_TINY = 1e-12
_SINGULAR = 1e-9  # of what a pixel covers on the axis


def motion_inliers(
    previous: FloatArray,
    current: FloatArray,
    R_cam_prev: FloatArray | None,
    camera: Camera,
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
    camera
        That took both.
    threshold_px
        Largest distance from the epipolar line.
    rng
        Draws the order of the points and the hypotheses.
    """
    if len(previous) < MIN_POINTS:
        return np.ones(len(previous), np.bool_)
    order = rng.permutation(len(previous))
    a, b = previous[order], current[order]
    focal_px = float(np.sqrt(camera.fx * camera.fy))
    if R_cam_prev is None:
        good = fundamental_inliers(a, b, focal_px, threshold_px)
    else:
        J = camera.distort_jacobian(b)
        # Where the lens turns back: beyond, a pixel tells no direction.
        singular = np.linalg.det(J) < _SINGULAR * focal_px**2
        J[singular] = np.eye(2)
        good = two_point_inliers(a, b, R_cam_prev, J, threshold_px, rng) & ~singular
        if good.mean() < _DOUBTFUL_SHARE:
            other = fundamental_inliers(a, b, focal_px, threshold_px) & ~singular
            good = other if other.sum() > good.sum() else good
    out = np.empty_like(good)
    out[order] = good
    return out


def fundamental_inliers(
    previous: FloatArray, current: FloatArray, focal_px: float, threshold_px: float
) -> BoolArray:
    """Inliers (N,) of a fundamental matrix, and every point that hardly moved.

    Its distances are those of an image without distortion, of this focal length.
    """
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
    J: FloatArray,
    threshold_px: float,
    rng: np.random.Generator,
) -> BoolArray:
    """Inliers (N,) of the best translation, the rotation being known.

    J (N, 2, 2) is d pixel / d point on the plane z = 1 at the current points.
    """
    ones = np.ones(len(previous))
    ray = np.column_stack([previous, ones]) @ R_cam_prev.T
    depth = np.where(np.abs(ray[:, 2]) < _TINY, _TINY, ray[:, 2])
    a = ray / depth[:, None]
    b = np.column_stack([current, ones])
    step_px = np.einsum("nij,nj->ni", J, (b - a)[:, :2])
    still = np.asarray(np.linalg.norm(step_px, axis=1) < threshold_px)
    moving = np.flatnonzero(~still)
    if len(moving) < _SUPPORT:
        return still
    lines = _Lines(a, np.cross(a, b), np.asarray(np.linalg.inv(J)))
    t = _best_hypothesis(lines, moving, threshold_px, rng)
    for _ in range(_REFINEMENTS):
        t = _least_squares(lines, t, threshold_px)
    fits = (lines.distances_px(t[None])[0] < threshold_px) & _moves_forward(
        a, t, J, step_px, threshold_px
    )
    if fits[moving].sum() < _SUPPORT:
        return still
    return np.asarray(still | fits)


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Epipolar lines t x a of N points.

    Attributes
    ----------
    a
        (N, 3) previous points turned into the current frame, z = 1.
    normals
        (N, 3) a x b, b being the current points: t · normals vanishes on the line.
    J_inverse
        (N, 2, 2) d point / d pixel at b.
    """

    a: FloatArray
    normals: FloatArray
    J_inverse: FloatArray

    def distances_px(self, t: FloatArray) -> FloatArray:
        """Distances (H, N) of the current points to the lines of translations t (H, 3)."""
        return np.asarray(np.abs(t @ self.normals.T) / self.scale(t))

    def scale(self, t: FloatArray) -> FloatArray:
        """How t · normals changes (H, N) with a pixel across the line."""
        x = t[:, 1:2] - t[:, 2:3] * self.a[:, 1]
        y = t[:, 2:3] * self.a[:, 0] - t[:, 0:1]
        across = [x * self.J_inverse[:, 0, i] + y * self.J_inverse[:, 1, i] for i in (0, 1)]
        return np.asarray(np.maximum(np.hypot(*across), _TINY))


def _best_hypothesis(
    lines: _Lines, moving: IntArray, threshold_px: float, rng: np.random.Generator
) -> FloatArray:
    """Direction of translation (3,) with the smallest truncated squared distance."""
    first = rng.integers(0, len(moving), _HYPOTHESES)
    second = (first + rng.integers(1, len(moving), _HYPOTHESES)) % len(moving)
    t = np.cross(lines.normals[moving[first]], lines.normals[moving[second]])
    t /= np.maximum(np.linalg.norm(t, axis=1), _TINY)[:, None]
    squares = np.minimum(lines.distances_px(t) ** 2, threshold_px**2)
    return np.asarray(t[np.argmin(squares.sum(axis=1))])


def _least_squares(lines: _Lines, t: FloatArray, threshold_px: float) -> FloatArray:
    """Fit the translation (3,) to the inliers of t."""
    scale = lines.scale(t[None])[0]
    inlier = np.abs(lines.normals @ t) < threshold_px * scale
    weighted = lines.normals[inlier] / scale[inlier, None]
    _, vectors = np.linalg.eigh(weighted.T @ weighted)
    return np.asarray(vectors[:, 0])


def _moves_forward(
    a: FloatArray, t: FloatArray, J: FloatArray, step_px: FloatArray, threshold_px: float
) -> BoolArray:
    """Whether points (N,) move along the line the way that most do (positive depth)."""
    direction = np.einsum("nij,nj->ni", J, t[:2] - t[2] * a[:, :2])
    direction /= np.maximum(np.linalg.norm(direction, axis=1), _TINY)[:, None]
    along = np.einsum("ni,ni->n", step_px, direction)
    sign = 1.0 if np.clip(along, -threshold_px, threshold_px).sum() >= 0.0 else -1.0
    return np.asarray(sign * along > -threshold_px)
