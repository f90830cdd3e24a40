"""New features: FAST corners, per cell by quota, at a minimum distance, refined below the pixel."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import cKDTree

from p2gd_fgo.frontend.cells import CellGrid
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
    allowed
        (height, width) true where features may be; None: everywhere.
    """

    def __init__(
        self,
        grid: CellGrid,
        *,
        fast_threshold: int,
        min_distance_px: float,
        border_px: int,
        subpixel: bool,
        allowed: BoolArray | None,
    ) -> None:
        self._grid = grid
        self._fast = cv2.FastFeatureDetector.create(fast_threshold, nonmaxSuppression=True)
        self._min_distance_px = min_distance_px
        self._border_px = border_px
        self._subpixel = subpixel
        self._allowed = np.ones((grid.height, grid.width), np.bool_) if allowed is None else allowed

    def detect(
        self, image: Image, kept: FloatArray, quotas: IntArray, max_features: int
    ) -> FloatArray:
        """Find new features (M, 2) beside those kept (K, 2); K + M ≤ max_features unless M is 0.

        A cell needs max(0, quota − kept features in it), quotas (rows, columns); the cell with the
        largest remaining need is served first, in it the strongest corner.
        """
        need = np.maximum(quotas - self._grid.count(kept), 0).ravel()
        budget = max_features - len(kept)
        if budget <= 0 or not need.any():
            return np.zeros((0, 2))
        corners, responses = self._corners(image)
        cells = self._grid.cell_of(corners)
        wanted = need[cells] > 0
        corners, responses, cells = corners[wanted], responses[wanted], cells[wanted]
        if len(kept) and len(corners):
            nearest, _ = cKDTree(kept).query(corners, distance_upper_bound=self._min_distance_px)
            free = nearest >= self._min_distance_px
            corners, responses, cells = corners[free], responses[free], cells[free]
        chosen = select_by_need(corners, responses, cells, need, self._min_distance_px, budget)
        new = corners[chosen]
        return self._refined(image, new, kept) if self._subpixel and len(new) else new

    def _corners(self, image: Image) -> tuple[FloatArray, FloatArray]:
        """FAST corners (N, 2) and responses (N,), those at the edge or masked left out."""
        keypoints = self._fast.detect(image)
        if len(keypoints) == 0:
            return np.zeros((0, 2)), np.zeros(0)
        corners = np.asarray(cv2.KeyPoint.convert(keypoints), dtype=np.float64)
        responses = np.array([keypoint.response for keypoint in keypoints])
        usable = self._usable(corners)
        return corners[usable], responses[usable]

    def _usable(self, pixels: FloatArray) -> BoolArray:
        border = self._border_px
        u, v = pixels[:, 0], pixels[:, 1]
        inside = (u >= border) & (u <= self._grid.width - 1 - border)
        inside &= (v >= border) & (v <= self._grid.height - 1 - border)
        return inside & pixel_values(self._allowed, pixels)

    def _refined(self, image: Image, new: FloatArray, kept: FloatArray) -> FloatArray:
        """Sub-pixel positions; whichever breaks a rule that the detected corner keeps goes back."""
        refined = cv2.cornerSubPix(
            image,
            new.astype(np.float32)[:, None].copy(),
            _SUBPIXEL_HALF_WINDOW,
            (-1, -1),
            _SUBPIXEL_CRITERIA,
        )[:, 0].astype(np.float64)
        bad = np.linalg.norm(refined - new, axis=1) > _SUBPIXEL_MAX_MOVE_PX
        bad |= ~self._usable(refined)
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


def select_by_need(
    corners: FloatArray,
    responses: FloatArray,
    cells: IntArray,
    need: IntArray,
    min_distance_px: float,
    budget: int,
) -> IntArray:
    """Greedy choice: the cell with the largest remaining need first, in it the strongest corner.

    Parameters
    ----------
    corners, responses, cells
        (N, 2) px, (N,), (N,) flat cell indices.
    need
        (cells,) features wanted.
    min_distance_px
        Between chosen corners.
    budget
        Features at most.

    Returns
    -------
    IntArray
        Indices (M,) of the chosen corners, in the order of choice.
    """
    if len(corners) == 0:
        return np.zeros(0, np.int64)
    order = np.lexsort((corners[:, 0], corners[:, 1], -responses, cells))
    u, v = np.ascontiguousarray(corners[order].T)
    bounds = np.searchsorted(cells[order], np.arange(len(need) + 1))
    step = float(np.ptp(responses)) + 1.0  # one more of need outweighs any response
    priority = need[cells[order]] * step + (responses[order] - responses.min())
    priority[need[cells[order]] <= 0] = -np.inf
    chosen: list[int] = []
    square = min_distance_px**2
    while len(chosen) < budget:
        best = int(np.argmax(priority))
        if priority[best] == -np.inf:
            break
        chosen.append(best)
        cell = cells[order[best]]
        same_cell = priority[bounds[cell] : bounds[cell + 1]]
        same_cell -= step
        same_cell[same_cell < step] = -np.inf
        priority[(u - u[best]) ** 2 + (v - v[best]) ** 2 < square] = -np.inf
        priority[best] = -np.inf
    return order[np.array(chosen, np.int64)]


def pixel_values(image: BoolArray, pixels: FloatArray) -> BoolArray:
    """Values (N,) of the pixels nearest to (N, 2); false outside the image."""
    column, row = np.rint(pixels).astype(np.int64).T
    height, width = image.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return np.asarray(inside & image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])
