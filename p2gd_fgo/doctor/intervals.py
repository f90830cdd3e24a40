"""The gyro's integral over any interval, and rotations over intervals that something else measured.

Intervals are short enough that the integral of the rate is its rotation vector (second-order terms
are below 1e-3 of it), so one cumulative sum of the gyro serves all hypotheses and offsets in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray, ImuBatch, IntArray


class GyroIntegral:
    """Cumulative integral of the gyro, asked for the rotation vector over any interval."""

    def __init__(self, imu: ImuBatch, max_gap_s: float) -> None:
        self.origin_ns = int(imu.stamps_ns[0])
        self._t = (imu.stamps_ns - self.origin_ns) / NANOSECONDS
        dt = np.diff(self._t)
        self._gyro = imu.gyro
        rise = 0.5 * (imu.gyro[1:] + imu.gyro[:-1]) * dt[:, None]
        self._sum = np.concatenate([np.zeros((1, 3)), np.cumsum(rise, axis=0)])
        self._holes = np.concatenate([[0], np.cumsum(dt > max_gap_s)])

    def seconds(self, stamps_ns: IntArray) -> FloatArray:
        """Stamps (N,) as seconds since the first sample."""
        return np.asarray((stamps_ns - self.origin_ns) / NANOSECONDS)

    def rotation(self, begin_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """Integral (..., 3) of the rate from begin to end."""
        return self._at(end_s, self._sum) - self._at(begin_s, self._sum)

    def rate_change(self, begin_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """Rate (..., 3) at the end less the one at the beginning."""
        return self._at(end_s, self._gyro) - self._at(begin_s, self._gyro)

    def covered(self, begin_s: FloatArray, end_s: FloatArray) -> BoolArray:
        """Whether the interval lies in the IMU's time and holds no gap."""
        before = np.searchsorted(self._t, begin_s, side="right") - 1
        after = np.searchsorted(self._t, end_s, side="left")
        inside = (before >= 0) & (after < len(self._t))
        last = len(self._t) - 1
        holes = self._holes[np.clip(after, 0, last)] - self._holes[np.clip(before, 0, last)]
        return np.asarray(inside & (holes == 0))

    def _at(self, t: FloatArray, values: FloatArray) -> FloatArray:
        return np.stack([np.interp(t, self._t, values[:, i]) for i in range(3)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Rotations measured without the gyro.

    Attributes
    ----------
    begin_s, end_s
        (N,) on the scale of :meth:`GyroIntegral.seconds`.
    phi
        (N, 3) rotation vectors in the measuring sensor's axes, rad.
    stretch
        (N,) number of the stretch that an interval belongs to; errors are correlated within one.
    """

    begin_s: FloatArray
    end_s: FloatArray
    phi: FloatArray
    stretch: IntArray

    def __len__(self) -> int:
        return len(self.phi)

    def subset(self, keep: BoolArray) -> Intervals:
        """The intervals where ``keep`` (N,)."""
        return Intervals(self.begin_s[keep], self.end_s[keep], self.phi[keep], self.stretch[keep])
