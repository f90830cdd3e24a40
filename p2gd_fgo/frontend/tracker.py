"""What a tracker is, and the default: pyramidal Lucas-Kanade with a forward-backward check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, Image

_BACKWARD_MAX_LEVEL = 1  # it starts at the known answer, so coarse levels find nothing new
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Where points went.

    Attributes
    ----------
    pixels
        (N, 2) in the current image.
    found
        (N,) whether there is an answer.
    consistent
        (N,) whether the way back confirms it.
    """

    pixels: FloatArray
    found: BoolArray
    consistent: BoolArray


class Tracker(Protocol):
    """A way of finding points of one image in the next."""

    def track(
        self, previous: Image, current: Image, pixels: FloatArray, guess: FloatArray | None
    ) -> Flow:
        """Find pixels (N, 2) of the previous image in the current one.

        ``guess`` (N, 2): where to start the search; None starts where the points were.
        """
        ...


class KltTracker:
    """Lucas-Kanade optical flow on image pyramids.

    Parameters
    ----------
    window_px
        Side of the patch.
    levels
        Pyramid levels, the full image included.
    forward_backward_px
        Largest distance between a point and its way there and back.
    """

    def __init__(self, window_px: int, levels: int, forward_backward_px: float) -> None:
        self._window = (window_px, window_px)
        self._max_level = levels - 1
        self._forward_backward_px = forward_backward_px

    def track(
        self, previous: Image, current: Image, pixels: FloatArray, guess: FloatArray | None
    ) -> Flow:
        """Find pixels (N, 2) of the previous image in the current one.

        ``guess`` (N, 2): where to start the search; None starts where the points were. A point is
        found if Lucas-Kanade converges, consistent if, tracked back, it returns to its origin.
        """
        if len(pixels) == 0:
            nothing = np.zeros(0, np.bool_)
            return Flow(np.zeros((0, 2)), nothing, nothing)
        start = pixels if guess is None else guess
        there, found = self._flow(previous, current, pixels, start, self._max_level)
        back, returned = self._flow(current, previous, there, pixels, _BACKWARD_MAX_LEVEL)
        miss = np.linalg.norm(back - pixels, axis=1)
        return Flow(there, found, found & returned & (miss <= self._forward_backward_px))

    def _flow(
        self, a: Image, b: Image, points: FloatArray, start: FloatArray, max_level: int
    ) -> tuple[FloatArray, BoolArray]:
        end, status, _ = cv2.calcOpticalFlowPyrLK(
            a,
            b,
            points.astype(np.float32)[:, None],
            start.astype(np.float32)[:, None].copy(),
            winSize=self._window,
            maxLevel=max_level,
            criteria=_CRITERIA,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        return end[:, 0].astype(np.float64), status[:, 0] == 1
