"""From image to image: all IMU samples at once, mean and covariance.

The mean is the strapdown integral that the smoother uses too. The error's transition from any
sample to the end is closed form in running sums along the path, so that the noise of all samples is
added up in one product; no loop runs over 15x15 matrices. With f the specific force in the world,

    S(t) = ∫ R,   V(t) = ∫ f,   P(t) = ∫∫ f,   A(t) = ∫ [f]× S,   B(t) = ∫ A,   U(t) = ∫ S.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.backends.base import with_decayed_bias, with_steady_bias
from p2gd_fgo.backends.msckf.state import FilterState
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.imu import StrapdownPath, UnknownMotion, increments, strapdown
from p2gd_fgo.types import ERROR_DIM, FloatArray, ImuBatch, NavState

_EYE = np.eye(3)
_THETA, _P, _V, _BG, _BA = (slice(k, k + 3) for k in range(0, ERROR_DIM, 3))


def propagate(
    state: FilterState,
    imu: ImuBatch,
    noise: ImuNoise,
    gravity: float,
    *,
    fej: bool,
    unknown: UnknownMotion | None = None,
) -> FilterState:
    """The state at the end of ``imu``, with one image more in the window."""
    start = state.newest()
    pieces = increments(with_steady_bias(imu, start, noise))
    path = strapdown(start, pieces, gravity)
    integrals = _integrate(
        path, pieces.dt_s, pieces.gyro - start.gyro_bias, pieces.accel - start.accel_bias, gravity
    )
    moved = NavState(
        int(imu.stamps_ns[-1]),
        from_rotation_translation(so3.from_quaternion(so3.to_quaternion(path.R[-1])), path.p[-1]),
        path.v[-1],
        start.gyro_bias,
        start.accel_bias,
    )
    predicted = with_decayed_bias(moved, noise, float(integrals.t[-1]))
    to_end = transitions(path.R, integrals)
    Phi = with_first_estimates(
        to_end[0],
        state.linearization_poses(fej).R[-1],
        state.linearization_velocity(fej),
        path,
        float(integrals.t[-1]),
        gravity,
    )
    left = np.repeat([1.0, 1.0, 1.0, *noise.bias_decay(float(integrals.t[-1]))], 3)
    Q = process_noise(to_end, pieces.dt_s, noise, unknown)
    return state.propagated(predicted, left[:, None] * Phi, Q * np.outer(left, left))


@dataclass(frozen=True, slots=True, eq=False)
class _Integrals:
    """Running integrals at the K + 1 ends of K pieces, zero at the first: see the module."""

    t: FloatArray
    S: FloatArray
    V: FloatArray
    P: FloatArray
    A: FloatArray
    B: FloatArray
    U: FloatArray


def _integrate(
    path: StrapdownPath, dt_s: FloatArray, rate: FloatArray, force: FloatArray, gravity: float
) -> _Integrals:
    """With rate and force (K, 3) of each piece, biases taken off."""
    t = _running(dt_s)
    g = np.array([0.0, 0.0, -gravity])
    V = path.v - path.v[0] - t[:, None] * g
    P = path.p - path.p[0] - t[:, None] * path.v[0] - 0.5 * (t * t)[:, None] * g
    dt, dt3 = dt_s[:, None], dt_s[:, None, None]
    phi, R = rate * dt, path.R[:-1]
    S = _running(R @ so3.right_jacobian(-phi) * dt3)
    Ra = R @ so3.hat(force)
    A = _running(so3.hat(np.diff(V, axis=0)) @ S[:-1] + (0.5 * dt3 * dt3) * Ra)
    within = so3.hat(np.diff(P, axis=0) - V[:-1] * dt)
    B = _running(A[:-1] * dt3 + within @ S[:-1] + (dt3 * dt3 * dt3 / 6.0) * Ra)
    U = _running(S[:-1] * dt3 + R @ so3.second_integral(phi) * (dt3 * dt3))
    return _Integrals(t, S, V, P, A, B, U)


def _running(steps: FloatArray) -> FloatArray:
    out = np.zeros((len(steps) + 1, *steps.shape[1:]))
    np.cumsum(steps, axis=0, out=out[1:])
    return out


def transitions(R: FloatArray, i: _Integrals) -> FloatArray:
    """Φ (K + 1, 15, 15) of the error from each end of a piece to the end of the path."""
    left = (i.t[-1] - i.t)[:, None, None]
    out = np.zeros((len(R), ERROR_DIM, ERROR_DIM))
    out[:] = np.eye(ERROR_DIM)
    S = i.S[-1] - i.S
    dv = so3.hat(i.V[-1] - i.V)
    dp = so3.hat(i.P[-1] - i.P - i.V * left[..., 0])
    out[:, _THETA, _THETA] = R[-1].T @ R
    out[:, _THETA, _BG] = -(R[-1].T @ S)
    out[:, _P, _THETA] = -(dp @ R)
    out[:, _P, _V] = left * _EYE
    out[:, _P, _BG] = i.B[-1] - i.B - left * i.A - dp @ i.S
    out[:, _P, _BA] = -(i.U[-1] - i.U - left * i.S)
    out[:, _V, _THETA] = -(dv @ R)
    out[:, _V, _BG] = i.A[-1] - i.A - dv @ i.S
    out[:, _V, _BA] = -S
    return out


def process_noise(
    to_end: FloatArray, dt_s: FloatArray, noise: ImuNoise, unknown: UnknownMotion | None = None
) -> FloatArray:
    """Q (15, 15): the trapezoid of Φ G Q_c Gᵀ Φᵀ over the path."""
    densities = np.repeat(
        [noise.gyro_noise_density, 0.0, noise.accel_noise_density, noise.gyro_random_walk,
         noise.accel_random_walk], 3)  # fmt: skip
    sigmas = np.sqrt(_at_ends(dt_s))[:, None] * densities
    if unknown is not None:  # each step is two pieces
        for axes, density in ((_THETA, unknown.gyro), (_V, unknown.accel)):
            squares = _at_ends(dt_s * np.repeat(density, 2) ** 2)
            sigmas[:, axes] = np.sqrt(sigmas[:, axes] ** 2 + squares[:, None])
    spread = to_end * sigmas[:, None]
    columns = np.ascontiguousarray(spread.transpose(0, 2, 1)).reshape(-1, ERROR_DIM)
    return np.asarray(columns.T @ columns)


def _at_ends(pieces: FloatArray) -> FloatArray:
    """Half of each of K pieces at either of its ends, (K + 1,)."""
    out = np.zeros(len(pieces) + 1)
    out[:-1] += 0.5 * pieces
    out[1:] += 0.5 * pieces
    return out


def with_first_estimates(
    Phi: FloatArray,
    R: FloatArray,
    v: FloatArray,
    path: StrapdownPath,
    duration_s: float,
    gravity: float,
) -> FloatArray:
    """Φ (15, 15) with the rotation's columns taken from the first estimates R (3, 3), v (3,).

    These columns decide what becomes of a turn of the whole world about gravity, under which
    (δθ, δp, δv) turn by (Rᵀe, e × p, e × v). With these columns, Φ takes the turn at the one
    linearisation point to the turn at the other, whatever the points are. At the path's own
    beginning they are those of ``Phi``.
    """
    g = np.array([0.0, 0.0, -gravity])
    moved = path.p[-1] - path.p[0] - v * duration_s - 0.5 * g * duration_s**2
    gained = path.v[-1] - v - g * duration_s
    out = Phi.copy()
    out[_THETA, _THETA] = path.R[-1].T @ R
    out[_P, _THETA] = -so3.hat(moved) @ R
    out[_V, _THETA] = -so3.hat(gained) @ R
    return out
