"""Drive a vehicle along a way: speed within its limits, stops, suspension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from p2gd_fgo.simulation.scenario import VehicleScenario
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray

_STEP_S = 0.01
_KNOT_STEPS = 5  # knots at 20 Hz carry the 3 Hz of the suspension
_MARGIN_S = 0.5
_JERK_S = 0.6  # over which a change of the acceleration is spread
_LEAN_S = 0.25  # 1 sigma of the suspension's answer


@dataclass(frozen=True, slots=True)
class _Suspension:
    """Lean in rad per m/s², and amplitude of heave (m) and of roll and pitch (rad) at speed."""

    roll: float
    pitch: float
    heave_m: float
    shake_rad: float


_SUSPENSIONS = {
    "car": _Suspension(0.008, 0.006, 0.015, 0.006),
    "robot": _Suspension(0.002, 0.004, 0.003, 0.006),
}


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A trajectory of the IMU and what the vehicle did on its way.

    Attributes
    ----------
    trajectory
        From 0.5 s before the start to 0.5 s after the end.
    times_s, arc_m
        (K,) seconds since the start and metres along ``way``.
    way
        (P, 2) points every 0.25 m, further than the vehicle comes.
    """

    trajectory: SplineTrajectory
    times_s: FloatArray
    arc_m: FloatArray
    way: FloatArray

    def way_at(self, arc_m: FloatArray) -> FloatArray:
        """x, y, yaw (K, 3) at places along the way, yaw without jumps."""
        return along_way(self.way, arc_m)


def arc_lengths(way: FloatArray) -> FloatArray:
    """Way (P,) from the first to every point of a line (P, 2)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])


def along_way(way: FloatArray, arc_m: FloatArray) -> FloatArray:
    """x, y, yaw (K, 3) at arc lengths (K,) of a way (P, 2), held at its ends."""
    arc = arc_lengths(way)
    tangent = np.gradient(way, arc, axis=0)
    yaw = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    columns = [np.interp(arc_m, arc, c) for c in (way[:, 0], way[:, 1], yaw)]
    return np.column_stack(columns)


def drive(
    way: FloatArray,
    vehicle: VehicleScenario,
    duration_s: float,
    rng: np.random.Generator,
    start_ns: int,
) -> Drive:
    """Drive along a way (P, 2), every 0.25 m a point, for duration_s.

    The body (x forward, y left, z up) starts on the first point; z is 0 there.
    """
    arc = arc_lengths(way)
    tangent = np.gradient(way, arc, axis=0)
    curvature = np.gradient(np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0])), arc)
    time = np.arange(-_MARGIN_S, duration_s + _MARGIN_S + _STEP_S / 2, _STEP_S)
    limit = _limits(arc, curvature, vehicle, rng)
    stops = _stops(arc[-1], vehicle, rng)
    speed = _speed(time, arc, limit, stops, vehicle, rng)
    n = round(_JERK_S / _STEP_S) | 1
    window = np.hanning(n + 2)[1:-1]
    speed = np.convolve(np.pad(speed, n // 2, mode="edge"), window / window.sum(), mode="valid")
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * _STEP_S])
    place = along_way(way, travelled)
    acceleration = np.gradient(speed, _STEP_S)
    aside = speed**2 * np.interp(travelled, arc, curvature)
    susp = _SUSPENSIONS[vehicle.kind]
    level = np.clip(speed / vehicle.speed[1], 0.0, 1.0)
    waves = [vehicle.sway * level * _waves(time, rng) for _ in range(3)]
    lean = vehicle.sway * gaussian_filter1d(
        np.stack([susp.roll * aside, -susp.pitch * acceleration]), _LEAN_S / _STEP_S, mode="nearest"
    )
    z = susp.heave_m * waves[0]
    roll, pitch = lean[0] + susp.shake_rad * waves[1], lean[1] + susp.shake_rad * waves[2]
    rotations = Rotation.from_euler("ZYX", np.stack([place[:, 2], pitch, roll], -1)).as_matrix()
    positions = np.column_stack([place[:, :2], z])
    knots = slice(0, None, _KNOT_STEPS)
    stamps: IntArray = start_ns + np.round(time[knots] * NANOSECONDS).astype(np.int64)
    trajectory = SplineTrajectory(stamps, positions[knots], np.asarray(rotations)[knots])
    return Drive(trajectory, time, travelled, way)


def _limits(
    arc: FloatArray, curvature: FloatArray, vehicle: VehicleScenario, rng: np.random.Generator
) -> FloatArray:
    """Speed (P,) that the turns and the driver's mood allow."""
    kappa = np.maximum(np.abs(curvature), 1e-6)
    limit = np.sqrt(vehicle.lateral_acceleration / kappa)
    limit = np.minimum(limit, np.radians(vehicle.turn_rate_deg) / kappa)
    pieces = np.arange(0.0, arc[-1] + 60.0, 40.0 if vehicle.kind == "car" else 8.0)
    wanted = rng.uniform(*vehicle.speed, len(pieces))
    limit = np.minimum(limit, np.interp(arc, pieces, wanted))
    for k in range(len(arc) - 2, -1, -1):  # brake in time
        ahead = np.sqrt(limit[k + 1] ** 2 + 2.0 * vehicle.acceleration * (arc[k + 1] - arc[k]))
        limit[k] = min(limit[k], ahead)
    return np.asarray(limit)


def _stops(
    length_m: float, vehicle: VehicleScenario, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Where it stops, m along the way, and for how long, s."""
    out = [(0.0, vehicle.standstill_s)]
    if vehicle.stop_every_m is None:
        return out
    at = 0.0
    while True:
        at += vehicle.stop_every_m * float(rng.uniform(0.5, 1.5))
        if at > length_m:
            return out
        out.append((at, float(rng.uniform(*vehicle.stop_s))))


def _speed(
    time: FloatArray,
    arc: FloatArray,
    limit: FloatArray,
    stops: list[tuple[float, float]],
    vehicle: VehicleScenario,
    rng: np.random.Generator,
) -> FloatArray:
    """Speed (K,) over time, before it is smoothed."""
    speed = np.zeros_like(time)
    s = v = 0.0
    waiting = stops[0][1] + _MARGIN_S + 0.5 * _JERK_S if stops[0][1] > 0.0 else 0.0
    following = 1
    if stops[0][1] == 0.0:
        v = float(min(limit[0], vehicle.speed[0]))
    for k in range(len(time)):
        if waiting > 0.0:
            waiting -= _STEP_S
            continue
        target = float(np.interp(s, arc, limit))
        if following < len(stops):
            left = stops[following][0] - s
            target = min(target, float(np.sqrt(2.0 * vehicle.acceleration * max(left, 0.0))))
            if left < 0.02 or (left < 0.3 and target < 0.15):
                v, waiting = 0.0, stops[following][1] + _JERK_S
                following += 1
                continue
        change = vehicle.acceleration * _STEP_S
        v += float(np.clip(max(target, 0.05) - v, -3.0 * change, change))
        s += v * _STEP_S
        speed[k] = v
    return speed


def _waves(time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Sum of five sines of 0.7 to 3 Hz, at most 1."""
    frequency = rng.uniform(0.7, 3.0, 5)
    phase = rng.uniform(0.0, 2.0 * np.pi, 5)
    weight = rng.dirichlet(np.ones(5))
    return np.asarray(np.sin(2.0 * np.pi * frequency * time[:, None] + phase) @ weight)
