"""Equidistant fisheye lens (Kannala and Brandt, IEEE TPAMI 2006, OpenCV's ``fisheye``)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry.camera_base import Camera, smallest_positive_root
from p2gd_fgo.types import FloatArray

_STEPS = 2  # from the table's 1e-7 rad one is enough; the second covers steep polynomials
_TINY = 1e-12


@dataclass(frozen=True)
class EquidistantCamera(Camera):
    """Fisheye whose distorted radius is a polynomial of the angle θ to the axis.

    r' = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), θ = atan r. Directions at 89° and more have no
    usable point on the plane z = 1.

    Attributes
    ----------
    k1, k2, k3, k4
        Dimensionless, in OpenCV's order.
    """

    k1: float
    k2: float
    k3: float
    k4: float

    def _bend(self, plane: FloatArray) -> FloatArray:
        r = np.maximum(np.sqrt(np.einsum("in,in->n", plane, plane)), _TINY)
        return np.asarray(plane * (self._radial(np.arctan(r)) / r))

    def _bend_jacobian(self, plane: FloatArray) -> FloatArray:
        r2 = np.maximum(np.einsum("in,in->n", plane, plane), _TINY * _TINY)
        r = np.sqrt(r2)
        angle = np.arctan(r)
        scale = self._radial(angle) / r
        outer = (self._radial_slope(angle) / (1.0 + r2) - scale) / r2
        J = (outer * plane)[:, None] * plane[None, :]
        J[0, 0] += scale
        J[1, 1] += scale
        return np.ascontiguousarray(np.moveaxis(J, -1, 0))

    def _unbend(self, plane: FloatArray) -> FloatArray:
        """Newton's method on the angle, started from the tabulated inverse."""
        radius = np.maximum(np.sqrt(np.einsum("in,in->n", plane, plane)), _TINY)
        distorted, tabulated = self._table
        angle = np.interp(radius, distorted, tabulated)
        for _ in range(_STEPS):
            angle -= (self._radial(angle) - radius) / self._radial_slope(angle)
        covered = radius < distorted[-1]
        angle = np.where(covered, angle, self.max_angle)
        return np.asarray(plane * (np.tan(angle) / radius))

    def _radial(self, angle: FloatArray) -> FloatArray:
        t = angle * angle
        return np.asarray(
            angle * (1.0 + t * (self.k1 + t * (self.k2 + t * (self.k3 + t * self.k4))))
        )

    def _radial_slope(self, angle: FloatArray) -> FloatArray:
        t = angle * angle
        return np.asarray(
            1.0
            + t * (3.0 * self.k1 + t * (5.0 * self.k2 + t * (7.0 * self.k3 + t * 9.0 * self.k4)))
        )

    def _turning_angle(self) -> float:
        slope = [3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3, 9.0 * self.k4]  # in powers of θ²
        return math.sqrt(smallest_positive_root(slope))
