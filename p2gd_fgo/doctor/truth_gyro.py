"""The truth's rotation against the gyro's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.doctor.axes import all_axes
from p2gd_fgo.doctor.intervals import GyroIntegral, Intervals
from p2gd_fgo.doctor.matching import Hypothesis, Match, match
from p2gd_fgo.doctor.rotation_fit import RotationFit
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import MAX_TRUTH_GAP_S
from p2gd_fgo.types import FloatArray, Trajectory

_INTERVAL_S = 0.1
_STRETCH = 20
_COUNT = 1500


@dataclass(frozen=True, slots=True, eq=False)
class TruthMatch:
    """How the truth's rotation goes with the gyro's.

    Attributes
    ----------
    match
        The best hypothesis; its M takes the gyro's axes to the truth's body axes.
    inverted
        Whether that is of the truth's quaternions inverted (body from world).
    phi
        (N, 3) the rotations that were compared, rad.
    length_s
        Length of the intervals.
    """

    match: Match
    inverted: bool
    phi: FloatArray
    length_s: float


def match_truth(trajectory: Trajectory, gyro: GyroIntegral) -> TruthMatch | None:
    """Compare increments of the truth with the gyro; None where there are too few."""
    plain = _intervals(trajectory, gyro, inverted=False)
    if plain is None:
        return None
    fitter = RotationFit(gyro, plain, 0.0)
    if not fitter.enough:
        return None
    alternatives = [Hypothesis("axes", axes.matrix, axes.changes, axes) for axes in all_axes()[1:]]
    best = match(fitter, np.eye(3), alternatives)
    if best.hypothesis.kind != "expected" or not best.explains:
        other = _intervals(trajectory, gyro, inverted=True)
        assert other is not None
        turned = RotationFit(gyro, other, 0.0)
        again = match(turned, np.eye(3), ())
        if (
            again.explains
            and again.hypothesis.kind == "expected"
            and (again.fit.explained > best.fit.explained)
        ):
            return _made(again, turned, inverted=True)
    return _made(best, fitter, inverted=False)


def _made(found: Match, fitter: RotationFit, *, inverted: bool) -> TruthMatch:
    intervals = fitter.intervals
    length_s = float(np.median(intervals.end_s - intervals.begin_s))
    return TruthMatch(found, inverted, intervals.phi, length_s)


def _intervals(trajectory: Trajectory, gyro: GyroIntegral, *, inverted: bool) -> Intervals | None:
    t = gyro.seconds(trajectory.stamps_ns)
    if len(t) < 3:
        return None
    step = max(1, round(_INTERVAL_S / float(np.median(np.diff(t)))))
    begin = np.arange(0, len(t) - step, step)
    end = begin + step
    whole = t[end] - t[begin] < MAX_TRUTH_GAP_S
    begin, end = begin[whole], end[whole]
    stretch = np.arange(len(begin)) // _STRETCH
    if len(begin) > _COUNT:  # whole stretches, evenly spread
        every = int(np.ceil(len(begin) / _COUNT))
        kept = stretch % every == 0
        begin, end, stretch = begin[kept], end[kept], stretch[kept]
    R = trajectory.T_world_imu[:, :3, :3]
    if inverted:
        R = np.swapaxes(R, -1, -2)
    phi = so3.log(np.swapaxes(R[begin], -1, -2) @ R[end])
    return Intervals(t[begin], t[end], phi, stretch)
