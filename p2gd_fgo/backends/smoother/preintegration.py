"""IMU factors between images: GTSAM's preintegration fed with the shared increments."""

from __future__ import annotations

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, V, X

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.imu import ImuIncrements, UnknownMotion, increments
from p2gd_fgo.types import FloatArray, ImuBatch

# Position error of the integration itself; GTSAM wants it positive definite.
_INTEGRATION_DENSITY = 1e-5


class Preintegrator:
    """Makes the factor between two images.

    The whole 15-dimensional noise is in ``CombinedImuFactor``; all covariances of its parameters
    default to the identity in GTSAM, so every one is set here. It knows biases that walk; those
    that are pulled back to zero have a linear factor of their own, beside the ``ImuFactor``.
    """

    def __init__(self, noise: ImuNoise, gravity: float) -> None:
        self._noise = noise
        self._gravity = gravity
        self._params = self._made_params()

    def factors(
        self,
        imu: ImuBatch,
        bias: FloatArray,
        frame_i: int,
        frame_j: int,
        unknown: UnknownMotion | None = None,
    ) -> list[gtsam.NonlinearFactor]:
        """The factors from frame i to frame j.

        Parameters
        ----------
        imu
            Samples from image i to image j, both ends included.
        bias
            (6,) accelerometer then gyroscope: the preintegration's linearisation point.
        unknown
            Noise for the steps in which the IMU was silent.
        """
        pieces = increments(imu)
        # GTSAM holds the attitude of a piece at its start; turning the force by the mean rotation
        # of the piece makes the step second order in dt.
        phi = (pieces.gyro - bias[3:]) * pieces.dt_s[:, None]
        turn = so3.right_jacobian(-phi)
        accel = (turn @ (pieces.accel - bias[:3])[..., None])[..., 0] + bias[:3]
        point = gtsam.imuBias.ConstantBias(bias[:3], bias[3:])
        i, j = frame_i, frame_j
        params = self._params if unknown is None else self._made_params()
        if self._noise.biases_walk:
            combined = gtsam.PreintegratedCombinedMeasurements(params, point)
            self._integrate(combined, params, accel, pieces, unknown)
            return [gtsam.CombinedImuFactor(X(i), V(i), X(j), V(j), B(i), B(j), combined)]
        motion = gtsam.PreintegratedImuMeasurements(params, point)
        self._integrate(motion, params, accel, pieces, unknown)
        return [
            gtsam.ImuFactor(X(i), V(i), X(j), V(j), B(i), motion),
            self._decay(float(pieces.dt_s.sum()), i, j),
        ]

    def _integrate(
        self,
        measured: gtsam.PreintegratedCombinedMeasurements | gtsam.PreintegratedImuMeasurements,
        params: gtsam.PreintegrationCombinedParams,
        accel: FloatArray,
        pieces: ImuIncrements,
        unknown: UnknownMotion | None,
    ) -> None:
        for k, (a, w, dt) in enumerate(zip(accel, pieces.gyro, pieces.dt_s, strict=True)):
            if unknown is not None:  # of this factor's own, and read anew at every piece
                self._set_noise(params, float(unknown.gyro[k // 2]), float(unknown.accel[k // 2]))
            measured.integrateMeasurement(a, w, float(dt))

    def _made_params(self) -> gtsam.PreintegrationCombinedParams:
        params = gtsam.PreintegrationCombinedParams.MakeSharedU(self._gravity)
        eye = np.eye(3)
        self._set_noise(params, 0.0, 0.0)
        params.setBiasOmegaCovariance(eye * self._noise.gyro_random_walk**2)
        params.setBiasAccCovariance(eye * self._noise.accel_random_walk**2)
        params.setIntegrationCovariance(eye * _INTEGRATION_DENSITY**2)
        return params

    def _set_noise(
        self, params: gtsam.PreintegrationCombinedParams, gyro: float, accel: float
    ) -> None:
        """White noise of the sensors, and these densities beside it."""
        eye = np.eye(3)
        params.setGyroscopeCovariance(eye * (self._noise.gyro_noise_density**2 + gyro**2))
        params.setAccelerometerCovariance(eye * (self._noise.accel_noise_density**2 + accel**2))

    def _decay(self, duration_s: float, i: int, j: int) -> gtsam.NonlinearFactor:
        """b_j = exp(-t / τ) b_i + noise, exact over the interval."""
        n = self._noise
        gyro, accel = n.bias_decay(duration_s)
        left = np.repeat([accel, gyro], 3)
        sigmas = np.repeat(
            [n.accel_random_walk * np.sqrt(_driven_s(duration_s, n.accel_correlation_s)),
             n.gyro_random_walk * np.sqrt(_driven_s(duration_s, n.gyro_correlation_s))], 3
        )  # fmt: skip
        linear = gtsam.JacobianFactor(
            B(i), -np.diag(left), B(j), np.eye(6), np.zeros(6),
            gtsam.noiseModel.Diagonal.Sigmas(sigmas),
        )  # fmt: skip
        at_zero = gtsam.Values()
        for key in (B(i), B(j)):
            at_zero.insert(key, constant_bias=gtsam.imuBias.ConstantBias())
        return gtsam.LinearContainerFactor(linear, at_zero)


def _driven_s(duration_s: float, correlation_s: float) -> float:
    """Time over which a walk gathers the variance that the process gathers in ``duration_s``."""
    if np.isinf(correlation_s):
        return duration_s
    return float(-0.5 * correlation_s * np.expm1(-2.0 * duration_s / correlation_s))
