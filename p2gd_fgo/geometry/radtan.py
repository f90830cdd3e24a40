"""Radial-tangential lens (Brown), with OpenCV's coefficients and their order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from p2gd_fgo.geometry.camera_base import Camera, smallest_positive_root
from p2gd_fgo.types import FloatArray

_MAX_STEPS = 10
_LAST_STEP = 1e-7  # steps shrink quadratically: what is left after this one is below rounding


@dataclass(frozen=True)
class RadTanCamera(Camera):
    """Pinhole with radial and tangential distortion.

    Equation 4 of the paper, with OpenCV's k3 added. In vectors, with p = (x, y), c = (p2, p1) and
    r = |p|::

        p' = s p + r² c,    s = 1 + k1 r² + k2 r⁴ + k3 r⁶ + 2 c·p

    Attributes
    ----------
    k1, k2, p1, p2, k3
        Dimensionless, in OpenCV's order.
    """

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float = 0.0

    def _bend(self, plane: FloatArray) -> FloatArray:
        r2 = np.einsum("in,in->n", plane, plane)
        scale = ((self.k3 * r2 + self.k2) * r2 + self.k1) * r2
        scale += 2.0 * (self._c @ plane) + 1.0
        return np.asarray(scale * plane + self._c[:, None] * r2)

    def _bend_jacobian(self, plane: FloatArray) -> FloatArray:
        _, diagonal, off = self._bend_with_jacobian(plane)
        J = np.empty((plane.shape[1], 2, 2))
        J[:, 0, 0], J[:, 1, 1] = diagonal
        J[:, 0, 1] = J[:, 1, 0] = off
        return J

    def _bend_with_jacobian(self, plane: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute p' (2, N) and its symmetric derivative s I + 2 f' p pᵀ + 2 (p cᵀ + c pᵀ).

        f' is the derivative of the radial polynomial by r²; the derivative is returned as its
        diagonal (2, N) and its one off-diagonal element (N,).
        """
        c = self._c[:, None]
        r2 = np.einsum("in,in->n", plane, plane)
        scale = ((self.k3 * r2 + self.k2) * r2 + self.k1) * r2
        scale += 2.0 * (self._c @ plane) + 1.0
        slope = (6.0 * self.k3 * r2 + 4.0 * self.k2) * r2 + 2.0 * self.k1
        half = slope * plane
        off = half[0] * plane[1] + 2.0 * (self._c[::-1] @ plane)
        half += 4.0 * c
        half *= plane
        half += scale
        return scale * plane + c * r2, half, off

    def _unbend(self, plane: FloatArray) -> FloatArray:
        """Newton's method, started from the tabulated inverse of the radial part."""
        distorted, angle = self._table
        radius = np.maximum(np.sqrt(np.einsum("in,in->n", plane, plane)), np.finfo(float).tiny)
        start = plane * (np.tan(np.interp(radius, distorted, angle)) / radius)
        point, step = start.copy(), start
        with np.errstate(all="ignore"):  # only points without an inverse overflow; mended below
            for _ in range(_MAX_STEPS):
                bent, diagonal, off = self._bend_with_jacobian(point)
                bent -= plane
                determinant = diagonal[0] * diagonal[1] - off * off
                step = (diagonal[::-1] * bent - off * bent[::-1]) / determinant
                point -= step
                if np.abs(step).max(initial=0.0) < _LAST_STEP:
                    break
            found = np.abs(step).max(axis=0, initial=0.0) < _LAST_STEP
            found &= np.einsum("in,in->n", point, point) < self.max_radius**2
        if not found.all():
            point = np.where(found, point, plane * (self.max_radius / radius))
        return np.asarray(point)

    def _radial(self, angle: FloatArray) -> FloatArray:
        r = np.tan(angle)
        r2 = r * r
        return np.asarray(r * (1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))))

    def _turning_angle(self) -> float:
        slope = [3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3]  # in powers of r²
        return math.atan(math.sqrt(smallest_positive_root(slope)))

    @cached_property
    def _c(self) -> FloatArray:
        return np.array([self.p2, self.p1])
