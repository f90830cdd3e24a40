"""The IMU alone: the plainest answer to the contract, and a yardstick."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.base import with_decayed_bias, with_steady_bias
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry.so3 import hat
from p2gd_fgo.imu import UnknownMotion, duration_s, increments, integrate, strapdown
from p2gd_fgo.types import (
    ERROR_DIM,
    Estimate,
    FloatArray,
    ImuBatch,
    NavState,
    Observations,
    Trajectory,
)


class DeadReckoning:
    """Strapdown integration from the start; images are ignored."""

    def __init__(self, noise: ImuNoise, gravity: float) -> None:
        self._noise = noise
        self._gravity = gravity
        self._poses: list[NavState] = []

    def start(self, state: NavState, covariance: FloatArray) -> None:
        """Begin at ``state``."""
        self._state, self._covariance = state, covariance

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        """Integrate the samples, and the covariance to first order sample by sample."""
        imu = with_steady_bias(imu, self._state, self._noise)
        F, Q = self._error_dynamics(imu, unknown)
        self._covariance = F @ self._covariance @ F.T + Q
        self._state = with_decayed_bias(
            integrate(self._state, imu, self._gravity), self._noise, duration_s(imu)
        )
        return self._state

    def update(self, observations: Observations, stationary: bool) -> Estimate:
        """The prediction, unchanged."""
        self._poses.append(self._state)
        window = Trajectory(
            np.array([self._state.stamp_ns], dtype=np.int64), self._state.T_world_imu[None]
        )
        return Estimate(self._state, self._covariance, window, stationary)

    def finish(self) -> Trajectory:
        """The same poses as online."""
        stamps = np.array([s.stamp_ns for s in self._poses], dtype=np.int64)
        poses = np.array([s.T_world_imu for s in self._poses]).reshape(-1, 4, 4)
        return Trajectory(stamps, poses)

    @property
    def counts(self) -> dict[str, int]:
        """Nothing to count."""
        return {}

    def _error_dynamics(
        self, imu: ImuBatch, unknown: UnknownMotion | None
    ) -> tuple[FloatArray, FloatArray]:
        """Transition (15, 15) and noise (15, 15) of the error over all samples."""
        n = self._noise
        F, Q = np.eye(ERROR_DIM), np.zeros((ERROR_DIM, ERROR_DIM))
        densities = np.repeat(
            [n.gyro_noise_density, 0.0, n.accel_noise_density, n.gyro_random_walk,
             n.accel_random_walk], 3)  # fmt: skip
        pieces = increments(imu)
        path = strapdown(self._state, pieces, self._gravity)
        rate = pieces.gyro - self._state.gyro_bias
        force = pieces.accel - self._state.accel_bias
        for k, dt in enumerate(pieces.dt_s):
            R = path.R[k]
            A = np.eye(ERROR_DIM)
            A[0:3, 0:3] -= hat(rate[k]) * dt
            A[0:3, 9:12] = -np.eye(3) * dt
            A[3:6, 6:9] = np.eye(3) * dt
            A[6:9, 0:3] = -R @ hat(force[k]) * dt
            A[6:9, 12:15] = -R * dt
            F = A @ F
            squares = densities**2
            if unknown is not None:
                squares[0:3] += unknown.gyro[k // 2] ** 2
                squares[6:9] += unknown.accel[k // 2] ** 2
            Q = A @ Q @ A.T + np.diag(squares * dt)
        left = np.repeat([1.0, 1.0, 1.0, *n.bias_decay(float(pieces.dt_s.sum()))], 3)
        return left[:, None] * F, Q * np.outer(left, left)
