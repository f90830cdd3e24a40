"""Velocity, gravity and scale from linear systems, rotations being known.

With the gyro's rotations, the camera's place at time t is

    c(t) = v t + s (α(t) + ½ G t² (ĝ + B τ) + A(t) b_a + lever(t))

with the accelerometer's double integral α, its derivative A by the bias, gravity of known size G
about a direction ĝ, and a factor s that is 1. Taking s as an unknown, all of (v, s, s τ, s b_a)
enter linearly and without an offset, and with the tracks' points so do the sightings (as in
Dong-Si and Mourikis, IROS 2012, who fix s). A least-squares solution with s fixed shrinks: noise
makes every residual grow with depth, and there are far more of them than say anything about
scale. Here the length of the way is fixed instead (the solution is an eigenvector), and the scale
follows from s. Each equation is divided by the depth that the last solution gave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from p2gd_fgo.initialization.preintegration import Preintegrated
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.types import FloatArray

_ROUNDS = 8
_LEAST_DEPTH = 0.03  # of the median
_HUBER = 2.0
_MAX_SPEED = 60.0  # m/s
_SIGMA_TILT = 0.2  # rad, of the accelerometer's mean in motion
_V, _S, _TILT, _BIAS = slice(0, 3), 3, slice(4, 6), slice(6, 9)
_UNKNOWNS = 9


@dataclass(frozen=True, slots=True, eq=False)
class LinearStart:
    """The window's motion in the IMU frame of its first image.

    Attributes
    ----------
    R, v, p
        (K, 3, 3), (K, 3), (K, 3) of the images.
    gravity
        (3,) m/s², where things fall to.
    accel_bias
        (3,)
    """

    R: FloatArray
    v: FloatArray
    p: FloatArray
    gravity: FloatArray
    accel_bias: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """Chained intervals: rotations, times, and what the accelerometer adds to v and p.

    ``by_bias`` (K, 6, 3) are the derivatives of (v, p) by the accelerometer's bias.
    """

    R: FloatArray
    t: FloatArray
    v: FloatArray
    p: FloatArray
    by_bias: FloatArray


def solve_linear(
    sightings: WindowSightings,
    motion: Preintegrated,
    T_imu_cam: FloatArray,
    gravity: float,
    sigma_accel_bias: float,
    sigma_ray: float,
) -> LinearStart:
    """Solve for the motion over the window.

    Parameters
    ----------
    motion
        With the gyro's bias taken off and the accelerometer's left in.
    gravity
        Its size, m/s².
    sigma_accel_bias
        m/s², of the bias before anything was seen.
    sigma_ray
        rad, of a sighting.
    """
    path = _unroll(motion)
    R_cam = path.R @ T_imu_cam[:3, :3]
    lever = path.R @ T_imu_cam[:3, 3]
    k, starts = sightings.image, sightings.starts
    uv = sightings.normalized
    # Two rows a sighting that vanish on the ray: N (point in the camera's frame) = 0.
    N = np.zeros((len(uv), 2, 3))
    N[:, 0, 0] = N[:, 1, 1] = 1.0
    N[:, :, 2] = -uv
    F = N @ np.swapaxes(R_cam[k], -1, -2)
    Ft = np.swapaxes(F, -1, -2)

    axis = R_cam[k][:, None, :, 2]  # depth is the point's part along it
    axis_t = np.swapaxes(axis, -1, -2)

    # The accelerometer feels gravity upwards: its mean points away from where things fall to.
    down = -path.v[-1] / np.linalg.norm(path.v[-1])
    weight = np.full(len(uv), 1.0 / sigma_ray)
    prior = np.zeros(_UNKNOWNS)
    prior[_TILT], prior[_BIAS] = _SIGMA_TILT**-2, sigma_accel_bias**-2
    x = np.zeros(_UNKNOWNS)
    for turn in range(_ROUNDS):
        across = np.linalg.svd(down[None])[2][1:].T
        place = _places(path, lever, gravity, down, across)
        G, depth_by = F @ place[k], axis @ place[k]
        w2 = (weight**2)[:, None, None]
        noise = 2.0 * sigma_ray**2  # each of two rows is off by it, times the depth
        V = np.add.reduceat((Ft @ F - noise * axis_t @ axis) * w2, starts)
        W = np.add.reduceat((Ft @ G - noise * axis_t @ depth_by) * w2, starts)
        usable = np.linalg.eigvalsh(V)[:, 0] > 0.0  # more parallax than noise
        V[~usable], W[~usable] = np.eye(3), 0.0
        to_points = np.linalg.solve(V, W)  # points = to_points @ x
        used = usable[sightings.track]
        Gw = (G * weight[:, None, None])[used].reshape(-1, _UNKNOWNS)
        Dw = (depth_by * weight[:, None, None])[used].reshape(-1, _UNKNOWNS)
        A = Gw.T @ Gw - noise * Dw.T @ Dw
        A -= W.reshape(-1, _UNKNOWNS).T @ to_points.reshape(-1, _UNKNOWNS)
        way = (place - place[0]).reshape(-1, _UNKNOWNS)
        B = way.T @ way
        B += 1e-9 * np.trace(B) * np.eye(_UNKNOWNS)
        # Priors are of τ and b_a, the unknowns are s τ and s b_a, and s is 1 after each round.
        free = _UNKNOWNS if turn > 1 else 6
        A = (A + np.diag(prior) if turn > 1 else A)[:free, :free]
        x = np.zeros(_UNKNOWNS)
        x[:free] = eigh(A, B[:free, :free], subset_by_index=[0, 0])[1][:, 0]
        x = x * (1.0 if x[_S] >= 0.0 else -1.0)
        x[_S] = max(x[_S], np.linalg.norm(x[_V]) / _MAX_SPEED, 1e-12)
        x = x / x[_S]
        points = to_points @ x
        seen = points[sightings.track] - (place @ x)[k]
        seen = (np.swapaxes(R_cam[k], -1, -2) @ seen[..., None])[..., 0]
        depth = np.abs(seen[:, 2])
        middle = np.median(depth[used]) if used.any() else 1.0
        depth = np.maximum(depth, _LEAST_DEPTH * middle)
        miss = np.linalg.norm((N @ seen[..., None])[..., 0], axis=1) / (depth * sigma_ray)
        weight = np.sqrt(np.minimum(1.0, _HUBER / np.maximum(miss, 1e-9))) / (depth * sigma_ray)
        weight[~used] = 1.0 / (middle * sigma_ray)
        result = _motion(path, x, gravity, down, across)
        down = down + across @ np.clip(x[_TILT], -0.5, 0.5)
        down /= np.linalg.norm(down)
    return result


def _places(
    path: _Path, lever: FloatArray, gravity: float, down: FloatArray, across: FloatArray
) -> FloatArray:
    """The cameras' places as matrices (K, 3, 9) on the unknowns."""
    t = path.t[:, None, None]
    out = np.zeros((len(path.t), 3, _UNKNOWNS))
    out[:, :, _V] = t * np.eye(3)
    fall = 0.5 * gravity * t * t
    out[:, :, _S] = path.p + lever + fall[..., 0] * down
    out[:, :, _TILT] = fall * across
    out[:, :, _BIAS] = path.by_bias[:, 3:6]
    return out


def _motion(
    path: _Path, x: FloatArray, gravity: float, down: FloatArray, across: FloatArray
) -> LinearStart:
    g = gravity * (down + across @ x[_TILT])
    g *= gravity / np.linalg.norm(g)
    t, bias = path.t[:, None], x[_BIAS]
    return LinearStart(
        path.R,
        x[_V] + g * t + path.v + path.by_bias[:, 0:3] @ bias,
        x[_V] * t + 0.5 * g * t * t + path.p + path.by_bias[:, 3:6] @ bias,
        g,
        bias,
    )


def _unroll(motion: Preintegrated) -> _Path:
    """Chain the intervals."""
    count = len(motion.duration_s) + 1
    R = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    v, p, J = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 6, 3))
    for n, dt in enumerate(motion.duration_s.tolist()):
        R[n + 1] = R[n] @ motion.R[n]
        v[n + 1] = v[n] + R[n] @ motion.v[n]
        p[n + 1] = p[n] + v[n] * dt + R[n] @ motion.p[n]
        J[n + 1, 0:3] = J[n, 0:3] + R[n] @ motion.by_bias[n, 3:6, 3:6]
        J[n + 1, 3:6] = J[n, 3:6] + J[n, 0:3] * dt + R[n] @ motion.by_bias[n, 6:9, 3:6]
    t = np.concatenate([[0.0], np.cumsum(motion.duration_s)])
    return _Path(R, t, v, p, J)
