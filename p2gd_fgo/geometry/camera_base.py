"""What all cameras share: a pinhole, a lens in front of it, and the part of it that is usable.

A point (x, y) on the plane z = 1 ("normalised") is moved by the lens to (x', y') on the same plane
and lands on the pixel (fx x' + cx, fy y' + cy); pixel centres are at whole numbers. The lens
models are polynomials, and a polynomial turns back somewhere: beyond that angle two directions
share a pixel. Each model knows that limit, or 89° where it never turns back, and calls only what
is nearer to the axis visible or invertible.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import BoolArray, FloatArray

MIN_DEPTH = 0.05
"""Nearest depth, in m, that :meth:`Camera.visible` accepts."""

MAX_ANGLE = math.radians(89.0)
"""Directions farther from the axis have no usable point on the plane z = 1."""

_KNOTS = 2048
_INVERTIBLE_PX = 1e-6


@dataclass(frozen=True)
class Camera(ABC):
    """A calibrated camera.

    Attributes
    ----------
    width, height
        Size of the image, px.
    fx, fy, cx, cy
        Focal lengths and principal point, px.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            positive = field.name in ("width", "height", "fx", "fy")
            if not math.isfinite(value) or (positive and value <= 0):
                need = "a positive number" if positive else "finite"
                raise DataError(f"the camera's {field.name} is {value}, but must be {need}")

    @abstractmethod
    def _bend(self, plane: FloatArray) -> FloatArray:
        """Take normalised points (2, N) through the lens to distorted points (2, N)."""

    @abstractmethod
    def _unbend(self, plane: FloatArray) -> FloatArray:
        """Invert the lens on (2, N); the point at ``max_radius`` where there is no inverse."""

    @abstractmethod
    def _bend_jacobian(self, plane: FloatArray) -> FloatArray:
        """Compute the derivative (N, 2, 2) of the lens at normalised points (2, N)."""

    @abstractmethod
    def _radial(self, angle: FloatArray) -> FloatArray:
        """Compute the distorted radius (N,) of directions at an angle (N,), rad, to the axis."""

    @abstractmethod
    def _turning_angle(self) -> float:
        """Find the angle, rad, where the distorted radius stops growing; inf if it never does."""

    @property
    def K(self) -> FloatArray:
        """(3, 3) pinhole matrix, for points that are already undistorted."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @cached_property
    def max_angle(self) -> float:
        """Largest usable angle to the axis, rad, at most 89°."""
        return min(self._turning_angle(), MAX_ANGLE)

    @cached_property
    def max_radius(self) -> float:
        """Largest usable radius on the plane z = 1."""
        return math.tan(self.max_angle)

    def distort(self, normalized: FloatArray) -> FloatArray:
        """Pixels (N, 2) of normalised points (N, 2).

        Defined everywhere; beyond :attr:`max_radius` the pixel belongs to another direction too.
        """
        return self._to_pixels(self._bend(np.ascontiguousarray(np.transpose(normalized))))

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Normalised points (N, 2) of pixels (N, 2), to 1e-9 or better.

        Always finite. A pixel that no usable direction maps to (outside the image of a strong
        lens; in the corners of a fisheye whose field of view exceeds 180°) gets the point at
        :attr:`max_radius` in its direction: ask :meth:`invertible` where that can happen.
        """
        return np.ascontiguousarray(self._unbend(self._to_plane(pixels)).T)

    def invertible(self, pixels: FloatArray) -> BoolArray:
        """Whether :meth:`undistort` has a true answer (N,) for the pixels (N, 2)."""
        error = np.abs(self.distort(self.undistort(pixels)) - pixels)
        return np.asarray(error.max(axis=1, initial=0.0) < _INVERTIBLE_PX)

    def project(self, points_cam: FloatArray) -> FloatArray:
        """Pixels (N, 2) of points (N, 3) in the camera frame.

        The caller guarantees z > 0; :meth:`visible` tells which pixels to believe.
        """
        return self.distort(points_cam[:, :2] / points_cam[:, 2:])

    def distort_jacobian(self, normalized: FloatArray) -> FloatArray:
        """Compute d pixel / d normalised, (N, 2, 2), at normalised points (N, 2)."""
        J = self._bend_jacobian(np.ascontiguousarray(np.transpose(normalized)))
        J[:, 0] *= self.fx
        J[:, 1] *= self.fy
        return J

    def project_jacobian(self, points_cam: FloatArray) -> FloatArray:
        """Compute d pixel / d point, (N, 2, 3), at points (N, 3) in the camera frame.

        The caller guarantees z > 0.
        """
        inverse_depth = 1.0 / points_cam[:, 2]
        normalized = points_cam[:, :2] * inverse_depth[:, None]
        by_point = self.distort_jacobian(normalized) * inverse_depth[:, None, None]
        out = np.empty((len(points_cam), 2, 3))
        out[:, :, :2] = by_point
        out[:, :, 2] = -(by_point @ normalized[:, :, None])[:, :, 0]
        return out

    def inside(self, pixels: FloatArray, border: float = 0.0) -> BoolArray:
        """Whether pixels (N, 2) lie between the outermost pixel centres, ``border`` px inwards."""
        u, v = pixels[:, 0], pixels[:, 1]
        return np.asarray(
            (u >= border)
            & (u <= self.width - 1 - border)
            & (v >= border)
            & (v <= self.height - 1 - border)
        )

    def visible(self, points_cam: FloatArray, pixels: FloatArray | None = None) -> BoolArray:
        """Whether points (N, 3) in the camera frame are truly seen, (N,).

        That is: z > 0.05 m (paper, III-B2), an angle to the axis that the lens model covers, a
        pixel inside the image. ``pixels`` (N, 2) are those of the points, for a caller who has
        them already; what they hold for points that aren't in front doesn't matter.
        """
        in_front = points_cam[:, 2] > MIN_DEPTH
        plane = points_cam[:, :2] / np.where(in_front, points_cam[:, 2], 1.0)[:, None]
        covered = in_front & (np.hypot(plane[:, 0], plane[:, 1]) < self.max_radius)
        if pixels is None:
            pixels = self.distort(np.where(covered[:, None], plane, 0.0))
        return covered & self.inside(pixels)

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Distorted radius (K,) and its angle to the axis (K,), both increasing from 0."""
        angle = np.linspace(0.0, self.max_angle, _KNOTS)
        return self._radial(angle), angle

    def _to_pixels(self, plane: FloatArray) -> FloatArray:
        out = np.empty((plane.shape[1], 2))
        np.multiply(plane[0], self.fx, out=out[:, 0])
        np.multiply(plane[1], self.fy, out=out[:, 1])
        out += self._centre
        return out

    def _to_plane(self, pixels: FloatArray) -> FloatArray:
        plane = np.ascontiguousarray((np.asarray(pixels) - self._centre).T, dtype=np.float64)
        plane /= self._focal
        return plane

    @cached_property
    def _centre(self) -> FloatArray:
        return np.array([self.cx, self.cy])

    @cached_property
    def _focal(self) -> FloatArray:
        return np.array([[self.fx], [self.fy]])


def smallest_positive_root(tail: list[float]) -> float:
    """Smallest x > 0 with 1 + tail[0] x + tail[1] x² + ... = 0; infinite if there is none."""
    # Solved for 1 / x: that polynomial is monic, so vanishing coefficients do no harm.
    inverse_roots = np.polynomial.polynomial.polyroots([*reversed(tail), 1.0])
    real = inverse_roots[np.abs(inverse_roots.imag) < 1e-9].real
    largest = float(max(real, default=0.0))
    return 1.0 / largest if largest > 1e-12 else math.inf
