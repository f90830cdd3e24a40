"""Start from a known state, as the paper does: from truth, or from the configuration."""

from __future__ import annotations

import zlib

import numpy as np

from p2gd_fgo.config import GivenStartConfig
from p2gd_fgo.errors import DataError, InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import (
    covered,
    from_rotation_translation,
    interpolate,
    interpolation_weights,
)
from p2gd_fgo.initialization.base import Start
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray, NavState, Truth, Waiting

_DERIVATIVE_NS = 50_000_000  # half the base of the difference that gives a missing velocity


class GivenStart:
    """Starts at the first image that the state is known for.

    Raises
    ------
    DataError
        ``source: truth`` without truth.
    """

    def __init__(self, config: GivenStartConfig, truth: Truth | None, seed: int) -> None:
        if config.source == "truth" and truth is None:
            raise DataError(
                "initialization.kind is 'given' from truth, but the recording has no truth: use "
                "'static', or give the state with initialization.given.source=config"
            )
        self._config = config
        self._truth = truth
        self._seed = seed

    def attempt(self, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer) -> Start | Waiting:
        """Start here if truth covers the image."""
        c = self._config
        loose_velocity, loose_gyro, loose_accel = 1.0, 1.0, 1.0
        if c.source == "config":
            T = from_rotation_translation(
                so3.exp(np.array(c.rotation_vector)), np.array(c.position)
            )
            velocity = np.array(c.velocity)
            gyro_bias = np.array(c.gyro_bias or (0.0, 0.0, 0.0))
            accel_bias = np.array(c.accel_bias or (0.0, 0.0, 0.0))
        else:
            truth = self._truth
            assert truth is not None
            stamps = truth.trajectory.stamps_ns
            if stamp_ns < stamps[0]:
                return Waiting(stamp_ns, "waiting for the truth to begin")
            if stamp_ns > stamps[-1]:
                raise self.refusal()
            derived = _velocity(truth, stamp_ns)
            if derived is None:
                return Waiting(stamp_ns, "waiting for a hole in the truth to end")
            T, velocity = interpolate(truth.trajectory, np.array([stamp_ns]))[0], derived
            loose_velocity = 1.0 if truth.velocity is not None else c.loosening
            gyro_bias, loose_gyro = _bias(c.gyro_bias, truth.gyro_bias, stamps, stamp_ns, c)
            accel_bias, loose_accel = _bias(c.accel_bias, truth.accel_bias, stamps, stamp_ns, c)

        R = T[:3, :3]
        tilt, yaw = np.radians(c.sigma_tilt_deg), np.radians(c.sigma_yaw_deg)
        P = np.diag(
            np.repeat(
                [
                    0.0,
                    c.sigma_position,
                    c.sigma_velocity * loose_velocity,
                    c.sigma_gyro_bias * loose_gyro,
                    c.sigma_accel_bias * loose_accel,
                ],
                3,
            )
            ** 2
        )
        P[0:3, 0:3] = R.T @ np.diag([tilt, tilt, yaw]) ** 2 @ R
        state = NavState(stamp_ns, T, velocity, gyro_bias, accel_bias)
        if c.noise:
            state = disturbed(state, P, self._drawing(imu))
        return Start(state, P, f"given, from {c.source}")

    def _drawing(self, imu: ImuBatch) -> np.random.Generator:
        """Of this seed on this recording: routes that share an error would not be independent."""
        first = np.concatenate([imu.gyro[:1], imu.accel[:1]]).tobytes()
        return np.random.default_rng([self._seed, zlib.crc32(first)])

    def refusal(self) -> InitializationError:
        """No image lies within the truth."""
        return InitializationError(
            "the given start found no image within the time that the truth covers"
        )


def disturbed(state: NavState, covariance: FloatArray, rng: np.random.Generator) -> NavState:
    """The state with an error drawn from its covariance (15, 15): what the estimator is told."""
    error = np.linalg.cholesky(covariance) @ rng.standard_normal(len(covariance))
    T = from_rotation_translation(
        state.T_world_imu[:3, :3] @ so3.exp(-error[0:3]), state.T_world_imu[:3, 3] - error[3:6]
    )
    return NavState(
        state.stamp_ns,
        T,
        state.velocity - error[6:9],
        state.gyro_bias - error[9:12],
        state.accel_bias - error[12:15],
    )


def _velocity(truth: Truth, stamp_ns: int) -> FloatArray | None:
    """(3,) at a time; None in a hole, or where no derivative can be had without bridging one."""
    at = np.array([stamp_ns, stamp_ns - _DERIVATIVE_NS, stamp_ns + _DERIVATIVE_NS])
    here, before, after = covered(truth.trajectory, at).tolist()
    if not here:
        return None
    if truth.velocity is not None:
        i, j, w = interpolation_weights(truth.trajectory.stamps_ns, np.array([stamp_ns]))
        return np.asarray((1.0 - w[0]) * truth.velocity[i[0]] + w[0] * truth.velocity[j[0]])
    ends = at[[1 if before else 0, 2 if after else 0]]
    if ends[0] == ends[1]:
        return None
    first, last = interpolate(truth.trajectory, ends)[:, :3, 3]
    return np.asarray((last - first) / ((ends[1] - ends[0]) / NANOSECONDS))


def _bias(
    given: tuple[float, float, float] | None,
    from_truth: FloatArray | None,
    stamps_ns: IntArray,
    stamp_ns: int,
    config: GivenStartConfig,
) -> tuple[FloatArray, float]:
    """A bias and the factor on its sigma."""
    if given is not None:
        return np.array(given), 1.0
    if from_truth is not None:
        k = int(np.argmin(np.abs(stamps_ns - stamp_ns)))
        return from_truth[k].copy(), 1.0
    return np.zeros(3), config.loosening
