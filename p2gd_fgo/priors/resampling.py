"""Interpolation that never bridges a hole."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.geometry.pose import interpolation_weights
from p2gd_fgo.priors.screw import interpolate_screws
from p2gd_fgo.types import NANOSECONDS, BoolArray, IntArray, PriorPoses, Trajectory

LONGEST_HOLE_S = 1.0
"""What a planner means between poses farther apart than this is not known."""


def covered(stamps_ns: IntArray, query_ns: IntArray) -> BoolArray:
    """Which of ``query_ns`` (M,) lie on a stamp, or between two at most ``LONGEST_HOLE_S`` apart.

    ``stamps_ns`` (N,) strictly increasing, N ≥ 1.
    """
    i, j, _ = interpolation_weights(stamps_ns, query_ns)
    before, after = stamps_ns[i], stamps_ns[j]
    between = (before <= query_ns) & (query_ns <= after)
    near = after - before <= LONGEST_HOLE_S * NANOSECONDS
    return np.asarray((between & near) | (before == query_ns) | (after == query_ns))


def at_stamps(trajectory: Trajectory, stamps_ns: IntArray) -> Trajectory:
    """The trajectory at those of ``stamps_ns`` that it covers."""
    kept = stamps_ns[covered(trajectory.stamps_ns, stamps_ns)]
    return Trajectory(kept, interpolate_screws(trajectory, kept))


def resample(priors: PriorPoses, stamp_ns: int, times_ns: IntArray) -> PriorPoses:
    """Prior poses at ``times_ns`` (M,), up to the first of them that is not covered.

    The path begins with the identity at ``stamp_ns``; poses handed in for that time or before it
    are passed over.
    """
    first = int(np.searchsorted(priors.stamps_ns, stamp_ns, side="right"))
    path = Trajectory(
        np.append(np.int64(stamp_ns), priors.stamps_ns[first:]),
        np.concatenate([np.eye(4)[None], priors.T_imu0_imu[first:]]),
    )
    reached = times_ns[: leading(covered(path.stamps_ns, times_ns))]
    return PriorPoses(reached, interpolate_screws(path, reached))


def leading(flags: BoolArray) -> int:
    """How many of the flags are true before the first that is not."""
    return len(flags) if flags.all() else int(np.argmin(flags))
