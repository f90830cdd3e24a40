"""Transforms that bring an estimate into the frame of the reference.

A visual-inertial estimate is free in position and yaw only, so ``yaw_pos`` is the honest default;
``se3`` and ``sim3`` (Umeyama, "Least-squares estimation of transformation parameters between two
point patterns", IEEE PAMI 1991) also forgive tilt and scale, ``origin`` forgives nothing after the
first pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry.pose import from_rotation_translation, inverse
from p2gd_fgo.types import FloatArray

ALIGNMENTS = ("yaw_pos", "se3", "sim3", "origin")

_STILL_M = 0.01  # RMS extent below which positions say nothing about yaw
_RANK = 1e-12  # second singular value over the first, below which the points lie on a line


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """p' = R (scale p) + t and R' = R R_estimate, with (R, t) in ``T`` (4, 4)."""

    scale: float
    T: FloatArray

    def apply(self, poses: FloatArray) -> FloatArray:
        """Aligned poses (..., 4, 4) of estimated ones."""
        scaled = np.array(poses, dtype=np.float64)
        scaled[..., :3, 3] *= self.scale
        return np.asarray(self.T @ scaled)


def align(kind: str, estimate: FloatArray, reference: FloatArray) -> Alignment | None:
    """Align poses (N, 4, 4) to others at the same stamps; ``kind`` is one of :data:`ALIGNMENTS`.

    None where the positions don't determine it: ``se3`` and ``sim3`` on a straight line or a point.
    """
    if kind == "yaw_pos":
        return align_yaw_pos(estimate, reference)
    if kind == "se3":
        return align_umeyama(estimate, reference, with_scale=False)
    if kind == "sim3":
        return align_umeyama(estimate, reference, with_scale=True)
    if kind == "origin":
        return Alignment(1.0, reference[0] @ inverse(estimate[0]))
    raise ValueError(f"alignment '{kind}' is none of {', '.join(ALIGNMENTS)}")


def align_yaw_pos(estimate: FloatArray, reference: FloatArray) -> Alignment:
    """Least squares over position and yaw.

    With centred positions x of the estimate and y of the reference,
    yaw = atan2(Σ(x₀y₁ − x₁y₀), Σ(x₀y₀ + x₁y₁)) and t = ȳ − R_z x̄. A body that doesn't move
    (RMS below 1 cm) says nothing about yaw by its positions; then yaw is the one that brings the
    orientations together.
    """
    p, q = estimate[:, :3, 3], reference[:, :3, 3]
    x, y = p - p.mean(axis=0), q - q.mean(axis=0)
    if np.sqrt(np.mean(np.sum(y[:, :2] ** 2, axis=1))) >= _STILL_M:
        moment = x[:, :2].T @ y[:, :2]
    else:
        moment = np.einsum("nik,njk->ij", estimate[:, :2, :3], reference[:, :2, :3])
    yaw = np.arctan2(moment[0, 1] - moment[1, 0], moment[0, 0] + moment[1, 1])
    R = np.eye(3)
    R[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    return Alignment(1.0, from_rotation_translation(R, q.mean(axis=0) - R @ p.mean(axis=0)))


def align_umeyama(
    estimate: FloatArray, reference: FloatArray, *, with_scale: bool
) -> Alignment | None:
    """Least squares over SE(3), or Sim(3) with scale (Umeyama 1991, eqs. 34-43)."""
    p, q = estimate[:, :3, 3], reference[:, :3, 3]
    x, y = p - p.mean(axis=0), q - q.mean(axis=0)
    U, d, Vt = np.linalg.svd(y.T @ x / len(x))
    if d[0] <= np.finfo(np.float64).eps or d[1] <= _RANK * d[0]:
        return None
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = (U * signs) @ Vt
    scale = float(d @ signs / np.mean(np.sum(x * x, axis=1))) if with_scale else 1.0
    t = q.mean(axis=0) - scale * R @ p.mean(axis=0)
    return Alignment(scale, from_rotation_translation(R, t))
