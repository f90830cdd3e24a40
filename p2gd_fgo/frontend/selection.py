"""Which of the corners found in an image become new features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of an image, those at the edge or masked left out.

    Attributes
    ----------
    pixels, responses, cells
        (N, 2), (N,) strength, (N,) flat cell index.
    grid
        The cells.
    min_distance_px
        To be kept between features, old or new.
    """

    pixels: FloatArray
    responses: FloatArray
    cells: IntArray
    grid: CellGrid
    min_distance_px: float

    def __len__(self) -> int:
        return len(self.pixels)

    def part(self, which: BoolArray | IntArray) -> Corners:
        """Those that which (N,) or indices name."""
        return Corners(
            self.pixels[which], self.responses[which], self.cells[which],
            self.grid, self.min_distance_px,
        )  # fmt: skip

    def free_of(self, kept: FloatArray) -> BoolArray:
        """Whether each (N,) is at least the minimum distance away from every one of kept (K, 2)."""
        if len(kept) == 0 or len(self) == 0:
            return np.ones(len(self), np.bool_)
        nearest, _ = cKDTree(kept).query(self.pixels, distance_upper_bound=self.min_distance_px)
        return np.asarray(nearest >= self.min_distance_px)


class Selection(Protocol):
    """A way of choosing new features, made by a distribution for one image."""

    @property
    def asked(self) -> int:
        """Features wanted, the tracked ones included."""
        ...

    def select(self, corners: Corners, kept: FloatArray, budget: int) -> IntArray:
        """Choose among the corners.

        Parameters
        ----------
        corners
            All that were found.
        kept
            (K, 2) features that were tracked into the image.
        budget
            New features at most.

        Returns
        -------
        IntArray
            Indices of the chosen corners, at the minimum distance from each other and from
            ``kept``, in the order of choice.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class CellQuotas:
    """Features wanted per cell; the cell with the largest need is served first.

    Attributes
    ----------
    quotas
        (rows, columns), the tracked features included.
    refill
        Whether what cells could not serve is handed on, one feature at a time, to the cell with
        the largest quota for each feature that it then has (D'Hondt's rule), as long as it has
        corners; to a cell without quota never. The features asked for in all are not exceeded.
    capacity
        (rows, columns) features that a cell is filled up to by refilling; None: no limit.
    """

    quotas: IntArray
    refill: bool = False
    capacity: IntArray | None = None

    @property
    def asked(self) -> int:
        """Features wanted, the tracked ones included."""
        return int(self.quotas.sum())

    def select(self, corners: Corners, kept: FloatArray, budget: int) -> IntArray:
        """Choose for every cell max(0, quota − kept features in it), the strongest corner first."""
        grid = corners.grid
        if self.quotas.shape != grid.shape:
            raise ValueError(f"quotas have shape {self.quotas.shape}, the grid {grid.shape}")
        need = np.maximum(self.quotas - grid.count(kept), 0).ravel()
        useful = np.ones(len(need), np.bool_) if self.refill else need > 0
        index = np.flatnonzero(useful[corners.cells])
        index = index[corners.part(index).free_of(kept)]
        free = corners.part(index)
        chosen = select_by_need(free, need, budget)
        missing = min(budget, self.asked - len(kept)) - len(chosen)
        if self.refill and missing > 0:
            chosen = np.concatenate([chosen, self._handed_on(free, kept, chosen, missing)])
        return index[chosen]

    def _handed_on(
        self, free: Corners, kept: FloatArray, chosen: IntArray, missing: int
    ) -> IntArray:
        """Further indices into ``free``, at most ``missing``."""
        new = free.pixels[chosen]
        held = free.grid.count(np.concatenate([kept, new])).ravel()
        ahead = np.arange(missing)
        share = self.quotas.reshape(-1, 1) / (held[:, None] + 1 + ahead)
        rank = np.unique(share, return_inverse=True)[1].reshape(share.shape) + 1
        rank[share == 0.0] = 0
        if self.capacity is not None:
            rank[held[:, None] + ahead >= self.capacity.reshape(-1, 1)] = 0
        index = np.flatnonzero((rank[:, 0] > 0)[free.cells])
        index = index[free.part(index).free_of(new)]
        return index[_select_by_rank(free.part(index), rank, missing)]


def select_by_need(corners: Corners, need: IntArray, budget: int) -> IntArray:
    """Greedy choice: the cell with the largest remaining need first, in it the strongest corner.

    Parameters
    ----------
    corners
        To choose from.
    need
        (cells,) features wanted.
    budget
        Features at most.

    Returns
    -------
    IntArray
        Indices (M,) of the chosen corners, in the order of choice.
    """
    steps = np.arange(max(1, int(need.max(initial=0))))
    return _select_by_rank(corners, np.maximum(need[:, None] - steps, 0), budget)


def select_strongest(corners: Corners, budget: int) -> IntArray:
    """Greedy choice of the strongest corners at the minimum distance, wherever they are.

    Returns
    -------
    IntArray
        Indices (M,) of at most ``budget`` corners, the strongest first.
    """
    pixels, square = corners.pixels, corners.min_distance_px**2
    left = np.lexsort((pixels[:, 0], pixels[:, 1], -corners.responses))
    u, v = np.ascontiguousarray(pixels[left].T)
    chosen: list[int] = []
    while len(left) and len(chosen) < budget:
        chosen.append(int(left[0]))
        far = (u - u[0]) ** 2 + (v - v[0]) ** 2 >= square
        left, u, v = left[far], u[far], v[far]
    return np.array(chosen, np.int64)


def _select_by_rank(corners: Corners, rank: IntArray, budget: int) -> IntArray:
    """Greedy choice: the next corner is the strongest in the cell whose next feature ranks highest.

    ``rank`` (cells, L) of a cell's first, second, ... new feature, falling; 0: none wanted.
    """
    if len(corners) == 0:
        return np.zeros(0, np.int64)
    pixels, responses, cells = corners.pixels, corners.responses, corners.cells
    order = np.lexsort((pixels[:, 0], pixels[:, 1], -responses, cells))
    u, v = np.ascontiguousarray(pixels[order].T)
    bounds = np.searchsorted(cells[order], np.arange(len(rank) + 1))
    step = float(np.ptp(responses)) + 1.0  # one rank outweighs any response
    first = rank[cells[order], 0]
    priority = first * step + (responses[order] - responses.min())
    priority[first <= 0] = -np.inf
    falls = np.diff(rank, axis=1, append=0)
    served = np.zeros(len(rank), np.int64)
    chosen: list[int] = []
    square = corners.min_distance_px**2
    while len(chosen) < budget:
        best = int(np.argmax(priority))
        if priority[best] == -np.inf:
            break
        chosen.append(best)
        cell = cells[order[best]]
        same_cell = priority[bounds[cell] : bounds[cell + 1]]
        same_cell += falls[cell, served[cell]] * step
        same_cell[same_cell < step] = -np.inf
        served[cell] += 1
        priority[(u - u[best]) ** 2 + (v - v[best]) ** 2 < square] = -np.inf
        priority[best] = -np.inf
    return order[np.array(chosen, np.int64)]
