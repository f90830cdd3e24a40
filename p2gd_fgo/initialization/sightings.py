"""What the images of the start window saw: the initialiser's own memory of the tracks.

The feature buffer forgets a track with its last image, and reaches back only as far as the back
end's window; a start in motion needs both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray, IntArray

_LEAST_SIGHTINGS = 3  # two say next to nothing about motion, and take any depth


@dataclass(frozen=True, slots=True, eq=False)
class WindowSightings:
    """Tracks in K images of the window, oldest first; the last image brings none.

    Attributes
    ----------
    stamps_ns
        (K,)
    image
        (N,) which image each sighting is in, below K - 1.
    track
        (N,) whose sighting it is, 0 to M - 1, increasing; within a track by image.
    normalized
        (N, 2) undistorted, on the plane z = 1.
    starts
        (M,) first sighting of each track.
    """

    stamps_ns: IntArray
    image: IntArray
    track: IntArray
    normalized: FloatArray
    starts: IntArray

    def __len__(self) -> int:
        return len(self.track)

    @property
    def tracks(self) -> int:
        """M."""
        return len(self.starts)

    def only(self, tracks: BoolArray) -> WindowSightings:
        """With the tracks (M,) that are true."""
        kept = tracks[self.track]
        return _ordered(self.stamps_ns, self.image[kept], self.track[kept], self.normalized[kept])


class SightingStore:
    """Remembers the tracks of the images of the last ``length_s`` seconds."""

    def __init__(self, length_s: float) -> None:
        self._length_ns = round(length_s * NANOSECONDS)
        self._stamps: list[int] = []
        self._ids: list[IntArray] = []
        self._normalized: list[FloatArray] = []

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def oldest_ns(self) -> int:
        """Time of the oldest image held."""
        return self._stamps[0]

    def add(self, stamp_ns: int, buffer: FeatureBuffer) -> None:
        """Take in the buffer's newest image, and let go what is too old."""
        self._stamps.append(stamp_ns)
        self._ids.append(buffer.ids.copy())
        self._normalized.append(np.array(buffer.normalized))
        self.drop_before(stamp_ns - self._length_ns)

    def drop_oldest(self) -> None:
        """Forget one image."""
        del self._stamps[0], self._ids[0], self._normalized[0]

    def drop_before(self, stamp_ns: int) -> None:
        """Forget the images before a time."""
        while self._stamps and self._stamps[0] < stamp_ns:
            self.drop_oldest()

    def window(self, most_images: int) -> WindowSightings:
        """At most so many images, evenly spread, the newest included.

        The newest image's sightings are left out: they are the first that the back end gets.
        """
        count = len(self._stamps)
        spread = np.linspace(0, count - 1, min(most_images, count))
        chosen = np.unique(np.rint(spread).astype(int)).tolist()
        seen = chosen[:-1]
        ids = [self._ids[k] for k in seen]
        image = np.repeat(np.arange(len(seen)), [len(i) for i in ids])
        flat = np.concatenate([np.zeros(0, np.int64), *ids])
        normalized = np.concatenate([np.zeros((0, 2)), *(self._normalized[k] for k in seen)])
        _, track, number = np.unique(flat, return_inverse=True, return_counts=True)
        often = number[track] >= _LEAST_SIGHTINGS
        stamps = np.array([self._stamps[k] for k in chosen], dtype=np.int64)
        return _ordered(stamps, image[often], track[often], normalized[often])


def _ordered(
    stamps_ns: IntArray, image: IntArray, track: IntArray, normalized: FloatArray
) -> WindowSightings:
    order = np.lexsort((image, track))
    _, starts, track = np.unique(track[order], return_index=True, return_inverse=True)
    return WindowSightings(stamps_ns, image[order], track, normalized[order], starts)
