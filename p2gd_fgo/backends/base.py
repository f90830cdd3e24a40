"""The contract that every back end answers."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.errors import EstimatorError
from p2gd_fgo.imu import UnknownMotion
from p2gd_fgo.types import (
    NANOSECONDS,
    Estimate,
    FloatArray,
    ImuBatch,
    NavState,
    Observations,
    Trajectory,
)

_MAX_SPEED = 100.0  # m/s; nothing that carries a camera on wheels or rotors goes faster
_MAX_ACCEL_BIAS = 5.0  # m/s²
_MAX_GYRO_BIAS = 1.0  # rad/s


class Backend(Protocol):
    """A sliding-window estimator of the IMU's state.

    The order of calls is ``start``, then ``propagate`` and ``update`` once an image, then
    ``finish``. A back end that can't go on raises :class:`EstimatorError`.
    """

    def start(self, state: NavState, covariance: FloatArray) -> None:
        """Begin at ``state`` with error covariance (15, 15)."""
        ...

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        """Predict the state at the end of ``imu``, whose first sample is at the last state.

        ``unknown``: noise for the steps in which the IMU was silent.
        """
        ...

    def update(self, observations: Observations, stationary: bool) -> Estimate:
        """Use the image at the predicted state's time; the first call may follow ``start``."""
        ...

    def finish(self) -> Trajectory:
        """All poses as they left the window (lag-smoothed), oldest first."""
        ...

    @property
    def counts(self) -> dict[str, int]:
        """Observations by what became of them, and other counters for the report."""
        ...


def check_sane(estimate: Estimate) -> None:
    """Refuse an estimate that no vehicle could have.

    Raises
    ------
    EstimatorError
        A number is not finite, the covariance is not positive, or speed or biases are absurd.
    """
    state = estimate.state
    numbers = (state.T_world_imu, state.velocity, state.gyro_bias, state.accel_bias)
    if not all(np.isfinite(a).all() for a in (*numbers, estimate.covariance)):
        raise EstimatorError(state.stamp_ns, "the estimate is not finite: the estimator diverged")
    if (np.diagonal(estimate.covariance) <= 0.0).any():
        raise EstimatorError(state.stamp_ns, "the covariance is not positive: diverged")
    for value, limit, name, unit in (
        (state.velocity, _MAX_SPEED, "speed", "m/s"),
        (state.accel_bias, _MAX_ACCEL_BIAS, "accelerometer bias", "m/s²"),
        (state.gyro_bias, _MAX_GYRO_BIAS, "gyroscope bias", "rad/s"),
    ):
        size = float(np.linalg.norm(value))
        if size > limit:
            raise EstimatorError(
                state.stamp_ns,
                f"the estimated {name} is {size:.3g} {unit}, beyond {limit:g}: diverged",
            )


def with_steady_bias(imu: ImuBatch, state: NavState, noise: ImuNoise) -> ImuBatch:
    """The samples as if Gauss-Markov biases stayed as they are in ``state``, at the first sample.

    What an estimated bias loses until a sample is known beforehand. With it taken out, biases are
    constant from image to image, and decay at the images; what a bias' error loses on the way is
    smaller than the bias' own noise by orders of magnitude.
    """
    if noise.biases_walk:
        return imu
    since_s = (imu.stamps_ns - imu.stamps_ns[0])[:, None] / NANOSECONDS
    return ImuBatch(
        imu.stamps_ns,
        imu.gyro - np.expm1(-since_s / noise.gyro_correlation_s) * state.gyro_bias,
        imu.accel - np.expm1(-since_s / noise.accel_correlation_s) * state.accel_bias,
    )


def with_decayed_bias(state: NavState, noise: ImuNoise, duration_s: float) -> NavState:
    """The state with what Gauss-Markov biases keep after ``duration_s``."""
    gyro, accel = noise.bias_decay(duration_s)
    return replace(state, gyro_bias=gyro * state.gyro_bias, accel_bias=accel * state.accel_bias)


def recent_poses(estimate: Estimate | None, predicted: NavState | None) -> Trajectory:
    """The estimate's window, with the predicted pose at its end if there is one."""
    if estimate is None:
        return Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    window = estimate.window
    if predicted is None:
        return window
    return Trajectory(
        np.append(window.stamps_ns, np.int64(predicted.stamp_ns)),
        np.concatenate([window.T_world_imu, predicted.T_world_imu[None]]),
    )
