"""The truth's motion against the accelerometer.

Between three poses h apart, the specific force weighted by a triangle is the second difference of
position over h², less gravity: no velocity is needed, and the sensor's noise averages out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.doctor.axes import Axes, all_axes
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray, ImuBatch, IntArray, Trajectory

_H_S = 0.5
_MAX_WINDOWS = 400
_MIN_WINDOWS = 8
_CLEARLY = 0.4  # of the residual that is left by other axes
_COARSE = 1.5  # m/s²: more than bias and a smoothed truth explain


@dataclass(frozen=True, slots=True, eq=False)
class AccelMatch:
    """How the accelerometer goes with the truth.

    Attributes
    ----------
    axes
        The signed permutation that the accelerometer needs; the identity where it needs none.
    tilt_deg
        Angle between what the truth takes as up and the measured gravity.
    residual
        Median size of the difference, m/s², with ``axes``.
    recorded_residual
        The same as recorded.
    """

    axes: Axes
    tilt_deg: float
    residual: float
    recorded_residual: float


def match_accel(
    trajectory: Trajectory, imu: ImuBatch, gravity: float, shift_s: float
) -> AccelMatch | None:
    """Compare; None where truth and IMU share too little.

    Parameters
    ----------
    shift_s
        Truth's time plus this is the IMU's, as the gyro tells.
    """
    shifted = Trajectory(
        trajectory.stamps_ns + round(shift_s * NANOSECONDS), trajectory.T_world_imu
    )
    first = max(int(shifted.stamps_ns[0]), int(imu.stamps_ns[0]))
    last = min(int(shifted.stamps_ns[-1]), int(imu.stamps_ns[-1]))
    h = round(_H_S * NANOSECONDS)
    count = (last - first - 2 * h) // h
    if count < _MIN_WINDOWS:
        return None
    every = max(1, int(np.ceil(count / _MAX_WINDOWS)))
    begin = first + h * np.arange(0, count, every, dtype=np.int64)
    whole = _holds(shifted.stamps_ns, begin, 2 * h) & _holds(imu.stamps_ns, begin, 2 * h)
    begin = begin[whole]
    if len(begin) < _MIN_WINDOWS:
        return None
    p = [interpolate(shifted, begin + k * h)[:, :3, 3] for k in range(3)]
    wanted = (p[2] - 2.0 * p[1] + p[0]) / _H_S**2 + [0.0, 0.0, gravity]
    weights = _weighted_outer(shifted, imu, begin, h)
    axes = all_axes()
    misses = [_miss(weights, choice.matrix, wanted) for choice in axes]
    best = int(np.argmin(misses))
    if misses[best] > min(_COARSE, _CLEARLY * misses[0]):
        best = 0
    measured = np.einsum("nijl,jl->ni", weights, axes[best].matrix)
    up = np.median(measured - wanted, axis=0) + np.array([0.0, 0.0, gravity])
    tilt = np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2]))
    return AccelMatch(axes[best], float(tilt), misses[best], misses[0])


def _miss(weights: FloatArray, matrix: FloatArray, wanted: FloatArray) -> float:
    difference = np.einsum("nijl,jl->ni", weights, matrix) - wanted
    return float(np.median(np.linalg.norm(difference, axis=1)))


def _weighted_outer(
    trajectory: Trajectory, imu: ImuBatch, begin_ns: IntArray, h_ns: int
) -> FloatArray:
    """Triangle-weighted means (W, 3, 3, 3) of R[i, j] a[l] from begin to begin + 2 h."""
    R = interpolate(trajectory, imu.stamps_ns)[:, :3, :3]
    outer = (R[:, :, :, None] * imu.accel[:, None, None, :]).reshape(len(imu), 27)
    t = (imu.stamps_ns - imu.stamps_ns[0]) / NANOSECONDS
    dt = np.diff(t)[:, None]
    once = _cumulative(outer, dt)
    twice = _cumulative(once, dt)
    at = [(begin_ns + k * h_ns - imu.stamps_ns[0]) / NANOSECONDS for k in range(3)]
    P = [np.stack([np.interp(s, t, twice[:, c]) for c in range(27)], axis=1) for s in at]
    return np.asarray(((P[2] - 2.0 * P[1] + P[0]) / _H_S**2).reshape(-1, 3, 3, 3))


def _cumulative(values: FloatArray, dt: FloatArray) -> FloatArray:
    rise = 0.5 * (values[1:] + values[:-1]) * dt
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(rise, axis=0)])


def _holds(stamps_ns: IntArray, begin_ns: IntArray, length_ns: int) -> BoolArray:
    """Which windows are without a hole of more than 0.1 s and ten intervals."""
    steps = np.diff(stamps_ns)
    limit = max(0.1 * NANOSECONDS, 10.0 * float(np.median(steps)))
    holes = np.concatenate([[0], np.cumsum(steps > limit)])
    a = np.searchsorted(stamps_ns, begin_ns, side="right") - 1
    b = np.searchsorted(stamps_ns, begin_ns + length_ns, side="left")
    last = len(stamps_ns) - 1
    return np.asarray(holes[np.clip(b, 0, last)] == holes[np.clip(a, 0, last)])
