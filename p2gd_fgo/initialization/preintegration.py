"""IMU motion between neighbouring images, all intervals at once (Forster et al., T-RO 2017).

The pieces are those of :func:`p2gd_fgo.imu.increments`, so that the start integrates what the back
ends integrate.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.imu import between, increments
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray

_EYE = np.eye(3)
_THETA, _V, _P = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Pieces of constant rate and force, ``N`` intervals of at most ``S`` pieces.

    Attributes
    ----------
    dt_s
        (N, S) durations, 0 where an interval has fewer pieces.
    gyro, accel
        (N, S, 3) biases still in.
    duration_s
        (N,)
    """

    dt_s: FloatArray
    gyro: FloatArray
    accel: FloatArray
    duration_s: FloatArray


def intervals(imu: ImuBatch, stamps_ns: IntArray) -> Intervals:
    """Cut the samples at the images: N + 1 stamps give N intervals."""
    ends = stamps_ns.tolist()
    cut = [increments(between(imu, a, b)) for a, b in pairwise(ends)]
    most = max(len(c.dt_s) for c in cut)
    dt_s = np.zeros((len(cut), most))
    gyro, accel = np.zeros((len(cut), most, 3)), np.zeros((len(cut), most, 3))
    for n, c in enumerate(cut):
        used = len(c.dt_s)
        dt_s[n, :used], gyro[n, :used], accel[n, :used] = c.dt_s, c.gyro, c.accel
    return Intervals(dt_s, gyro, accel, np.diff(stamps_ns) / NANOSECONDS)


@dataclass(frozen=True, slots=True, eq=False)
class Preintegrated:
    """Motion over N intervals in the IMU frame at each one's beginning.

    Attributes
    ----------
    R, v, p
        (N, 3, 3), (N, 3), (N, 3): rotation to the beginning, and what velocity and position gain
        beside gravity and the velocity at the beginning.
    by_bias
        (N, 9, 6) derivative of (θ, v, p) by (b_g, b_a); θ is a turn on the right of ``R``.
    covariance
        (N, 9, 9) of (θ, v, p), from the sensor's white noise.
    duration_s
        (N,)
    """

    R: FloatArray
    v: FloatArray
    p: FloatArray
    by_bias: FloatArray
    covariance: FloatArray
    duration_s: FloatArray


def preintegrate(
    pieces: Intervals, gyro_bias: FloatArray, accel_bias: FloatArray, noise: ImuNoise
) -> Preintegrated:
    """Integrate every interval with its own biases (N, 3), or one for all (3,)."""
    count, steps = pieces.dt_s.shape
    phi = (pieces.gyro - _per_interval(gyro_bias)) * pieces.dt_s[..., None]
    force = pieces.accel - _per_interval(accel_bias)
    turns, right = so3.exp(phi), so3.right_jacobian(phi)
    first = np.asarray(so3.right_jacobian(-phi))
    second = so3.second_integral(phi)
    gain_v, gain_p = (first @ force[..., None])[..., 0], (second @ force[..., None])[..., 0]
    force_hat = so3.hat(force)
    cross_v, cross_p = so3.hat(gain_v), so3.hat(gain_p)

    R = np.broadcast_to(_EYE, (count, 3, 3)).copy()
    v, p = np.zeros((count, 3)), np.zeros((count, 3))
    J, C = np.zeros((count, 9, 6)), np.zeros((count, 9, 9))
    A = np.zeros((count, 9, 9))
    for s in range(steps):
        dt = pieces.dt_s[:, s, None]
        h, h2 = dt[..., None], (dt * dt)[..., None]
        A[:] = np.eye(9)
        A[:, _THETA, _THETA] = np.swapaxes(turns[:, s], -1, -2)
        A[:, _V, _THETA] = -(R @ cross_v[:, s]) * h
        A[:, _P, _THETA] = -(R @ cross_p[:, s]) * h2
        A[:, _P, _V] = h * _EYE
        J = A @ J
        J[:, _THETA, 0:3] -= right[:, s] * h
        J[:, _V, 0:3] += R @ force_hat[:, s] * (0.5 * h2)
        J[:, _P, 0:3] += R @ force_hat[:, s] * (h2 * h / 6.0)
        J[:, _V, 3:6] -= R @ first[:, s] * h
        J[:, _P, 3:6] -= R @ second[:, s] * h2
        C = A @ C @ np.swapaxes(A, -1, -2)
        C[:, _THETA, _THETA] += noise.gyro_noise_density**2 * h * _EYE
        white = noise.accel_noise_density**2 * _EYE
        C[:, _V, _V] += white * h
        C[:, _V, _P] += white * (0.5 * h2)
        C[:, _P, _V] += white * (0.5 * h2)
        C[:, _P, _P] += white * (h2 * h / 3.0)
        p = p + v * dt + (R @ gain_p[:, s, :, None])[..., 0] * dt**2
        v = v + (R @ gain_v[:, s, :, None])[..., 0] * dt
        R = R @ turns[:, s]
    return Preintegrated(R, v, p, J, C, pieces.duration_s)


def _per_interval(bias: FloatArray) -> FloatArray:
    return bias if bias.ndim == 1 else bias[:, None]
