"""Drives along streets: within the vehicle's limits, at rest where they should be, and recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.production import START_NS, Plan, plan
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.simulation.traffic import traffic
from p2gd_fgo.trajectory_files import write_tum
from p2gd_fgo.types import NANOSECONDS, Trajectory


def planned(name: str, **settings: object) -> Plan:
    return plan(load_scenario(find_preset(name), {"duration_s": 60.0, **settings}))


@pytest.mark.parametrize("name", ["kaist_like", "robot_like", "fast_turns", "stop_and_go"])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_drive_keeps_to_its_limits(name: str, seed: int) -> None:
    prepared = planned(name, seed=seed)
    vehicle = prepared.scenario.vehicle
    t = START_NS + np.arange(0, 60 * 100 + 1) * (NANOSECONDS // 100)
    state = prepared.drive.trajectory.sample(t)
    T = state.T_world_imu
    np.testing.assert_allclose(T[0, :3, 3], 0.0, atol=0.03)
    speed = np.linalg.norm(state.velocity, axis=1)
    assert speed.max() < 1.05 * vehicle.speed[1] and speed.max() > 0.5 * vehicle.speed[0]
    assert np.abs(state.velocity[:150]).max() < 1e-4  # it starts at rest
    rate = np.degrees(np.abs(state.angular_rate[:, 2]).max())
    assert rate < 1.25 * vehicle.turn_rate_deg
    forward = np.einsum("ni,ni->n", T[:, :3, 0], state.velocity)
    assert np.abs(speed - forward).max() < 0.06 * vehicle.speed[1]
    if vehicle.stop_every_m is not None and prepared.drive.arc_m[-1] > 2.0 * vehicle.stop_every_m:
        assert (speed[600:] < 1e-3).sum() > 80
    # It stays on its street.
    assert prepared.network.clearance(T[:, :2, 3]).max() < 0.0


def test_routes_differ_by_seed_and_repeat_for_one() -> None:
    one, again, other = (planned("kaist_like", seed=s).drive.way[:200] for s in (4, 4, 5))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.5 or not np.array_equal(one, other)


@pytest.mark.parametrize("name", ["crowded", "stop_and_go"])
def test_nothing_that_moves_touches_the_vehicle(name: str) -> None:
    from p2gd_fgo.simulation.palette import palette

    prepared = planned(name, duration_s=40.0)
    movers = traffic(
        prepared.scenario.traffic,
        prepared.drive,
        prepared.network,
        palette(0.25, 1.0),
        np.random.default_rng(0),
        prepared.ground_z,
    )
    assert len(movers) > 8
    times = np.arange(0.0, 40.0, 0.5)
    stamps = START_NS + np.round(times * NANOSECONDS).astype(np.int64)
    vehicle = prepared.drive.trajectory.sample(stamps).T_world_imu[:, :2, 3]
    for mover in movers:
        for time_s, own in zip(times.tolist(), vehicle, strict=True):
            place = mover.place(time_s)
            if place is None:
                continue
            c, s = np.cos(place[2]), np.sin(place[2])
            away = own - place[:2]
            along = abs(c * away[0] + s * away[1]) - 0.5 * mover.size[0]
            aside = abs(c * away[1] - s * away[0]) - 0.5 * mover.size[1]
            assert max(along, aside) > 0.5


def spiral(seconds: float, rate_hz: float = 20.0) -> Trajectory:
    """A climbing, curved drive at 5 m/s."""
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    yaw = 0.05 * t
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.zeros((len(t), 3, 3))
    R[:, 0, 0], R[:, 0, 1], R[:, 1, 0], R[:, 1, 1], R[:, 2, 2] = c, -s, s, c, 1.0
    p = np.column_stack([100.0 * np.sin(yaw) + 7.0, 100.0 * (1.0 - np.cos(yaw)), 0.2 * t])
    return Trajectory(
        1_600_000_000 * NANOSECONDS + np.round(t * NANOSECONDS).astype(np.int64),
        from_rotation_translation(R, p),
    )


def recorded(path: Path, **route: object) -> Scenario:
    return Scenario.model_validate(
        {"duration_s": 20.0, "route": {"file": str(path), **route}, "world": {"kind": "city"}}
    )


def test_a_recorded_route_is_driven(tmp_path: Path) -> None:
    file, driven = tmp_path / "drive.tum", spiral(40.0)
    write_tum(file, driven)
    prepared = plan(recorded(file, start_s=5.0))
    state = prepared.drive.trajectory.sample(prepared.image_stamps_ns)
    start = driven.T_world_imu[100]
    steps = driven.T_world_imu[100:501:2, :3, 3] - start[:3, 3]
    np.testing.assert_allclose(state.T_world_imu[:, :2, 3], steps[:, :2], atol=0.02)
    assert np.abs(state.T_world_imu[:, 2, 3]).max() < 0.6  # the hill is gone
    np.testing.assert_allclose(np.linalg.norm(state.velocity[:, :2], axis=1), 5.0, atol=0.05)
    assert not prepared.network.crossings
    assert prepared.network.clearance(state.T_world_imu[:, :2, 3]).max() < 0.0
    kept = plan(recorded(file, start_s=5.0, level=False))
    climb = kept.drive.trajectory.sample(kept.image_stamps_ns).T_world_imu[:, 2, 3]
    np.testing.assert_allclose(climb, 0.2 * np.arange(201) / 10.0, atol=0.02)


def test_routes_that_cannot_be_driven_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "drive.tum"
    write_tum(file, spiral(10.0))
    with pytest.raises(DataError, match=r"lasts 9\.\d s, but .* 20\.0 s: shorten"):
        plan(recorded(file))
    lines = file.read_text().splitlines()
    lines[50] = lines[50].replace(lines[50].split()[1], "nan")
    (tmp_path / "nan.tum").write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"nan\.tum, line 51: a value is NaN"):
        plan(recorded(tmp_path / "nan.tum"))
    write_tum(file, spiral(60.0))
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:200] + lines[300:]))
    with pytest.raises(DataError, match=r"a hole of 5\.\d s after 9\.9 s"):
        plan(recorded(file))
    with pytest.raises(DataError, match="no such trajectory file"):
        plan(recorded(tmp_path / "missing.tum"))
