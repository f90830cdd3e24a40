"""What was planned against what was driven: caught, let through, and not flipping."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from prior_scenes import HALF_TURN, IMAGE_NS, Spoilt, arc, go_through, planner, stamps

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors.recorded import with_white_noise
from p2gd_fgo.simulation.routes import CAR, ROBOT, VehicleModel, make_route
from p2gd_fgo.types import BoolArray, FloatArray, PriorPoses, Trajectory

CONTRADICTED = "priors_contradicted"
LATEST_VERDICT = 20  # images after the first; then every image is contradicted


def twice_as_far(T: FloatArray) -> FloatArray:
    T[:, :3, 3] *= 2.0
    return T


def a_fifth_farther(T: FloatArray) -> FloatArray:
    T[:, :3, 3] *= 1.2
    return T


def half_as_far(T: FloatArray) -> FloatArray:
    T[:, :3, 3] *= 0.5
    return T


def turned_about(T: FloatArray) -> FloatArray:
    return HALF_TURN @ T @ HALF_TURN


def facing_back(T: FloatArray) -> FloatArray:
    return HALF_TURN @ T


def driven_backwards(T: FloatArray) -> FloatArray:
    return inverse(T)


def last_pose_first(T: FloatArray) -> FloatArray:
    return T[::-1]


def turning_the_other_way(T: FloatArray) -> FloatArray:
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    return mirror @ T @ mirror


BREAKS = (
    twice_as_far,
    half_as_far,
    turned_about,
    facing_back,
    driven_backwards,
    last_pose_first,
)


def spoil(change: Callable[[FloatArray], FloatArray]) -> Callable[[PriorPoses], PriorPoses]:
    return lambda ahead: PriorPoses(ahead.stamps_ns, change(ahead.T_imu0_imu.copy()))


def route(vehicle: VehicleModel, seed: int, stops: tuple[tuple[float, float], ...]) -> Trajectory:
    spline = make_route(vehicle, 40.0, np.random.default_rng(seed), stops_s=stops)
    first, last = spline.span_ns
    at = np.arange(first, last, IMAGE_NS)
    return Trajectory(at, spline.sample(at).T_world_imu)


@pytest.mark.parametrize("change", BREAKS)
@pytest.mark.parametrize("speed", [10.0, 1.0])
@pytest.mark.parametrize("turn_deg", [0.0, 20.0])
def test_what_is_broken_is_caught_and_stays_caught(
    change: Callable[[FloatArray], FloatArray], speed: float, turn_deg: float
) -> None:
    drive = arc(stamps(80), speed, turn_deg)
    kinds = go_through(drive, Spoilt(planner(drive), spoil(change)))
    assert kinds[:10] == [None] * 10  # nothing to compare with yet
    assert set(kinds[LATEST_VERDICT:78]) == {CONTRADICTED}


def test_a_turn_to_the_other_side_is_caught() -> None:
    drive = arc(stamps(80), turn_deg=30.0)
    kinds = go_through(drive, Spoilt(planner(drive), spoil(turning_the_other_way)))
    assert set(kinds[LATEST_VERDICT:78]) == {CONTRADICTED}


@pytest.mark.parametrize("speed", [10.0, 1.0, 0.0])
@pytest.mark.parametrize("seed", range(4))
def test_ten_metres_of_white_noise_are_caught(speed: float, seed: int) -> None:
    drive = arc(stamps(80), speed)
    noisy = with_white_noise(drive, 10.0, 0.0, np.random.default_rng(seed))
    assert set(go_through(drive, planner(drive, noisy))[LATEST_VERDICT:78]) == {CONTRADICTED}


@pytest.mark.parametrize("vehicle", [CAR, ROBOT])
@pytest.mark.parametrize(
    ("position", "yaw_deg"), [(0.0, 0.0), (0.25, 0.0), (0.0, 2.5), (0.25, 2.5)]
)
@pytest.mark.parametrize("seed", range(3))
def test_the_noise_of_table_viii_is_let_through(
    vehicle: VehicleModel, position: float, yaw_deg: float, seed: int
) -> None:
    """Also while it brakes, stands and drives on."""
    drive = route(vehicle, seed, ((12.0, 18.0),))
    noisy = with_white_noise(drive, position, yaw_deg, np.random.default_rng(seed))
    assert set(go_through(drive, planner(drive, noisy))) == {None}


def test_a_planner_that_rounds_and_lags_is_let_through() -> None:
    """0.3 s behind at the beginning of every turn, and a scale error of 20 %."""
    drive = route(CAR, 5, ())
    late = Trajectory(drive.stamps_ns[3:], drive.T_world_imu[:-3])
    assert set(go_through(drive, planner(drive, late))[2:-3]) == {None}
    assert set(go_through(drive, Spoilt(planner(drive), spoil(a_fifth_farther)))) == {None}


def test_an_estimate_that_wanders_at_standstill_contradicts_nothing() -> None:
    rng = np.random.default_rng(0)
    walk = np.cumsum(0.002 * rng.standard_normal((80, 3)), axis=0)
    T = np.tile(np.eye(4), (80, 1, 1))
    plan = Trajectory(stamps(80), T.copy())
    T[:, :3, 3] = walk
    T[:, :3, :3] = so3.exp(0.1 * walk)
    drive = Trajectory(stamps(80), T)
    assert set(go_through(drive, planner(drive, plan))) == {None}


def contradicted(broken: range, again: range = range(0)) -> BoolArray:
    """Whether each image's priors are, if those of some images are broken."""
    drive = arc(stamps(160))
    number = iter(range(1, 160))

    def for_a_while(ahead: PriorPoses) -> PriorPoses:
        index = next(number)
        return spoil(twice_as_far)(ahead) if index in broken or index in again else ahead

    kinds = go_through(drive, Spoilt(planner(drive), for_a_while))
    return np.array([False] + [kind == CONTRADICTED for kind in kinds])


def test_priors_are_believed_again_after_ten_agreeing_looks() -> None:
    """Broken for 40 images: one stretch, no flipping, and an end to it."""
    flags = contradicted(range(40, 80))
    changes = np.flatnonzero(np.diff(flags)) + 1
    assert len(changes) == 2
    # The first broken ones are looked back at ten images later; the last are not until ten
    # images after them, stay among the ten looks for up to ten more, and then ten must agree.
    assert 50 <= changes[0] <= 60
    assert 95 <= changes[1] <= 110


def test_the_second_time_ten_looks_must_agree_as_well() -> None:
    once = contradicted(range(40, 80))
    twice = contradicted(range(30, 50), range(56, 80))
    assert np.flatnonzero(twice)[-1] == np.flatnonzero(once)[-1]


def test_it_can_be_switched_off() -> None:
    drive = arc(stamps(80))
    broken = Spoilt(planner(drive), spoil(turned_about))
    assert set(go_through(drive, broken, PriorsConfig(check=False))) == {None}


def test_thresholds_are_the_configurations() -> None:
    drive = arc(stamps(80))
    broken = Spoilt(planner(drive), spoil(twice_as_far))
    lenient = PriorsConfig(max_deviation=0.9, max_noise=50.0)
    assert set(go_through(drive, broken, lenient)) == {None}
    slight = Spoilt(planner(drive), spoil(a_fifth_farther))
    assert set(go_through(drive, slight)) == {None}
    kinds = go_through(drive, slight, PriorsConfig(max_deviation=0.1))
    assert set(kinds[LATEST_VERDICT:78]) == {CONTRADICTED}
