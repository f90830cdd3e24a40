"""Poses of the estimate and of the truth at the same stamps."""

from __future__ import annotations

from dataclasses import dataclass

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import MAX_TRUTH_GAP_S, covered, interpolate
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Trajectory

_MIN_POSES = 3


@dataclass(frozen=True, slots=True, eq=False)
class CommonPoses:
    """``stamps_ns`` (N,) and the poses ``estimate`` and ``reference`` (N, 4, 4) at them."""

    stamps_ns: IntArray
    estimate: FloatArray
    reference: FloatArray

    def __len__(self) -> int:
        return len(self.stamps_ns)


def common_poses(estimate: Trajectory, truth: Trajectory) -> CommonPoses:
    """Interpolate the truth to the estimate's stamps.

    Estimates outside the truth's span, or in a hole of it longer than 0.5 s, are left out.

    Raises
    ------
    DataError
        Fewer than 3 poses remain.
    """
    if not len(truth):
        raise DataError("the truth holds no poses, nothing can be compared with it")
    query, known = estimate.stamps_ns, truth.stamps_ns
    keep = covered(truth, query)
    if keep.sum() < _MIN_POSES:
        raise DataError(
            f"only {int(keep.sum())} of {len(estimate)} estimated poses have truth at their time, "
            f"at least {_MIN_POSES} are needed: the estimate spans {_span(query)}, the truth "
            f"{_span(known)} (holes over {MAX_TRUTH_GAP_S} s are not bridged)"
        )
    stamps = query[keep]
    return CommonPoses(stamps, estimate.T_world_imu[keep], interpolate(truth, stamps))


def _span(stamps_ns: IntArray) -> str:
    if not len(stamps_ns):
        return "no time"
    first, last = (f"{stamp / NANOSECONDS:.3f}" for stamp in (stamps_ns[0], stamps_ns[-1]))
    return f"{first} to {last} s"
