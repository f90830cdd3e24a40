"""IMU samples with all the errors that a scenario asks for."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.imu import earth_rate
from p2gd_fgo.simulation.imu import SimulatedImu, exact_samples
from p2gd_fgo.simulation.scenario import ImuScenario
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray


def synthesize(
    trajectory: SplineTrajectory, stamps_ns: IntArray, imu: ImuScenario, seed: int
) -> SimulatedImu:
    """Samples at stamps_ns (N,), and the biases inside them.

    The readings are M (exact + bias) + noise, cut off where the sensor saturates; M holds scale
    errors and misalignment. Every source of error draws from a stream of its own, so that
    switching one on leaves the others as they were.
    """
    streams = [np.random.default_rng([seed, 5, k]) for k in range(8)]
    n = len(stamps_ns)
    exact = exact_samples(
        trajectory,
        stamps_ns,
        earth_rate=earth_rate(imu.latitude_deg, imu.heading_deg) if imu.earth_rotation else None,
    )
    dt = np.diff(stamps_ns, prepend=2 * stamps_ns[0] - stamps_ns[1]) / NANOSECONDS
    sensors = (
        (
            imu.gyro_bias_sigma,
            imu.gyro_random_walk,
            imu.gyro_correlation_s,
            imu.gyro_scale_error,
            imu.gyro_noise_density,
            None if imu.max_rate_deg is None else np.radians(imu.max_rate_deg),
        ),
        (
            imu.accel_bias_sigma,
            imu.accel_random_walk,
            imu.accel_correlation_s,
            imu.accel_scale_error,
            imu.accel_noise_density,
            imu.max_force,
        ),
    )
    readings, biases = [], []
    for k, (sigma, walk, tau_s, scale, density, limit) in enumerate(sensors):
        start, drift, frame, white = streams[4 * k : 4 * k + 4]
        bias = _bias(start.normal(0.0, 1.0, 3) * sigma, walk, dt, drift, imu, tau_s)
        M = np.eye(3) + np.diag(scale * frame.standard_normal(3))
        M += np.radians(imu.misalignment_deg) * frame.standard_normal((3, 3)) * (1.0 - np.eye(3))
        values = (exact[k] + bias) @ M.T
        values = values + density / np.sqrt(dt)[:, None] * white.standard_normal((n, 3))
        readings.append(values if limit is None else np.clip(values, -limit, limit))
        biases.append(bias)
    return SimulatedImu(ImuBatch(np.asarray(stamps_ns, np.int64), *readings), *biases)


def _bias(
    start: FloatArray,
    walk: float,
    dt: FloatArray,
    rng: np.random.Generator,
    imu: ImuScenario,
    tau_s: float,
) -> FloatArray:
    """Bias (N, 3): a random walk, or the same pulled back to zero within ``tau_s``."""
    steps = rng.standard_normal((len(dt), 3))
    steps[0] = 0.0
    if imu.bias_model == "walk":
        return np.asarray(start + np.cumsum(walk * np.sqrt(dt)[:, None] * steps, 0))
    decay = np.exp(-dt / tau_s)
    sigma = walk * np.sqrt(0.5 * tau_s * (1.0 - decay**2))
    out = np.empty((len(dt), 3))
    out[0] = start
    for k in range(1, len(dt)):
        out[k] = decay[k] * out[k - 1] + sigma[k] * steps[k]
    return out
