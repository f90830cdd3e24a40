"""Samples at the image stamps, and strapdown integration against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.imu import (
    EARTH_RATE,
    ImuBuffer,
    between,
    earth_rate,
    increments,
    integrate,
    interpolate_imu,
    rotation_over,
    without_earth_rotation,
)
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, NavState

GRAVITY = 9.81


def batch(stamps_ns: list[int], seed: int = 0) -> ImuBatch:
    rng = np.random.default_rng(seed)
    n = len(stamps_ns)
    return ImuBatch(
        np.array(stamps_ns, dtype=np.int64), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    )


def sampled(signal_end_s: float, step_s: float) -> ImuBatch:
    """Rate and force that run linearly in time."""
    n = round(signal_end_s / step_s) + 1
    t = np.arange(n)[:, None] * step_s
    return ImuBatch(
        np.round(t[:, 0] * NANOSECONDS).astype(np.int64),
        np.array([0.2, -0.3, 0.5]) + t * np.array([0.5, 0.4, -0.8]),
        np.array([1.0, 2.0, 9.0]) + t * np.array([-3.0, 2.0, 4.0]),
    )


def test_interpolation_is_linear_and_holds_the_ends() -> None:
    imu = batch([0, 10, 30])
    gyro, accel = interpolate_imu(imu, np.array([-5, 5, 25, 99]))
    np.testing.assert_allclose(gyro[1], 0.5 * (imu.gyro[0] + imu.gyro[1]))
    np.testing.assert_allclose(accel[2], 0.25 * imu.accel[1] + 0.75 * imu.accel[2])
    np.testing.assert_array_equal(gyro[[0, 3]], imu.gyro[[0, 2]])


@pytest.mark.parametrize(
    ("start", "end", "inner"), [(5, 25, [10, 20]), (10, 20, []), (11, 13, []), (0, 30, [10, 20])]
)
def test_between_covers_exactly_the_interval(start: int, end: int, inner: list[int]) -> None:
    imu = batch([0, 10, 20, 30])
    part = between(imu, start, end)
    assert part.stamps_ns.tolist() == [start, *inner, end]
    gyro, accel = interpolate_imu(imu, part.stamps_ns)
    np.testing.assert_allclose(part.gyro, gyro)
    np.testing.assert_allclose(part.accel, accel)


def test_between_refuses_an_empty_interval() -> None:
    with pytest.raises(ValueError, match="positive length"):
        between(batch([0, 10]), 5, 5)
    with pytest.raises(ValueError, match="needs samples"):
        between(batch([]), 0, 5)


def test_increments_have_both_integrals_of_a_straight_line() -> None:
    imu = batch([0, 7_000_000, 20_000_000])
    pieces = increments(imu)
    ends_s = np.diff(imu.stamps_ns) / NANOSECONDS
    assert pieces.dt_s.sum() == pytest.approx(ends_s.sum())
    for k, h in enumerate(ends_s):
        for values, samples in ((pieces.gyro, imu.gyro), (pieces.accel, imu.accel)):
            first, second = values[2 * k], values[2 * k + 1]
            a, b = samples[k], samples[k + 1]
            np.testing.assert_allclose((first + second) * h / 2, (a + b) * h / 2)
            twice = first * h * h * 3 / 8 + second * h * h / 8
            np.testing.assert_allclose(twice, h * h * (a / 3 + b / 6), atol=1e-18)


def test_integrate_is_exact_on_a_circle() -> None:
    rate, radius, height = 0.7, 4.0, 1.5
    speed = rate * radius
    stamps = np.arange(0, 3_000_000_001, 10_000_000)
    n = len(stamps)
    gyro_bias, accel_bias = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3])
    imu = ImuBatch(
        stamps,
        np.tile([0.0, 0.0, rate], (n, 1)) + gyro_bias,
        np.tile([0.0, speed * rate, GRAVITY], (n, 1)) + accel_bias,
    )
    start = NavState(
        0,
        from_rotation_translation(np.eye(3), np.array([0.0, -radius, height])),
        np.array([speed, 0.0, 0.0]),
        gyro_bias,
        accel_bias,
    )
    end = integrate(start, imu, GRAVITY)
    angle = rate * 3.0
    expected = [radius * np.sin(angle), -radius * np.cos(angle), height]
    np.testing.assert_allclose(end.T_world_imu[:3, 3], expected, atol=1e-9)
    np.testing.assert_allclose(
        end.velocity, [speed * np.cos(angle), speed * np.sin(angle), 0.0], atol=1e-9
    )
    turn = so3.exp(np.array([0.0, 0.0, angle]))
    np.testing.assert_allclose(end.T_world_imu[:3, :3], turn, atol=1e-12)
    np.testing.assert_allclose(rotation_over(imu, gyro_bias), turn, atol=1e-12)
    assert end.stamp_ns == 3_000_000_000


def test_integration_is_of_third_order() -> None:
    start = NavState(0, np.eye(4), np.array([1.0, 0.0, 0.0]))

    def end(step_s: float) -> FloatArray:
        state = integrate(start, sampled(0.8, step_s), GRAVITY)
        return np.concatenate([state.T_world_imu[:3, 3], state.velocity])

    exact = end(0.0005)
    coarse, fine = np.abs(end(0.02) - exact).max(), np.abs(end(0.01) - exact).max()
    assert coarse < 1e-5
    assert coarse / fine > 6.5


def test_interval_is_exact_when_images_lie_off_the_samples() -> None:
    """Images 5 ms off the grid: the pieces meet, and nothing of the drive is lost."""
    imu = sampled(1.0, 0.01)
    state = NavState(205_000_000, np.eye(4), np.array([9.0, 0.0, 0.0]))
    whole = integrate(state, between(imu, 205_000_000, 605_000_000), GRAVITY)
    for first in range(205_000_000, 605_000_000, 100_000_000):
        state = integrate(state, between(imu, first, first + 100_000_000), GRAVITY)
    np.testing.assert_allclose(state.T_world_imu, whole.T_world_imu, atol=1e-6)
    grid = integrate(
        NavState(200_000_000, np.eye(4), np.array([9.0, 0.0, 0.0])),
        between(imu, 200_000_000, 600_000_000),
        GRAVITY,
    )
    assert np.linalg.norm(grid.T_world_imu[:3, 3] - whole.T_world_imu[:3, 3]) < 0.02


def test_buffer_merges_and_drops_what_no_interval_needs() -> None:
    buffer = ImuBuffer()
    assert len(buffer.samples()) == 0
    everything = batch(list(range(0, 100, 10)))
    for rows in (slice(0, 4), slice(4, 4), slice(4, 10)):
        buffer.add(
            ImuBatch(everything.stamps_ns[rows], everything.gyro[rows], everything.accel[rows])
        )
    np.testing.assert_array_equal(buffer.samples().gyro, everything.gyro)
    buffer.drop_before(35)
    assert buffer.samples().stamps_ns.tolist() == [30, 40, 50, 60, 70, 80, 90]
    part = between(buffer.samples(), 35, 45)
    np.testing.assert_array_equal(part.gyro, between(everything, 35, 45).gyro)
    buffer.drop_before(30)
    assert buffer.samples().stamps_ns[0] == 30


def test_buffer_refuses_disorder_and_nonsense() -> None:
    buffer = ImuBuffer()
    buffer.add(batch([0, 10]))
    with pytest.raises(DataError, match="must increase"):
        buffer.add(batch([10, 20]))
    with pytest.raises(DataError, match="must increase"):
        buffer.add(batch([20, 30, 25]))
    broken = batch([20, 30])
    broken.gyro[1, 2] = np.nan
    with pytest.raises(DataError, match="not finite"):
        buffer.add(broken)
    assert len(buffer.samples()) == 2


def test_a_sensor_that_turns_with_the_earth_feels_nothing_else() -> None:
    """At rest on the turning Earth, and on a straight drive, the exact readings are known."""
    rate = earth_rate(37.0, 30.0)
    assert np.linalg.norm(rate) == pytest.approx(EARTH_RATE)
    assert rate[2] == pytest.approx(EARTH_RATE * np.sin(np.radians(37.0)))
    np.testing.assert_allclose(earth_rate(0.0, 90.0), [EARTH_RATE, 0.0, 0.0], atol=1e-20)
    R = so3.exp(np.array([0.3, -0.2, 1.0]))
    velocity = np.array([8.0, -3.0, 0.5])
    stamps = 10_000_000 * np.arange(6001, dtype=np.int64)
    force = np.array([0.0, 0.0, 9.81]) + 2.0 * np.cross(rate, velocity)
    imu = ImuBatch(stamps, np.tile(rate @ R, (6001, 1)), np.tile(force @ R, (6001, 1)))
    start = NavState(0, from_rotation_translation(R, np.zeros(3)), velocity)

    felt = integrate(start, imu, 9.81)
    assert np.linalg.norm(felt.T_world_imu[:3, 3] - 60.0 * velocity) > 0.5
    state = start
    for first in range(0, 6000, 10):
        part = between(imu, int(stamps[first]), int(stamps[first + 10]))
        state = integrate(state, without_earth_rotation(part, state, 9.81, rate), 9.81)
    np.testing.assert_allclose(state.T_world_imu[:3, 3], 60.0 * velocity, atol=1e-4)
    np.testing.assert_allclose(state.T_world_imu[:3, :3], R, atol=1e-7)
