"""What the IMU says between the images of the start window: residuals and their information."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.preintegration import Intervals, preintegrate
from p2gd_fgo.types import ERROR_DIM, FloatArray

if TYPE_CHECKING:
    from p2gd_fgo.initialization.bundle import WindowStates

_EYE = np.eye(3)


def inertial_residuals(
    states: WindowStates, pieces: Intervals, noise: ImuNoise, gravity: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals (K - 1, 15), their derivative (K - 1, 15, 30) and covariance (K - 1, 15, 15).

    The residuals are (θ, v, p) of the preintegration, then the steps of the biases; the columns
    are the errors of the state before and after.
    """
    m = preintegrate(pieces, states.gyro_bias[:-1], states.accel_bias[:-1], noise)
    count = len(m.v)
    dt = m.duration_s[:, None]
    fall = np.array([0.0, 0.0, -gravity])
    Rt = np.swapaxes(states.R[:-1], -1, -2)
    turn = np.swapaxes(m.R, -1, -2) @ Rt @ states.R[1:]
    theta = so3.log(turn)
    gained_v = (Rt @ (states.v[1:] - states.v[:-1] - fall * dt)[..., None])[..., 0]
    way = states.p[1:] - states.p[:-1] - states.v[:-1] * dt - 0.5 * fall * dt**2
    gained_p = (Rt @ way[..., None])[..., 0]
    r = np.concatenate(
        [theta, gained_v - m.v, gained_p - m.p,
         np.diff(states.gyro_bias, axis=0), np.diff(states.accel_bias, axis=0)], axis=1,
    )  # fmt: skip

    inverse = so3.right_jacobian_inverse(theta)
    J = np.zeros((count, 15, 2 * ERROR_DIM))
    J[:, 0:3, 0:3] = -inverse @ np.swapaxes(states.R[1:], -1, -2) @ states.R[:-1]
    J[:, 0:3, 15:18] = inverse
    # A turn of the preintegrated rotation on its right passes the residual's turn to get out.
    J[:, 0:3, 9:15] = -inverse @ np.swapaxes(turn, -1, -2) @ m.by_bias[:, 0:3]
    J[:, 3:6, 0:3] = so3.hat(gained_v)
    J[:, 3:6, 6:9] = -Rt
    J[:, 3:6, 21:24] = Rt
    J[:, 3:9, 9:15] = -m.by_bias[:, 3:9]
    J[:, 6:9, 0:3] = so3.hat(gained_p)
    J[:, 6:9, 3:6] = -Rt
    J[:, 6:9, 18:21] = Rt
    J[:, 6:9, 6:9] = -Rt * dt[..., None]
    J[:, 9:15, 9:15] = -np.eye(6)
    J[:, 9:15, 24:30] = np.eye(6)

    C = np.zeros((count, 15, 15))
    C[:, :9, :9] = m.covariance
    walk = np.repeat([noise.gyro_random_walk**2, noise.accel_random_walk**2], 3)
    C[:, range(9, 15), range(9, 15)] = walk * dt
    return r, J, C


def inertial_terms(
    states: WindowStates,
    pieces: Intervals,
    noise: ImuNoise,
    gravity: float,
    H: FloatArray | None,
    g: FloatArray | None,
) -> float:
    """The cost; H (15 K, 15 K) and g (15 K,) gain the system's part where they are given."""
    r, J, C = inertial_residuals(states, pieces, noise, gravity)
    L = np.linalg.cholesky(C)
    white = np.linalg.solve(L, r[..., None])
    if H is not None and g is not None:
        Jw = np.linalg.solve(L, J)
        Jt = np.swapaxes(Jw, -1, -2)
        for n, (block, step) in enumerate(zip(Jt @ Jw, (Jt @ white)[..., 0], strict=True)):
            at = slice(n * ERROR_DIM, (n + 2) * ERROR_DIM)
            H[at, at] += block
            g[at] -= step
    return float(np.sum(white**2))
