"""How the feature quota is spread over the image's cells: one small class a file, same call."""

from __future__ import annotations

from p2gd_fgo.config import DistributionConfig
from p2gd_fgo.distribution.base import Distribution, DistributionContext
from p2gd_fgo.distribution.grid import GridDistribution
from p2gd_fgo.frontend import CellGrid

__all__ = ["Distribution", "DistributionContext", "GridDistribution", "make_distribution"]


def make_distribution(
    config: DistributionConfig, grid: CellGrid, max_features: int, min_distance_px: float
) -> Distribution:
    """Build the distribution that ``config.kind`` names."""
    kinds = {"grid": GridDistribution}
    return kinds[config.kind](grid, max_features, min_distance_px)
