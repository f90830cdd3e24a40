"""Routes of a car and of a wheeled robot: seeded, with turns, stops and suspension motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray

_STEP_S = 0.01
_KNOT_STEPS = 5  # knots at 20 Hz carry the 3 Hz of the suspension


@dataclass(frozen=True, slots=True)
class VehicleModel:
    """What a vehicle can do, and how it shakes.

    Attributes
    ----------
    speed, turn_speed
        m/s on the straight and in turns.
    turn_rate
        rad/s in turns, at most.
    acceleration, yaw_acceleration
        m/s² and rad/s², at most.
    straight_s
        Shortest and longest straight stretch.
    shake_m, shake_rad
        Amplitude of the vertical and of the roll and pitch motion at full speed.
    """

    speed: tuple[float, float]
    turn_speed: float
    turn_rate: float
    acceleration: float
    yaw_acceleration: float
    straight_s: tuple[float, float]
    shake_m: float
    shake_rad: float


CAR = VehicleModel((7.0, 12.0), 6.0, 0.45, 1.8, 0.6, (3.0, 9.0), 0.015, 0.008)
ROBOT = VehicleModel((0.8, 1.5), 1.0, 0.35, 0.8, 1.0, (3.0, 8.0), 0.004, 0.008)


def make_route(
    model: VehicleModel,
    duration_s: float,
    rng: np.random.Generator,
    *,
    stops_s: tuple[tuple[float, float], ...] = (),
    start_ns: int = NANOSECONDS,
) -> SplineTrajectory:
    """A random drive: straights and turns of 30 to 100 degrees either way.

    Parameters
    ----------
    model
        ``CAR`` or ``ROBOT``.
    stops_s
        (begin, end) of full standstills, seconds after the start; the vehicle brakes before.
    start_ns
        Stamp of the start of the route.

    Returns
    -------
    Trajectory of the body (x forward, y left, z up), from 0.5 s before the start to 0.5 s after the
    end so that samples may straddle the ends; it starts at the origin, heading along x.
    """
    time = np.arange(-0.5, duration_s + 0.5 + _STEP_S / 2, _STEP_S)
    speed, yaw_rate = _commands(model, time, rng)
    for begin, end in stops_s:
        # Brake ahead of the stop, so that the filters below can't smear motion into it.
        lead = model.speed[1] / model.acceleration + 1.0
        speed[(time > begin - lead) & (time < end + 0.5)] = 0.0
        yaw_rate[(time > begin - 1.5) & (time < end + 0.5)] = 0.0
    speed = _smooth(_limit_rate(speed, model.acceleration))
    yaw_rate = _smooth(_limit_rate(yaw_rate, model.yaw_acceleration)) * np.clip(
        speed / (0.3 * model.turn_speed), 0.0, 1.0
    )
    yaw = np.cumsum(yaw_rate) * _STEP_S
    x = np.cumsum(speed * np.cos(yaw)) * _STEP_S
    y = np.cumsum(speed * np.sin(yaw)) * _STEP_S
    z, roll, pitch = _shake(model, time, speed / model.speed[1], rng)
    origin = round(0.5 / _STEP_S)
    positions = np.stack([x - x[origin], y - y[origin], z], -1)
    rotations = Rotation.from_euler("ZYX", np.stack([yaw - yaw[origin], pitch, roll], -1))
    knots = slice(0, None, _KNOT_STEPS)
    stamps: IntArray = start_ns + np.round(time[knots] * NANOSECONDS).astype(np.int64)
    return SplineTrajectory(stamps, positions[knots], np.asarray(rotations.as_matrix())[knots])


def _commands(
    model: VehicleModel, time: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    speed = np.zeros_like(time)
    yaw_rate = np.zeros_like(time)
    t = float(time[0])
    turn = False
    while t < time[-1]:
        if turn:
            rate = model.turn_rate * rng.uniform(0.6, 1.0)
            span = np.radians(rng.uniform(30.0, 100.0)) / rate
            rate *= rng.choice([-1.0, 1.0])
            v = model.turn_speed * rng.uniform(0.8, 1.1)
        else:
            span, rate, v = rng.uniform(*model.straight_s), 0.0, rng.uniform(*model.speed)
        part = (time >= t) & (time < t + span)
        speed[part], yaw_rate[part] = v, rate
        t += span
        turn = not turn
    return speed, yaw_rate


def _limit_rate(command: FloatArray, limit: float) -> FloatArray:
    out = command.copy()
    step = limit * _STEP_S
    for k in range(1, len(out)):
        out[k] = out[k - 1] + np.clip(command[k] - out[k - 1], -step, step)
    return out


def _smooth(values: FloatArray, width_s: float = 0.5) -> FloatArray:
    n = round(width_s / _STEP_S) | 1
    window = np.hanning(n + 2)[1:-1]
    padded = np.pad(values, n // 2, mode="edge")
    return np.convolve(padded, window / window.sum(), mode="valid")


def _shake(
    model: VehicleModel, time: FloatArray, level: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vertical, roll and pitch motion: five sines of 0.7 to 3 Hz each, quiet at standstill."""
    rows = []
    for amplitude in (model.shake_m, model.shake_rad, model.shake_rad):
        frequency = rng.uniform(0.7, 3.0, 5)
        phase = rng.uniform(0.0, 2.0 * np.pi, 5)
        weight = rng.dirichlet(np.ones(5))
        waves = np.sin(2.0 * np.pi * frequency * time[:, None] + phase)
        rows.append(amplitude * np.clip(level, 0.0, 1.0) * (waves @ weight))
    return rows[0], rows[1], rows[2]
