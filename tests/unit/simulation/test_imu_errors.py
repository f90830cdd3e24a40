"""IMU errors of a scenario: each is there when asked for, and leaves the others as they were."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.geometry import so3
from p2gd_fgo.imu import EARTH_RATE, earth_rate, integrate
from p2gd_fgo.simulation.imu_errors import synthesize
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.production import START_NS, plan
from p2gd_fgo.simulation.scenario import ImuScenario
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, IntArray, NavState

PERFECT = {
    "gyro_noise_density": 0.0, "gyro_random_walk": 0.0, "accel_noise_density": 0.0,
    "accel_random_walk": 0.0, "gyro_bias_sigma": 0.0, "accel_bias_sigma": 0.0,
}  # fmt: skip


def imu_with(**settings: object) -> ImuScenario:
    return ImuScenario.model_validate({**PERFECT, **settings})


def stamps(seconds: float, rate_hz: int = 100) -> IntArray:
    return START_NS + NANOSECONDS // rate_hz * np.arange(int(seconds * rate_hz) + 1)


def standing(seconds: float) -> SplineTrajectory:
    t = START_NS + NANOSECONDS * np.arange(-4, int(seconds) + 5)
    return SplineTrajectory(t, np.zeros((len(t), 3)), np.tile(np.eye(3), (len(t), 1, 1)))


@pytest.mark.parametrize("name", ["kaist_like", "robot_like", "fast_turns"])
def test_integrating_a_perfect_imu_gives_back_the_drive(name: str) -> None:
    prepared = plan(load_scenario(find_preset(name), {"duration_s": 60.0}))
    trajectory, t = prepared.drive.trajectory, prepared.imu_stamps_ns
    imu = synthesize(trajectory, t, imu_with(), 0)
    truth = trajectory.sample(t)
    end = integrate(NavState(int(t[0]), truth.T_world_imu[0], truth.velocity[0]), imu.batch, 9.81)
    assert np.linalg.norm(end.T_world_imu[:3, 3] - truth.T_world_imu[-1, :3, 3]) < 0.01
    assert so3.angle_deg(end.T_world_imu[:3, :3].T @ truth.T_world_imu[-1, :3, :3]) < 0.01


def test_earth_rotation_is_felt_and_uncompensated_it_drifts() -> None:
    imu = imu_with(earth_rotation=True, latitude_deg=30.0, heading_deg=90.0)
    rate = earth_rate(30.0, 90.0)  # x points north
    expected = EARTH_RATE * np.array([np.cos(np.radians(30.0)), 0.0, 0.5])
    np.testing.assert_allclose(rate, expected, atol=1e-12)
    samples = synthesize(standing(10.0), stamps(10.0), imu, 0).batch
    np.testing.assert_allclose(samples.gyro, np.tile(expected, (1001, 1)), atol=1e-12)
    prepared = plan(load_scenario(find_preset("kaist_like"), {"duration_s": 60.0}))
    trajectory, t = prepared.drive.trajectory, prepared.imu_stamps_ns
    truth = trajectory.sample(t)
    batch = synthesize(trajectory, t, imu, 0).batch
    end = integrate(NavState(int(t[0]), truth.T_world_imu[0], truth.velocity[0]), batch, 9.81)
    turned = so3.angle_deg(end.T_world_imu[:3, :3].T @ truth.T_world_imu[-1, :3, :3])
    assert turned == pytest.approx(np.degrees(EARTH_RATE) * 60.2, rel=0.02)
    # Taking the rotation out of the samples takes most of it away; Coriolis' force is the rest.
    R = truth.T_world_imu[:, :3, :3]
    from p2gd_fgo.types import ImuBatch

    force = batch.accel - 2.0 * np.einsum("nji,nj->ni", R, np.cross(rate, truth.velocity))
    still = ImuBatch(t, batch.gyro - np.einsum("nji,j->ni", R, rate), force)
    end = integrate(NavState(int(t[0]), truth.T_world_imu[0], truth.velocity[0]), still, 9.81)
    assert np.linalg.norm(end.T_world_imu[:3, 3] - truth.T_world_imu[-1, :3, 3]) < 0.02


def test_gauss_markov_biases_stay_bounded_where_a_walk_does_not() -> None:
    walk = {"gyro_random_walk": 1e-3, "accel_random_walk": 1e-2}
    pulled = imu_with(**walk, bias_model="gauss_markov", gyro_correlation_s=2.0)
    free = imu_with(**walk)
    seconds = 400.0
    bounded = synthesize(standing(seconds), stamps(seconds, 20), pulled, 3)
    drifting = synthesize(standing(seconds), stamps(seconds, 20), free, 3)
    sigma = 1e-3 * np.sqrt(0.5 * 2.0)
    assert bounded.gyro_bias.std() == pytest.approx(sigma, rel=0.2)
    assert np.abs(drifting.gyro_bias).max() > 6.0 * sigma
    lag = 40  # 2 s
    b = bounded.gyro_bias
    correlation = (b[lag:] * b[:-lag]).mean() / (b * b).mean()
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.15)
    np.testing.assert_allclose(bounded.batch.gyro, bounded.gyro_bias, atol=1e-12)


def test_scale_misalignment_and_saturation() -> None:
    trajectory = plan(
        load_scenario(find_preset("fast_turns"), {"duration_s": 20.0})
    ).drive.trajectory
    t = stamps(20.0)
    exact = synthesize(trajectory, t, imu_with(), 0).batch
    wrong = imu_with(gyro_scale_error=0.02, misalignment_deg=0.5)
    skewed = synthesize(trajectory, t, wrong, 0).batch
    M, *_ = np.linalg.lstsq(exact.gyro, skewed.gyro, rcond=None)
    assert 0.001 < np.abs(np.diag(M) - 1.0).max() < 0.08
    assert 0.001 < np.abs(M - np.diag(np.diag(M))).max() < 0.04
    np.testing.assert_allclose(exact.gyro @ M, skewed.gyro, atol=1e-9)
    cut = synthesize(trajectory, t, imu_with(max_rate_deg=10.0, max_force=9.9), 0).batch
    assert np.abs(cut.gyro).max() == pytest.approx(np.radians(10.0))
    assert np.abs(cut.accel).max() == pytest.approx(9.9)
    free = np.abs(exact.gyro) < np.radians(10.0)
    np.testing.assert_array_equal(cut.gyro[free], exact.gyro[free])


def test_one_source_of_error_leaves_the_others_as_they_were() -> None:
    still, t = standing(5.0), stamps(5.0)
    plain = synthesize(still, t, ImuScenario(), 1)
    more = synthesize(still, t, ImuScenario.model_validate({"gyro_noise_density": 1e-2}), 1)
    np.testing.assert_array_equal(plain.accel_bias, more.accel_bias)
    np.testing.assert_array_equal(plain.gyro_bias, more.gyro_bias)
    np.testing.assert_array_equal(plain.batch.accel, more.batch.accel)
    assert np.abs(plain.batch.gyro - more.batch.gyro).max() > 1e-2
    other = synthesize(still, t, ImuScenario(), 2)
    assert np.abs(plain.batch.accel - other.batch.accel).max() > 1e-3
