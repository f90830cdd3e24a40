"""The tracks of the newest image, and those that are due for an update.

A track is due when it was lost, when the oldest image of a full window saw it, or when it bridges a
long gap between images. It leaves whole; seen again, it begins anew. So each observation is used
once at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, IntArray, Observations


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """O sightings of M tracks in one flat list, track after track, oldest first in each.

    Attributes
    ----------
    normalized
        (O, 2) undistorted.
    view
        (O,) position of the image in the window.
    track
        (O,) position of the track, 0 to M − 1.
    starts, lengths
        (M,) where each track begins in the list, and how many sightings it has.
    """

    normalized: FloatArray
    view: IntArray
    track: IntArray
    starts: IntArray
    lengths: IntArray

    def __len__(self) -> int:
        return len(self.lengths)

    @classmethod
    def of_table(cls, normalized: FloatArray, first: IntArray, end: int) -> Sightings:
        """Tracks (M, columns, 2) that were seen from column ``first`` (M,) up to ``end``."""
        columns = np.arange(normalized.shape[1])
        seen = (columns >= first[:, None]) & (columns < end)
        track, view = np.nonzero(seen)
        return cls._made(normalized[track, view], view, end - first)

    @classmethod
    def _made(cls, normalized: FloatArray, view: IntArray, lengths: IntArray) -> Sightings:
        ends = np.cumsum(lengths)
        track = np.repeat(np.arange(len(lengths)), lengths)
        return cls(normalized, view, track, ends - lengths, lengths)

    def select(self, keep: BoolArray) -> Sightings:
        """The tracks where ``keep`` (M,) is set."""
        if keep.all():
            return self
        rows = keep[self.track]
        return self._made(self.normalized[rows], self.view[rows], self.lengths[keep])

    def with_others(self, others: Sightings) -> Sightings:
        """These tracks, then the others."""
        return self._made(
            np.concatenate([self.normalized, others.normalized]),
            np.concatenate([self.view, others.view]),
            np.concatenate([self.lengths, others.lengths]),
        )


class TrackTable:
    """Tracks that the newest image saw: one row each, one column for each image of the window."""

    def __init__(self, window: int) -> None:
        self._window = window
        self._ids = np.zeros(0, dtype=np.int64)
        self._first = np.zeros(0, dtype=np.int64)
        self._normalized = np.zeros((0, window, 2))

    def add(self, observations: Observations, column: int) -> Sightings:
        """Enter an image, whose place in the window is ``column``; returns the tracks lost."""
        n = len(observations)
        order = np.argsort(observations.ids)
        ids = observations.ids[order]
        place = np.minimum(np.searchsorted(ids, self._ids), max(n - 1, 0))
        seen = ids[place] == self._ids if n else np.zeros(len(self._ids), dtype=bool)
        lost = self._take(~seen, column)
        first = np.full(n, column, dtype=np.int64)
        normalized = np.zeros((n, self._window, 2))
        rows = place[seen]
        first[rows] = self._first
        normalized[rows] = self._normalized
        normalized[:, column] = observations.normalized[order]
        self._ids, self._first, self._normalized = ids, first, normalized
        return lost

    def held(self, end: int) -> Sightings:
        """All tracks, which stay; ``end`` is the place after their last image."""
        return Sightings.of_table(self._normalized, self._first, end)

    def take_all(self, end: int) -> Sightings:
        """Remove and return all tracks; ``end`` is the place after their last image."""
        return self._take(np.ones(len(self._ids), dtype=bool), end)

    def take_seen_by_oldest(self, end: int) -> Sightings:
        """Remove and return the tracks that the window's oldest image saw."""
        return self._take(self._first == 0, end)

    def take_older(self, end: int) -> Sightings:
        """Remove and return the tracks that an image before the newest saw, too."""
        return self._take(self._first < end - 1, end)

    def drop_oldest(self) -> None:
        """The window has lost its oldest image, which no track here has seen."""
        self._first = self._first - 1
        self._normalized = np.roll(self._normalized, -1, axis=1)

    def observations(self, end: int) -> int:
        """Sightings held."""
        return int((end - self._first).sum())

    def _take(self, which: BoolArray, end: int) -> Sightings:
        taken = Sightings.of_table(self._normalized[which], self._first[which], end)
        keep = ~which
        self._ids, self._first = self._ids[keep], self._first[keep]
        self._normalized = self._normalized[keep]
        return taken
