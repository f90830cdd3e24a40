"""Tracking by matching descriptors: the front end's second way of associating features."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from scipy.spatial import cKDTree

from p2gd_fgo.frontend.tracker import Flow
from p2gd_fgo.types import FloatArray, Image, IntArray

_PATCH_PX = 31
_CANDIDATE_SHARE = 0.7  # of the detector's threshold: what just passed it may just fail it next
_FIRST_HAMMING = 100  # of 256 bits, before the position is refined; unrelated patches differ in 128
_SAME_CORNER_PX = 5.0  # FAST marks one corner in several places: no rivals in the ratio test
_REACH_PX = 3  # of the refinement
_SIDE = 2 * _REACH_PX + 1
_STEPS = np.indices((_SIDE, _SIDE)).reshape(2, -1)[::-1].T - _REACH_PX
_INDEX_BITS = 32


class OrbTracker:
    """Matches points to the FAST corners of the next image by their ORB descriptors.

    The descriptors (Rublee et al., ICCV 2011) are upright and of one scale: from one image to the
    next a camera hardly rolls and scale hardly changes. A match is brought to the place around
    its corner where the descriptor fits best, below the pixel by a parabola: that drifts less
    than corners found anew.

    Parameters
    ----------
    fast_threshold
        Grey levels of the FAST test that finds features; candidates need less.
    search_px
        Greatest distance between a candidate and the place where the search starts.
    max_hamming
        Bits, of 256, in which the descriptors of a match may differ.
    ratio
        The best candidate must differ in less than this share of the second best's bits.
    """

    def __init__(
        self, fast_threshold: int, *, search_px: float, max_hamming: int, ratio: float
    ) -> None:
        threshold = max(1, round(_CANDIDATE_SHARE * fast_threshold))
        self._fast = cv2.FastFeatureDetector.create(threshold, nonmaxSuppression=True)
        # An edge threshold of 0 describes every point, at the image's edge by mirroring.
        self._orb = cv2.ORB.create(nlevels=1, edgeThreshold=0, patchSize=_PATCH_PX)
        self._search_px = search_px
        self._max_hamming = max_hamming
        self._ratio = ratio

    def track(
        self, previous: Image, current: Image, pixels: FloatArray, guess: FloatArray | None
    ) -> Flow:
        """Find pixels (N, 2) of the previous image in the current one.

        ``guess`` (N, 2): the middle of the search; None searches around where the points were.
        A point is found if a candidate passes the Hamming limit and the ratio test, and
        consistent if no other point resembles that candidate more.
        """
        count = len(pixels)
        there, found = pixels.copy(), np.zeros(count, np.bool_)
        keypoints = self._fast.detect(current) if count else ()
        if not keypoints:
            return Flow(there, found, found)
        corners = np.asarray(cv2.KeyPoint.convert(keypoints), dtype=np.float64)
        wanted = self._described(previous, pixels)
        point, corner = self._pairs(pixels if guess is None else guess, corners)
        distance = _hamming(wanted[point], self._described(current, corners)[corner])
        best, least = _least_by_group(point, corner, distance, count)
        rival = np.linalg.norm(corners[corner] - corners[best[point]], axis=1) > _SAME_CORNER_PX
        _, second = _least_by_group(point[rival], corner[rival], distance[rival], count)
        owner, _ = _least_by_group(corner, point, distance, len(corners))
        matched = np.flatnonzero((least <= _FIRST_HAMMING) & (least < self._ratio * second))
        offset, differing = self._offset(current, wanted[matched], corners[best[matched]])
        # What the descriptor compares are patches around whole pixels.
        fraction = pixels[matched] - np.rint(pixels[matched])
        there[matched] = corners[best[matched]] + offset + fraction
        found[matched] = differing <= self._max_hamming
        return Flow(there, found, found & (owner[best] == np.arange(count)))

    def _pairs(self, middle: FloatArray, corners: FloatArray) -> tuple[IntArray, IntArray]:
        """Indices (P,) of points and corners within the search radius of each other."""
        pairs = cKDTree(middle).sparse_distance_matrix(
            cKDTree(corners), self._search_px, output_type="ndarray"
        )
        return pairs["i"].astype(np.int64), pairs["j"].astype(np.int64)

    def _described(self, image: Image, pixels: FloatArray) -> IntArray:
        """Descriptors (N, 4) of 64 bits a column."""
        if len(pixels) == 0:
            return np.zeros((0, 4), np.int64)
        points: Any = pixels.astype(np.float32)  # the stub knows only lists of lists
        keypoints = cv2.KeyPoint.convert(points, size=_PATCH_PX)
        _, bits = self._orb.compute(image, keypoints)
        return np.ascontiguousarray(bits).view(np.int64)

    def _offset(
        self, image: Image, wanted: IntArray, corners: FloatArray
    ) -> tuple[FloatArray, IntArray]:
        """Way (N, 2) from corners to the best fit around them, and the bits (N,) that differ."""
        height, width = image.shape
        places = (corners[:, None] + _STEPS).reshape(-1, 2)
        places = np.clip(places, 0.0, [width - 1.0, height - 1.0])
        bits = _hamming(np.repeat(wanted, len(_STEPS), axis=0), self._described(image, places))
        bits = bits.reshape(-1, len(_STEPS))
        best = bits.argmin(axis=1)
        rows = np.arange(len(corners))
        table = np.pad(bits.reshape(-1, _SIDE, _SIDE), ((0, 0), (1, 1), (1, 1)), mode="edge")
        y, x = np.divmod(best, _SIDE)
        below_pixel = [
            _vertex(table[rows, y + 1, x], table[rows, y + 1, x + 1], table[rows, y + 1, x + 2]),
            _vertex(table[rows, y, x + 1], table[rows, y + 1, x + 1], table[rows, y + 2, x + 1]),
        ]
        return _STEPS[best] + np.column_stack(below_pixel), bits[rows, best]


def _hamming(a: IntArray, b: IntArray) -> IntArray:
    """Differing bits (N,) of rows (N, 4)."""
    return np.asarray(np.bitwise_count((a ^ b).view(np.uint64)).sum(axis=1, dtype=np.int64))


def _least_by_group(
    group: IntArray, member: IntArray, distance: IntArray, groups: int
) -> tuple[IntArray, FloatArray]:
    """Member (groups,) with the least distance in each group, and that distance.

    Of equals the smallest index; 0 and infinity for a group without members.
    """
    key = np.full(groups, np.iinfo(np.int64).max)
    np.minimum.at(key, group, (distance << _INDEX_BITS) | member)
    empty = key == np.iinfo(np.int64).max
    best = np.where(empty, 0, key & ((1 << _INDEX_BITS) - 1))
    return best, np.where(empty, np.inf, key >> _INDEX_BITS)


def _vertex(left: IntArray, middle: IntArray, right: IntArray) -> FloatArray:
    """Where the parabola through values at -1, 0, 1 is least, 0 where the least is at the rim."""
    bend = left - 2 * middle + right
    inner = (left > middle) | (right > middle)
    return np.where(inner & (bend > 0), 0.5 * (left - right) / np.maximum(bend, 1), 0.0)
