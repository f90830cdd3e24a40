"""The baseline: the same quota in every cell."""

from __future__ import annotations

import math

import numpy as np

from p2gd_fgo.distribution.base import DistributionContext
from p2gd_fgo.frontend import CellGrid
from p2gd_fgo.types import IntArray


class GridDistribution:
    """Spreads the features evenly, whatever the scene (the paper's baseline).

    Parameters
    ----------
    grid
        The cells.
    max_features
        To be spread; where the cells don't divide it, the remainder goes to cells that lie spread
        over rows and columns.
    min_distance_px
        Between features: limits what a cell holds.
    """

    def __init__(self, grid: CellGrid, max_features: int, min_distance_px: float) -> None:
        cells = grid.rows * grid.columns
        even, remainder = divmod(max_features, cells)
        rank = np.arange(cells, dtype=np.int64) * _scattering_step(cells) % cells
        share = np.minimum(even + (rank < remainder), grid.capacity(min_distance_px))
        self._quotas: IntArray = share.astype(np.int64).reshape(grid.shape)

    def quotas(self, context: DistributionContext) -> IntArray:
        """Return the same (rows, columns) for every image."""
        return self._quotas.copy()


def _scattering_step(cells: int) -> int:
    """Smallest step from the golden section of ``cells`` on that visits every cell."""
    step = max(1, round(0.618 * cells))
    while math.gcd(step, cells) != 1:
        step += 1
    return step
