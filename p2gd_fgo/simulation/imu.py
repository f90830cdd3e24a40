"""IMU samples from a trajectory: exact kinematics plus white noise and a bias random walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray

# Xsens MTi-300 as calibrated for KAIST Urban: the industrial-grade MEMS of the paper's car.
MEMS_NOISE = ImuNoise(1.7453e-4, 1.0e-5, 5.886e-3, 1.0e-4)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedImu:
    """Samples and the biases inside them: ``gyro_bias``, ``accel_bias`` (N, 3)."""

    batch: ImuBatch
    gyro_bias: FloatArray
    accel_bias: FloatArray


def synthesize_imu(
    trajectory: SplineTrajectory,
    stamps_ns: IntArray,
    noise: ImuNoise | None,
    rng: np.random.Generator,
    *,
    gravity: float = 9.81,
    gyro_bias: FloatArray | None = None,
    accel_bias: FloatArray | None = None,
) -> SimulatedImu:
    """Sample the trajectory's angular rate and specific force at stamps_ns (N,).

    The samples are such that their trapezoid is the signal's integral to fourth order,
    f − h² f''/12, as a sensor's anti-alias filter would have it: integrating them gives back the
    trajectory.

    Parameters
    ----------
    noise
        Densities of white noise and bias walk; None: neither.
    gyro_bias, accel_bias
        (3,) biases at the first sample, zero by default.
    """
    n = len(stamps_ns)
    rate, force = exact_samples(trajectory, stamps_ns, gravity)
    b_g = np.tile(np.zeros(3) if gyro_bias is None else gyro_bias, (n, 1))
    b_a = np.tile(np.zeros(3) if accel_bias is None else accel_bias, (n, 1))
    gyro, accel = rate, force
    if noise is not None:
        dt = np.diff(stamps_ns, prepend=2 * stamps_ns[0] - stamps_ns[1])[:, None] / NANOSECONDS
        walk = np.sqrt(dt)
        walk[0] = 0.0
        b_g = b_g + np.cumsum(noise.gyro_random_walk * walk * rng.standard_normal((n, 3)), 0)
        b_a = b_a + np.cumsum(noise.accel_random_walk * walk * rng.standard_normal((n, 3)), 0)
        gyro = gyro + noise.gyro_noise_density / np.sqrt(dt) * rng.standard_normal((n, 3))
        accel = accel + noise.accel_noise_density / np.sqrt(dt) * rng.standard_normal((n, 3))
    batch = ImuBatch(np.asarray(stamps_ns, np.int64), gyro + b_g, accel + b_a)
    return SimulatedImu(batch, b_g, b_a)


def exact_samples(
    trajectory: SplineTrajectory,
    stamps_ns: IntArray,
    gravity: float = 9.81,
    earth_rate: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Angular rate and specific force (N, 3) that a perfect IMU gives at stamps_ns (N,).

    Parameters
    ----------
    earth_rate
        (3,) rotation of the world against the stars, rad/s in the world; the gyro feels it, and
        the accelerometer its Coriolis force. Gravity includes its centrifugal force already.
    """
    first, last = 2 * stamps_ns[:1] - stamps_ns[1:2], 2 * stamps_ns[-1:] - stamps_ns[-2:-1]
    state = trajectory.sample(np.concatenate([first, stamps_ns, last]))
    R = state.T_world_imu[:, :3, :3]
    force, rate = state.acceleration + np.array([0.0, 0.0, gravity]), state.angular_rate
    if earth_rate is not None:
        force = force + 2.0 * np.cross(earth_rate, state.velocity)
        rate = rate + np.einsum("nji,j->ni", R, earth_rate)
    return _trapezoid_samples(rate), _trapezoid_samples(np.einsum("nji,nj->ni", R, force))


def _trapezoid_samples(values: FloatArray) -> FloatArray:
    """Samples (N, 3) whose trapezoid integrates the signal, of its values (N + 2, 3)."""
    curvature = values[:-2] - 2.0 * values[1:-1] + values[2:]
    return values[1:-1] - curvature / 12.0
