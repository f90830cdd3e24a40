"""The baseline: the same quota in every cell."""

from __future__ import annotations

import math

import numpy as np

from p2gd_fgo.distribution.base import Decision, DistributionContext
from p2gd_fgo.frontend import CellGrid, CellQuotas
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
    """

    def __init__(self, grid: CellGrid, max_features: int) -> None:
        cells = grid.rows * grid.columns
        even, remainder = divmod(max_features, cells)
        rank = np.arange(cells, dtype=np.int64) * _scattering_step(cells) % cells
        self._shares: IntArray = (even + (rank < remainder)).reshape(grid.shape)

    def quotas(self, capacity: IntArray) -> IntArray:
        """Quotas (rows, columns), the same for every image; no cell gets more than its capacity."""
        return np.minimum(self._shares, capacity)

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        return Decision(CellQuotas(self.quotas(context.capacity)))


def _scattering_step(cells: int) -> int:
    """Smallest step from the golden section of ``cells`` on that visits every cell."""
    step = max(1, round(0.618 * cells))
    while math.gcd(step, cells) != 1:
        step += 1
    return step
