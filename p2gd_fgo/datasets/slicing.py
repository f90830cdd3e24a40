"""Use only a part of a recording."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray, Trajectory, Truth

MARGIN_S = 1.0
"""IMU and truth are kept this long before the first and after the last image."""


def select_images(stamps_ns: IntArray, start_s: float, duration_s: float | None) -> slice:
    """Images from ``start_s`` after the first one on, for ``duration_s`` (None: to the end).

    Raises
    ------
    DataError
        None is left.
    """
    first = int(stamps_ns[0]) + round(start_s * NANOSECONDS)
    begin = int(np.searchsorted(stamps_ns, first, side="left"))
    end = len(stamps_ns)
    if duration_s is not None:
        end = int(np.searchsorted(stamps_ns, first + round(duration_s * NANOSECONDS), side="right"))
    if begin >= end:
        length_s = float(stamps_ns[-1] - stamps_ns[0]) / NANOSECONDS
        wish = f"dataset.start_s = {start_s:g}"
        if duration_s is not None:
            wish += f" with dataset.duration_s = {duration_s:g}"
        raise DataError(f"{wish} leaves no image of a recording of {length_s:.3f} s")
    return slice(begin, end)


def cut_imu(imu: ImuBatch, first_ns: int, last_ns: int) -> ImuBatch:
    """Keep the samples from first_ns to last_ns and a margin on both sides."""
    kept = _around(imu.stamps_ns, first_ns, last_ns)
    return ImuBatch(imu.stamps_ns[kept], imu.gyro[kept], imu.accel[kept])


def cut_truth(truth: Truth, first_ns: int, last_ns: int) -> Truth:
    """Keep the poses from first_ns to last_ns and a margin on both sides."""
    kept = _around(truth.trajectory.stamps_ns, first_ns, last_ns)

    def cut(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else values[kept]

    trajectory = Trajectory(truth.trajectory.stamps_ns[kept], truth.trajectory.T_world_imu[kept])
    return Truth(trajectory, cut(truth.velocity), cut(truth.gyro_bias), cut(truth.accel_bias))


def _around(stamps_ns: IntArray, first_ns: int, last_ns: int) -> slice:
    """Select the span, its margin and one sample beyond on each side."""
    margin = round(MARGIN_S * NANOSECONDS)
    begin = int(np.searchsorted(stamps_ns, first_ns - margin, side="right")) - 1
    end = int(np.searchsorted(stamps_ns, last_ns + margin, side="left")) + 1
    return slice(max(min(begin, len(stamps_ns) - 1), 0), end)
