"""Start from a standstill: gravity gives roll and pitch, the gyro's mean its bias."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import StaticStartConfig, StationaryConfig
from p2gd_fgo.errors import InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.geometry.so3 import hat
from p2gd_fgo.imu import between
from p2gd_fgo.initialization.base import Start
from p2gd_fgo.initialization.stationary import Stillness, stillness
from p2gd_fgo.types import ERROR_DIM, NANOSECONDS, FloatArray, ImuBatch, NavState, Waiting

_COVERED_SHARE = 0.9  # of the window, by images that were still one after the other
_MAX_GRAVITY_ERROR = 1.0  # m/s²; no bias of a working accelerometer is larger


class StaticStart:
    """Waits for a standstill, at most ``max_wait_s`` of data.

    The world's origin is where the body stands, its x axis points where the body's x axis does.
    """

    def __init__(
        self, config: StaticStartConfig, stationary: StationaryConfig, gravity: float
    ) -> None:
        self._config = config
        self._stationary = stationary
        self._gravity = gravity
        self._first_ns: int | None = None
        self._last_ns = 0
        self._best: Stillness | None = None
        self._still_since_ns: int | None = None

    def attempt(self, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer) -> Start | Waiting:
        """Start if the last ``window_s`` were still.

        The features of a fast camera don't live that long: then the images of the window are
        compared in shorter spans, one after the other.
        """
        if self._first_ns is None:
            self._first_ns = stamp_ns
        self._last_ns = stamp_ns
        window_s = self._config.window_s
        was_still = self._still_since_ns is not None
        now = stillness(stamp_ns, imu, buffer, window_s, self._stationary, was_still=was_still)
        if now.still and not was_still:
            self._still_since_ns = now.since_ns
        elif not (now.still or _undecided(now, self._stationary)):
            self._still_since_ns = None
        since_ns = self._still_since_ns
        if (
            now.still
            and since_ns is not None
            and stamp_ns - since_ns >= _COVERED_SHARE * window_s * NANOSECONDS
        ):
            part = between(imu, stamp_ns - int(window_s * NANOSECONDS), stamp_ns)
            state, covariance = level_state(part, self._config, self._gravity)
            waited = (stamp_ns - self._first_ns) / NANOSECONDS
            return Start(state, covariance, f"static, after {waited:.1f} s")
        if now.covered and (self._best is None or now.score < self._best.score):
            self._best = now
        if (stamp_ns - self._first_ns) / NANOSECONDS > self._config.max_wait_s:
            raise self.refusal()
        return Waiting(stamp_ns, f"waiting for {window_s:g} s of standstill")

    def refusal(self) -> InitializationError:
        """The stillest window beside the thresholds."""
        waited = (self._last_ns - (self._first_ns or self._last_ns)) / NANOSECONDS
        window_s = self._config.window_s
        if self._best is None:
            return InitializationError(
                f"the static start found no {window_s:g} s of IMU data and images in {waited:.1f} s"
            )
        return InitializationError(
            f"the static start found no standstill of {window_s:g} s in {waited:.1f} s: the "
            f"stillest had {self._best.describe(self._stationary)}; if the recording starts in "
            "motion, give a state with initialization.kind=given"
        )


def _undecided(now: Stillness, config: StationaryConfig) -> bool:
    """The IMU is quiet, but there is nothing to compare: all tracks have just begun."""
    quiet = now.gyro_std <= config.max_gyro_std and now.accel_std <= config.max_accel_std
    return now.covered and quiet and now.features < config.min_features


def level_state(
    imu: ImuBatch, config: StaticStartConfig, gravity: float
) -> tuple[NavState, FloatArray]:
    """State and covariance (15, 15) from samples at rest.

    The mean specific force is R^T g + b_a + noise. Its direction gives the tilt; one Kalman update
    makes the tilt and the accelerometer's bias as correlated as they are, and gives the bias along
    gravity from what the force's size has over g.

    Raises
    ------
    InitializationError
        The size of the mean force is not gravity's.
    """
    mean_force = imu.accel.mean(axis=0)
    size = float(np.linalg.norm(mean_force))
    if abs(size - gravity) > _MAX_GRAVITY_ERROR:
        raise InitializationError(
            f"at rest the accelerometer reads {size:.4g} m/s², more than {_MAX_GRAVITY_ERROR:g} "
            f"m/s² off imu.gravity = {gravity:g}: check the unit of its samples"
        )
    up = mean_force / size
    R_world_imu = heading_frame(up)

    P = np.zeros((ERROR_DIM, ERROR_DIM))
    any_tilt = 1.0  # rad, before gravity is looked at
    P[0:3, 0:3] = any_tilt**2 * (np.eye(3) - np.outer(up, up))
    P[0:3, 0:3] += np.radians(config.sigma_yaw_deg) ** 2 * np.outer(up, up)
    sigmas = (
        config.sigma_position, config.sigma_velocity,
        config.sigma_gyro_bias, config.sigma_accel_bias,
    )  # fmt: skip
    P[range(3, ERROR_DIM), range(3, ERROR_DIM)] = np.repeat(sigmas, 3) ** 2
    H = np.zeros((3, ERROR_DIM))
    H[:, 0:3] = hat(gravity * up)
    H[:, 12:15] = np.eye(3)
    noise = config.sigma_gravity**2 * np.eye(3)
    K = np.linalg.solve(H @ P @ H.T + noise, H @ P).T
    A = np.eye(ERROR_DIM) - K @ H
    P = A @ P @ A.T + K @ noise @ K.T
    accel_bias = K[12:15] @ (mean_force - gravity * up)

    state = NavState(
        int(imu.stamps_ns[-1]),
        from_rotation_translation(R_world_imu, np.zeros(3)),
        np.zeros(3),
        imu.gyro.mean(axis=0),
        accel_bias,
    )
    return state, P


def heading_frame(up: FloatArray) -> FloatArray:
    """R_world_imu (3, 3) of a body that sees up (3,) there: z up, x where the body's x points.

    A body whose x axis points up or down has the heading of its z axis.
    """
    x_axis = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    forward = x_axis - up * (up @ x_axis)
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])
