"""New features: FAST corners, per cell by quota, at a minimum distance, refined below the pixel."""

from __future__ import annotations

import cv2
import numpy as np

from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.frontend.selection import Corners, Selection
from p2gd_fgo.types import BoolArray, FloatArray, Image, IntArray

_SUBPIXEL_HALF_WINDOW = (5, 5)
_SUBPIXEL_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01)
_SUBPIXEL_MAX_MOVE_PX = 2.0  # farther away it found another corner


class CornerDetector:
    """Finds new features where the quotas ask for them.

    Parameters
    ----------
    grid
        The cells.
    fast_threshold
        Grey levels of the FAST test.
    min_distance_px
        Between a new feature and every other feature, old or new.
    border_px
        No corner this near to the image's edge.
    subpixel
        Whether to refine positions.

    Attributes
    ----------
    corner_counts
        (rows, columns) corners found in the last image that was searched.
    """

    def __init__(
        self,
        grid: CellGrid,
        *,
        fast_threshold: int,
        min_distance_px: float,
        border_px: int,
        subpixel: bool,
    ) -> None:
        self._grid = grid
        self._fast = cv2.FastFeatureDetector.create(fast_threshold, nonmaxSuppression=True)
        self._min_distance_px = min_distance_px
        self._border_px = border_px
        self._subpixel = subpixel
        self.corner_counts: IntArray = np.zeros(grid.shape, np.int64)

    def detect(
        self,
        image: Image,
        kept: FloatArray,
        selection: Selection,
        max_features: int,
        allowed: BoolArray | None = None,
    ) -> FloatArray:
        """Find new features (M, 2) beside those kept (K, 2); K + M ≤ max_features unless M is 0.

        ``allowed`` (height, width): none where it is false; None: anywhere.
        """
        budget = max_features - len(kept)
        if budget <= 0:
            return np.zeros((0, 2))
        corners = self._corners(image, allowed)
        self.corner_counts = self._grid.count(corners.pixels)
        new = corners.pixels[selection.select(corners, kept, budget)]
        return self._refined(image, new, kept, allowed) if self._subpixel and len(new) else new

    def _corners(self, image: Image, allowed: BoolArray | None) -> Corners:
        keypoints = self._fast.detect(image)
        corners = np.zeros((0, 2))
        if len(keypoints):
            corners = np.asarray(cv2.KeyPoint.convert(keypoints), dtype=np.float64)
        responses = np.array([keypoint.response for keypoint in keypoints])
        usable = self._usable(corners, allowed)
        corners = corners[usable]
        return Corners(
            corners, responses[usable], self._grid.cell_of(corners),
            self._grid, self._min_distance_px,
        )  # fmt: skip

    def _usable(self, pixels: FloatArray, allowed: BoolArray | None) -> BoolArray:
        border = self._border_px
        u, v = pixels[:, 0], pixels[:, 1]
        inside = (u >= border) & (u <= self._grid.width - 1 - border)
        inside &= (v >= border) & (v <= self._grid.height - 1 - border)
        return inside if allowed is None else inside & pixel_values(allowed, pixels)

    def _refined(
        self, image: Image, new: FloatArray, kept: FloatArray, allowed: BoolArray | None
    ) -> FloatArray:
        """Sub-pixel positions; whichever breaks a rule that the detected corner keeps goes back."""
        refined = cv2.cornerSubPix(
            image,
            new.astype(np.float32)[:, None].copy(),
            _SUBPIXEL_HALF_WINDOW,
            (-1, -1),
            _SUBPIXEL_CRITERIA,
        )[:, 0].astype(np.float64)
        bad = np.linalg.norm(refined - new, axis=1) > _SUBPIXEL_MAX_MOVE_PX
        bad |= ~self._usable(refined, allowed)
        bad |= self._grid.cell_of(refined) != self._grid.cell_of(new)
        while True:
            refined = np.where(bad[:, None], new, refined)
            u, v = np.concatenate([refined, kept]).T
            squares = (refined[:, :1] - u) ** 2 + (refined[:, 1:] - v) ** 2
            np.fill_diagonal(squares, np.inf)
            near = (squares < self._min_distance_px**2).any(axis=1) & ~bad
            if not near.any():
                return refined
            bad |= near


def pixel_values(image: BoolArray, pixels: FloatArray) -> BoolArray:
    """Values (N,) of the pixels nearest to (N, 2); false outside the image."""
    column, row = np.rint(pixels).astype(np.int64).T
    height, width = image.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return np.asarray(inside & image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])
