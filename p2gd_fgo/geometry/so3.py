"""Rotations as matrices, batched over leading axes.

``Exp``/``Log`` between rotation vectors (..., 3) and matrices (..., 3, 3), the right Jacobian and
its inverse (Forster et al., "On-Manifold Preintegration", IEEE T-RO 2017, eqs. 3-9), and Hamilton
quaternions with w last (TUM) or first (EuRoC).
"""

from __future__ import annotations

import numpy as np

from p2gd_fgo.types import FloatArray

_SMALL_ANGLE = 1e-4  # rad; below it series of fourth order are exact to machine precision


def hat(v: FloatArray) -> FloatArray:
    """Skew-symmetric matrix (..., 3, 3) of v (..., 3): ``hat(v) @ w == cross(v, w)``."""
    v = np.asarray(v, dtype=np.float64)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def _coefficients(theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The three series sin θ/θ, (1 − cos θ)/θ², (θ − sin θ)/θ³, with their series near zero."""
    small = theta < _SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    t2 = theta * theta
    a = np.where(small, 1.0 - t2 / 6.0 + t2 * t2 / 120.0, np.sin(t) / t)
    b = np.where(small, 0.5 - t2 / 24.0, (1.0 - np.cos(t)) / (t * t))
    c = np.where(small, 1.0 / 6.0 - t2 / 120.0, (t - np.sin(t)) / (t * t * t))
    return a, b, c


def exp(phi: FloatArray) -> FloatArray:
    """Rotation matrix (..., 3, 3) of the rotation vector phi (..., 3), rad."""
    phi = np.asarray(phi, dtype=np.float64)
    a, b, _ = _coefficients(np.linalg.norm(phi, axis=-1))
    K = hat(phi)
    return np.asarray(np.eye(3) + a[..., None, None] * K + b[..., None, None] * (K @ K))


def log(R: FloatArray) -> FloatArray:
    """Rotation vector (..., 3), rad, of R (..., 3, 3), by way of the quaternion (exact near π)."""
    q = to_quaternion(R)
    vector, w = q[..., :3], q[..., 3]
    n = np.linalg.norm(vector, axis=-1)
    small = n < 1e-10
    scale = np.where(small, 2.0, 2.0 * np.arctan2(n, w) / np.where(small, 1.0, n))
    return np.asarray(vector * scale[..., None])


def right_jacobian(phi: FloatArray) -> FloatArray:
    """J_r (..., 3, 3) with Exp(φ + δ) ≈ Exp(φ) Exp(J_r(φ) δ)."""
    phi = np.asarray(phi, dtype=np.float64)
    _, b, c = _coefficients(np.linalg.norm(phi, axis=-1))
    K = hat(phi)
    return np.asarray(np.eye(3) - b[..., None, None] * K + c[..., None, None] * (K @ K))


def right_jacobian_inverse(phi: FloatArray) -> FloatArray:
    """J_r⁻¹ (..., 3, 3) with Log(Exp(φ) Exp(δ)) ≈ φ + J_r⁻¹(φ) δ."""
    phi = np.asarray(phi, dtype=np.float64)
    theta = np.linalg.norm(phi, axis=-1)
    small = theta < _SMALL_ANGLE
    t = np.where(small, 1.0, theta)
    d = np.where(
        small,
        1.0 / 12.0 + theta * theta / 720.0,
        1.0 / (t * t) - (1.0 + np.cos(t)) / (2.0 * t * np.where(small, 1.0, np.sin(t))),
    )
    K = hat(phi)
    return np.asarray(np.eye(3) + 0.5 * K + d[..., None, None] * (K @ K))


def second_integral(phi: FloatArray) -> FloatArray:
    """Γ₂ (..., 3, 3): ∫₀¹∫₀ˢ Exp(τ φ) dτ ds, so that p gains R Γ₂ a dt² under constant ω and a."""
    phi = np.asarray(phi, dtype=np.float64)
    theta = np.linalg.norm(phi, axis=-1)
    _, _, c = _coefficients(theta)
    small = theta < 1e-2  # the closed form loses digits to cancellation long before the others
    t = np.where(small, 1.0, theta)
    t2 = theta * theta
    d = np.where(
        small,
        1.0 / 24.0 - t2 / 720.0 + t2 * t2 / 40320.0,
        (t * t + 2.0 * np.cos(t) - 2.0) / (2.0 * t**4),
    )
    K = hat(phi)
    return np.asarray(0.5 * np.eye(3) + c[..., None, None] * K + d[..., None, None] * (K @ K))


def from_quaternion(q: FloatArray, *, w_first: bool = False) -> FloatArray:
    """Rotation matrix (..., 3, 3) of a quaternion (..., 4), normalised first; w last by default."""
    q = np.asarray(q, dtype=np.float64)
    if w_first:
        q = np.roll(q, -1, axis=-1)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    v, w = q[..., :3], q[..., 3]
    K = hat(v)
    return np.asarray(np.eye(3) + 2.0 * w[..., None, None] * K + 2.0 * (K @ K))


def to_quaternion(R: FloatArray) -> FloatArray:
    """Quaternion (..., 4), w last and not negative, of R (..., 3, 3) (Shepperd's method)."""
    R = np.asarray(R, dtype=np.float64)
    trace = np.trace(R, axis1=-2, axis2=-1)
    diagonal = np.diagonal(R, axis1=-2, axis2=-1)
    squares = np.concatenate([1.0 + 2.0 * diagonal - trace[..., None], 1.0 + trace[..., None]], -1)
    anti = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1
    )
    # Row k of the symmetric matrix 4 q qᵀ, k being the largest component, is q up to scale.
    outer = np.zeros((*R.shape[:-2], 4, 4))
    outer[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    index = np.arange(4)
    outer[..., index, index] = squares
    outer[..., :3, 3] = anti
    outer[..., 3, :3] = anti
    k = np.argmax(squares, axis=-1)[..., None, None]
    q = np.take_along_axis(outer, k, axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., 3:] < 0.0, -q, q))


def angle_deg(R: FloatArray) -> FloatArray:
    """Rotation angle in degrees of R (..., 3, 3)."""
    return np.asarray(np.degrees(np.linalg.norm(log(R), axis=-1)))
