"""The feature buffer: every feature of the current image with its past, as arrays."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, IntArray


class FeatureBuffer:
    """Features that are visible in the newest image, and where they were in the images before.

    Row i of every array is one feature. The histories have one column per image, the newest last;
    NaN where the feature was not seen. What belongs to the track named ``ids[i]`` is its last
    ``lengths[i]`` columns: after :meth:`rename` the history is longer than the track.

    Parameters
    ----------
    history
        Images remembered, the newest included; also the greatest length of a track.

    Attributes
    ----------
    ids
        (N,) unique; none is used twice in the life of the buffer.
    lengths
        (N,) images in which the track was seen, the newest included.
    pixel_history
        (N, history, 2) in the distorted image.
    normalized_history
        (N, history, 2) undistorted, on the plane z = 1.
    stamps_ns
        (history,) times of the columns; -1 before the first image.
    """

    def __init__(self, history: int) -> None:
        self.history = history
        self.ids: IntArray = np.zeros(0, np.int64)
        self.lengths: IntArray = np.zeros(0, np.int64)
        self.pixel_history: FloatArray = np.zeros((0, history, 2))
        self.normalized_history: FloatArray = np.zeros((0, history, 2))
        self.stamps_ns: IntArray = np.full(history, -1, np.int64)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def pixels(self) -> FloatArray:
        """(N, 2) in the newest image."""
        return np.asarray(self.pixel_history[:, -1])

    @property
    def normalized(self) -> FloatArray:
        """(N, 2) in the newest image, undistorted."""
        return np.asarray(self.normalized_history[:, -1])

    def keep(self, which: BoolArray) -> None:
        """Forget the features whose entry in which (N,) is false."""
        self.ids = self.ids[which]
        self.lengths = self.lengths[which]
        self.pixel_history = self.pixel_history[which]
        self.normalized_history = self.normalized_history[which]

    def rename(self, which: BoolArray) -> None:
        """End the tracks in which (N,): from the next image on, new tracks follow their corners."""
        self.ids = self.ids.copy()
        self.ids[which] = self._new_ids(int(which.sum()))
        self.lengths = np.where(which, 0, self.lengths)

    def advance(self, stamp_ns: int, pixels: FloatArray, normalized: FloatArray) -> None:
        """Take in a new image in which every feature was found: pixels and normalized (N, 2)."""
        self.stamps_ns = np.append(self.stamps_ns[1:], np.int64(stamp_ns))
        self.pixel_history = _shifted(self.pixel_history, pixels)
        self.normalized_history = _shifted(self.normalized_history, normalized)
        self.lengths = self.lengths + 1

    def add(self, pixels: FloatArray, normalized: FloatArray) -> None:
        """Add new features of the newest image: pixels and normalized (M, 2)."""
        count = len(pixels)
        empty = np.full((count, self.history, 2), np.nan)
        self.ids = np.concatenate([self.ids, self._new_ids(count)])
        self.lengths = np.concatenate([self.lengths, np.ones(count, np.int64)])
        self.pixel_history = np.concatenate([self.pixel_history, _shifted(empty, pixels)])
        self.normalized_history = np.concatenate(
            [self.normalized_history, _shifted(empty, normalized)]
        )

    def disparity_px(self, frames: int) -> tuple[float, int]:
        """How far features moved since ``frames`` images ago.

        Returns
        -------
        tuple[float, int]
            Median distance in px over the features seen in both images, and their number;
            NaN and 0 where there are none or the buffer doesn't reach back so far.
        """
        if not 0 < frames < self.history:
            return float("nan"), 0
        distance = np.linalg.norm(self.pixels - self.pixel_history[:, -1 - frames], axis=1)
        distance = distance[np.isfinite(distance)]
        if len(distance) == 0:
            return float("nan"), 0
        return float(np.median(distance)), len(distance)

    def _new_ids(self, count: int) -> IntArray:
        first = self._next_id
        self._next_id += count
        return np.arange(first, self._next_id, dtype=np.int64)


def _shifted(history: FloatArray, newest: FloatArray) -> FloatArray:
    return np.concatenate([history[:, 1:], newest[:, None]], axis=1)
