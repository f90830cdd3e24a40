"""Routes: where they start, what the vehicles can do, and standing still."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.simulation.routes import CAR, ROBOT, VehicleModel, make_route
from p2gd_fgo.simulation.trajectory import KinematicState
from p2gd_fgo.types import NANOSECONDS

VEHICLES = pytest.mark.parametrize("model", [CAR, ROBOT], ids=["car", "robot"])


def drive(
    model: VehicleModel, seed: int, stops_s: tuple[tuple[float, float], ...] = ()
) -> KinematicState:
    """The state at 100 Hz over 60 s."""
    route = make_route(model, 60.0, np.random.default_rng(seed), stops_s=stops_s, start_ns=10**18)
    return route.sample(10**18 + 10_000_000 * np.arange(6001))


@VEHICLES
@pytest.mark.parametrize("seed", range(4))
def test_start_speed_and_turns(model: VehicleModel, seed: int) -> None:
    state = drive(model, seed)
    T = state.T_world_imu
    np.testing.assert_allclose(T[0, :2, 3], 0.0, atol=1e-9)
    heading = np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))
    assert heading[0] == pytest.approx(0.0, abs=1e-9)
    forward = np.einsum("ni,ni->n", T[:, :3, 0], state.velocity)
    speed = np.linalg.norm(state.velocity, axis=1)
    assert speed.max() <= 1.02 * model.speed[1]
    assert speed.mean() > 0.5 * model.speed[0]
    # A wheeled body moves where it points, but for the suspension's heave.
    assert np.abs(speed - forward).max() < 0.05 * speed.max()
    assert np.abs(state.angular_rate[:, 2]).max() < 1.1 * model.turn_rate
    assert np.ptp(heading) > np.radians(30.0)
    horizontal = np.linalg.norm(state.acceleration[:, :2], axis=1)
    assert horizontal.max() < 1.5 * (model.acceleration + model.turn_rate * model.speed[1])
    assert np.abs(T[:, 2, 3]).max() <= model.shake_m
    tilt = np.arccos(np.clip(T[:, 2, 2], -1.0, 1.0))
    assert 0.1 * model.shake_rad < tilt.max() < 2.0 * model.shake_rad


@VEHICLES
def test_in_a_stop_nothing_moves(model: VehicleModel) -> None:
    state = drive(model, 2, ((0.0, 2.0), (30.0, 45.0)))
    for begin, end in ((0, 200), (3000, 4500)):
        still = slice(begin, end + 1)
        T = state.T_world_imu[still]
        assert np.abs(T - T[0]).max() < 1e-8
        assert np.abs(state.velocity[still]).max() < 1e-6
        assert np.abs(state.angular_rate[still]).max() < 1e-7
    between = np.linalg.norm(state.velocity[1500:2000], axis=1)
    assert between.min() > 0.3 * model.turn_speed


@VEHICLES
def test_the_seed_decides(model: VehicleModel) -> None:
    a, b, c = drive(model, 5), drive(model, 5), drive(model, 6)
    np.testing.assert_array_equal(a.T_world_imu, b.T_world_imu)
    assert np.linalg.norm(a.T_world_imu[-1, :3, 3] - c.T_world_imu[-1, :3, 3]) > 1.0


def test_half_a_second_is_left_on_both_sides() -> None:
    start = 1_700_000_000 * NANOSECONDS
    first, last = make_route(ROBOT, 5.0, np.random.default_rng(0), start_ns=start).span_ns
    assert first <= start - NANOSECONDS // 2
    assert last >= start + int(5.5 * NANOSECONDS)
