"""Who else is about: a car ahead, oncoming and crossing cars, people, carts pushed across."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation.driving import Drive, along_way, arc_lengths
from p2gd_fgo.simulation.movers import Mover
from p2gd_fgo.simulation.network import Network
from p2gd_fgo.simulation.palette import Palette
from p2gd_fgo.simulation.scenario import TrafficScenario
from p2gd_fgo.simulation.vehicles import CAR_M, CART_M, PERSON_M, VAN_M, car, cart, person, van
from p2gd_fgo.simulation.world import Surfaces
from p2gd_fgo.types import FloatArray

_STEP_S = 0.1
_TRIES = 12
_LANE_M = 3.2

Size = tuple[float, float, float]


def traffic(
    scenario: TrafficScenario,
    drive: Drive,
    network: Network,
    palette: Palette,
    rng: np.random.Generator,
    ground_z: float,
) -> list[Mover]:
    """Bodies that move along or across the way of the camera's vehicle, and never touch it."""
    end_s = float(drive.times_s[-1])
    made: list[Mover] = []

    def add(
        body: Surfaces, size: Size, times: FloatArray, places: FloatArray, gap_m: float
    ) -> bool:
        inside = (times >= drive.times_s[0]) & (times <= end_s)
        if inside.sum() < 2 or _nearest(drive, times[inside], places[inside], size) < gap_m:
            return False
        made.append(Mover(body, size, times[inside], places[inside], ground_z))
        return True

    if scenario.leading:
        times = np.arange(drive.times_s[0], end_s, _STEP_S)
        arc = np.interp(times, drive.times_s, drive.arc_m)
        speed = np.gradient(arc, times)
        gap = 9.0 + 0.9 * _smooth(speed, round(1.5 / _STEP_S))
        add(car(palette, rng), CAR_M, times, drive.way_at(arc + gap), 2.0)
    for k in range(round(scenario.cars_per_min * end_s / 60.0)):
        large = rng.random() < 0.2
        body = (van if large else car)(palette, rng)
        for _ in range(_TRIES):
            crosses = network.crossings and k % 3 == 2
            times, places = _crossing(drive, network, rng) if crosses else _oncoming(drive, rng)
            if add(body, VAN_M if large else CAR_M, times, places, 2.2):
                break
    for _ in range(scenario.people):
        body = person(palette, rng)
        for _ in range(_TRIES):
            if add(body, PERSON_M, *_stroll(drive, network, rng), 0.9):
                break
    for _ in range(round(scenario.occluders_per_min * end_s / 60.0)):
        body = cart(palette, rng)
        for _ in range(_TRIES):
            if add(body, CART_M, *_across(drive, rng), 0.9):
                break
    return made


def _oncoming(drive: Drive, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """On the other side of the street, against the drive."""
    meet = rng.uniform(drive.times_s[0], drive.times_s[-1])
    here = float(np.interp(meet, drive.times_s, drive.arc_m)) + rng.uniform(0.0, 40.0)
    times = np.arange(meet - 9.0, meet + 9.0, _STEP_S)
    aside = _LANE_M * float(rng.choice([1.0, 1.0, 2.0])) + 0.1
    return times, _beside(drive, here - rng.uniform(7.0, 11.0) * (times - meet), aside, True)


def _stroll(
    drive: Drive, network: Network, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Along the way, beside the wheels' track or on the pavement, either way."""
    meet = rng.uniform(drive.times_s[0], drive.times_s[-1])
    here = float(np.interp(meet, drive.times_s, drive.arc_m)) + rng.uniform(2.0, 14.0)
    times = np.arange(meet - 14.0, meet + 14.0, _STEP_S)
    back = bool(rng.random() < 0.5)
    walk = here + (-1.0 if back else 1.0) * rng.uniform(0.8, 1.5) * (times - meet)
    wide = network.width_m > 6.0
    aside = float(rng.uniform(1.0, 2.6)) + (0.5 * network.width_m if wide else 0.0)
    return times, _beside(drive, walk, float(rng.choice([-1.0, 1.0])) * aside, back)


def _across(drive: Drive, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Straight across, some way before the vehicle."""
    meet = float(rng.uniform(drive.times_s[0] + 2.0, drive.times_s[-1]))
    arc = float(np.interp(meet, drive.times_s, drive.arc_m))
    speed = arc - float(np.interp(meet - 1.0, drive.times_s, drive.arc_m))
    there = drive.way_at(np.array([arc + max(rng.uniform(2.4, 3.6), 1.9 * speed)]))[0]
    times = np.arange(meet - 7.0, meet + 7.0, _STEP_S)
    yaw = there[2] + float(rng.choice([-1.0, 1.0])) * rng.uniform(1.3, 1.85)
    pace = rng.uniform(0.8, 1.2) * (times - meet)
    x, y = there[0] + np.cos(yaw) * pace, there[1] + np.sin(yaw) * pace
    return times, np.column_stack([x, y, np.full(len(times), yaw)])


def _crossing(
    drive: Drive, network: Network, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Straight over a crossing that the vehicle comes to, on the other street."""
    k = int(rng.integers(1, len(network.walk) - 1))
    node = network.nodes[network.walk[k]]
    e = node - network.nodes[network.walk[k - 1]]
    e = e / np.linalg.norm(e)
    gap = np.linalg.norm(drive.way - node, axis=1)
    arc = float(arc_lengths(drive.way)[np.argmin(gap)])
    reached = float(np.interp(arc, drive.arc_m + 1e-9 * drive.times_s, drive.times_s))
    meet = reached + float(rng.choice([-1.0, 1.0])) * rng.uniform(2.0, 7.0)
    sign = float(rng.choice([-1.0, 1.0]))
    direction = sign * np.array([-e[1], e[0]])
    right = np.array([direction[1], -direction[0]])
    times = np.arange(meet - 8.0, meet + 8.0, _STEP_S)
    xy = node + 0.5 * _LANE_M * right + np.outer(rng.uniform(7.0, 11.0) * (times - meet), direction)
    yaw = np.arctan2(direction[1], direction[0])
    return times, np.column_stack([xy, np.full(len(times), yaw)])


def _beside(drive: Drive, arc_m: FloatArray, left_m: float, back: bool) -> FloatArray:
    """x, y, yaw (K, 3) at places to the left of the way, driven forwards or back."""
    ahead = along_way(drive.way, arc_m)
    left = np.column_stack([-np.sin(ahead[:, 2]), np.cos(ahead[:, 2])])
    # Beyond the ends of the way, straight on.
    length = arc_lengths(drive.way)[-1]
    over = arc_m - np.clip(arc_m, 0.0, length)
    forward = np.column_stack([np.cos(ahead[:, 2]), np.sin(ahead[:, 2])])
    xy = ahead[:, :2] + left_m * left + over[:, None] * forward
    return np.column_stack([xy, ahead[:, 2] + (np.pi if back else 0.0)])


def _nearest(drive: Drive, times: FloatArray, places: FloatArray, size: Size) -> float:
    """Least distance between the vehicle's centre line and the body's outline, m."""
    own = drive.way_at(np.interp(times, drive.times_s, drive.arc_m))[:, :2]
    away = own - places[:, :2]
    c, s = np.cos(places[:, 2]), np.sin(places[:, 2])
    along = np.abs(c * away[:, 0] + s * away[:, 1]) - 0.5 * size[0]
    aside = np.abs(c * away[:, 1] - s * away[:, 0]) - 0.5 * size[1]
    return float(np.hypot(np.clip(along, 0.0, None), np.clip(aside, 0.0, None)).min())


def _smooth(values: FloatArray, n: int) -> FloatArray:
    window = np.hanning(2 * n + 3)[1:-1]
    return np.convolve(np.pad(values, n, mode="edge"), window / window.sum(), mode="valid")
