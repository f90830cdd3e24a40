"""When the next images will come."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.types import IntArray, Trajectory


class ImageTimes:
    """Stamps of the images that follow one.

    Parameters
    ----------
    stamps_ns
        All images of a recording, increasing, on the IMU's clock; None online, where the median
        interval of the recent images is continued.
    """

    def __init__(self, stamps_ns: IntArray | None = None) -> None:
        self._stamps_ns = stamps_ns

    def after(self, stamp_ns: int, recent: Trajectory, count: int) -> IntArray | None:
        """Stamps (N,) of the next images: ``count``, or as many as the recording still has.

        None where neither a recording nor two ``recent`` images say when they come.
        """
        if self._stamps_ns is not None:
            first = int(np.searchsorted(self._stamps_ns, stamp_ns, side="right"))
            return self._stamps_ns[first : first + count]
        if len(recent) < 2:
            return None
        interval_ns = round(float(np.median(np.diff(recent.stamps_ns))))
        return stamp_ns + interval_ns * np.arange(1, count + 1)
