"""IMU samples: integrating them gives back the route; noise is what it is said to be."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.imu import integrate
from p2gd_fgo.simulation.imu import MEMS_NOISE, synthesize_imu
from p2gd_fgo.simulation.routes import CAR, ROBOT, VehicleModel, make_route
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, IntArray, NavState

START_NS = 1_700_000_000 * NANOSECONDS
WHITE = ImuNoise(2e-3, 1e-12, 3e-2, 1e-12)
WALK = ImuNoise(1e-12, 1e-3, 1e-12, 2e-2)


def stamps(seconds: float, rate_hz: int) -> IntArray:
    return START_NS + NANOSECONDS // rate_hz * np.arange(int(seconds * rate_hz) + 1)


def standing(seconds: float) -> SplineTrajectory:
    t = START_NS + NANOSECONDS * np.arange(-4, int(seconds) + 5)
    return SplineTrajectory(t, np.zeros((len(t), 3)), np.tile(np.eye(3), (len(t), 1, 1)))


@pytest.mark.parametrize("model", [CAR, ROBOT], ids=["car", "robot"])
def test_integration_gives_back_the_route(model: VehicleModel) -> None:
    rng = np.random.default_rng(3)
    route = make_route(model, 60.0, rng, stops_s=((20.0, 25.0),), start_ns=START_NS)
    t = stamps(60.0, 100)
    biases = np.array([0.02, -0.01, 0.03]), np.array([0.1, -0.2, 0.05])
    imu = synthesize_imu(route, t, None, rng, gyro_bias=biases[0], accel_bias=biases[1])
    truth = route.sample(t)
    start = NavState(START_NS, truth.T_world_imu[0], truth.velocity[0], *biases)
    end = integrate(start, imu.batch, 9.81)
    assert end.stamp_ns == t[-1]
    assert np.linalg.norm(end.T_world_imu[:3, 3] - truth.T_world_imu[-1, :3, 3]) < 0.01
    assert so3.angle_deg(end.T_world_imu[:3, :3].T @ truth.T_world_imu[-1, :3, :3]) < 0.01
    assert np.linalg.norm(end.velocity - truth.velocity[-1]) < 1e-3


def test_at_rest_it_reads_gravity_and_its_biases() -> None:
    rng = np.random.default_rng(0)
    imu = synthesize_imu(
        standing(1.0), stamps(1.0, 100), None, rng, gravity=9.7, accel_bias=np.array([1.0, 2, 3])
    )
    np.testing.assert_allclose(imu.batch.gyro, 0.0, atol=1e-12)
    np.testing.assert_allclose(imu.batch.accel, [[1.0, 2.0, 12.7]] * 101, atol=1e-9)


@pytest.mark.parametrize("rate_hz", [50, 200])
def test_white_noise_has_its_density_at_every_rate(rate_hz: int) -> None:
    imu = synthesize_imu(standing(100.0), stamps(100.0, rate_hz), WHITE, np.random.default_rng(1))
    root = np.sqrt(rate_hz)
    np.testing.assert_allclose(imu.batch.gyro.std(0), WHITE.gyro_noise_density * root, rtol=0.06)
    np.testing.assert_allclose(imu.batch.accel.std(0), WHITE.accel_noise_density * root, rtol=0.06)
    # White: neighbours know nothing of each other.
    lag = np.mean(imu.batch.gyro[1:] * imu.batch.gyro[:-1]) / imu.batch.gyro.var()
    assert abs(lag) < 0.03


@pytest.mark.parametrize("rate_hz", [50, 200])
def test_biases_walk_by_their_density(rate_hz: int) -> None:
    imu = synthesize_imu(standing(100.0), stamps(100.0, rate_hz), WALK, np.random.default_rng(2))
    for bias, density in (
        (imu.gyro_bias, WALK.gyro_random_walk),
        (imu.accel_bias, WALK.accel_random_walk),
    ):
        np.testing.assert_array_equal(bias[0], 0.0)
        second = bias[::rate_hz]
        np.testing.assert_allclose(np.diff(second, axis=0).std(), density, rtol=0.15)
    np.testing.assert_allclose(imu.batch.gyro, imu.gyro_bias, atol=1e-9)
    np.testing.assert_allclose(imu.batch.accel - [0, 0, 9.81], imu.accel_bias, atol=1e-9)


def test_the_generator_decides() -> None:
    made = [
        synthesize_imu(standing(1.0), stamps(1.0, 100), MEMS_NOISE, np.random.default_rng(seed))
        for seed in (4, 4, 5)
    ]
    np.testing.assert_array_equal(made[0].batch.accel, made[1].batch.accel)
    assert (made[0].batch.accel != made[2].batch.accel).all()
