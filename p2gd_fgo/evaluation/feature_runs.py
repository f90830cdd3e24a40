"""Run a back end over a simulated feature recording and compare it with the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.backends.base import Backend, check_sane
from p2gd_fgo.evaluation.consistency import nees, pose_error
from p2gd_fgo.imu import between, without_earth_rotation
from p2gd_fgo.initialization.given import disturbed
from p2gd_fgo.simulation.feature_recording import FeatureRecording
from p2gd_fgo.types import NANOSECONDS, BoolArray, Estimate, FloatArray, NavState, Trajectory

_GRAVITY = 9.81  # of the simulator

START_COVARIANCE = np.diag(
    np.concatenate(
        [
            np.radians([0.5, 0.5, 0.1]),  # tilt, tilt, yaw
            np.repeat([0.01, 0.05, 0.002, 0.02], 3),  # m, m/s, rad/s, m/s²
        ]
    )
    ** 2
)
"""(15, 15) of the error of the first state, as a given start has it by default."""


@dataclass(frozen=True, slots=True, eq=False)
class FeatureRun:
    """What a back end made of a recording of N images.

    Attributes
    ----------
    estimates
        N, each right after its image.
    smoothed
        As ``finish`` returned it.
    errors
        (N, 6) :func:`p2gd_fgo.evaluation.consistency.pose_error`.
    nees
        (N,) of the pose, 6 degrees of freedom.
    """

    estimates: list[Estimate]
    smoothed: Trajectory
    errors: FloatArray
    nees: FloatArray

    @property
    def position_error(self) -> FloatArray:
        """(N,) m; nothing is aligned: the start is the truth's."""
        return np.asarray(np.linalg.norm(self.errors[:, 3:], axis=1))

    @property
    def position_rmse(self) -> float:
        """M, over all images."""
        return float(np.sqrt(np.mean(self.position_error**2)))


def run_features(
    backend: Backend,
    recording: FeatureRecording,
    rng: np.random.Generator | None = None,
    *,
    stationary: BoolArray | None = None,
    earth_rate: FloatArray | None = None,
) -> FeatureRun:
    """Start ``backend`` at the first image and hand it all that follows.

    Parameters
    ----------
    rng
        Draws the error of the start from ``START_COVARIANCE``; None: it starts at the truth.
    stationary
        (N,) what a detector of standstill says; never still by default.
    earth_rate
        (3,) rotation of the world that is taken out of the samples, rad/s; none by default.

    Raises
    ------
    EstimatorError
        The back end diverged.
    """
    stamps = recording.image_stamps_ns.tolist()
    start = NavState(
        stamps[0],
        recording.T_world_imu[0],
        recording.velocity[0],
        recording.gyro_bias[0],
        recording.accel_bias[0],
    )
    backend.start(
        start if rng is None else disturbed(start, START_COVARIANCE, rng), START_COVARIANCE
    )
    estimates: list[Estimate] = []
    for k, observations in enumerate(recording.observations):
        if k > 0:
            imu = between(recording.imu, stamps[k - 1], stamps[k])
            if earth_rate is not None:
                imu = without_earth_rotation(imu, estimates[-1].state, _GRAVITY, earth_rate)
            backend.propagate(imu)
        estimate = backend.update(observations, stationary is not None and bool(stationary[k]))
        check_sane(estimate)
        estimates.append(estimate)
    poses = np.array([e.state.T_world_imu for e in estimates])
    errors = pose_error(poses, recording.T_world_imu)
    covariances = np.array([e.covariance[:6, :6] for e in estimates])
    return FeatureRun(estimates, backend.finish(), errors, nees(errors, covariances))


def detected_still(recording: FeatureRecording, delay_s: float) -> BoolArray:
    """(N,) the truth's standstills as a detector with this delay reports them."""
    stamps = recording.image_stamps_ns
    out = np.zeros(len(stamps), dtype=bool)
    for k in range(len(stamps)):
        past = (stamps >= stamps[k] - round(delay_s * NANOSECONDS)) & (stamps <= stamps[k])
        out[k] = recording.still[past].all()
    return out
