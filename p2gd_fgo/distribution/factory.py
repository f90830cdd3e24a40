"""Builds the distribution that the configuration names."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import DistributionConfig
from p2gd_fgo.distribution.anms import AnmsDistribution
from p2gd_fgo.distribution.base import Distribution
from p2gd_fgo.distribution.grid import GridDistribution
from p2gd_fgo.distribution.p2gd import P2gd, Sensors
from p2gd_fgo.distribution.quadtree import QuadtreeDistribution
from p2gd_fgo.distribution.refill import Refilled
from p2gd_fgo.distribution.uniform_random import UniformRandomDistribution
from p2gd_fgo.frontend import CellGrid

_STREAM = 1  # draws other numbers than the front end from the same seed


def make_distribution(
    config: DistributionConfig, grid: CellGrid, max_features: int, sensors: Sensors, seed: int = 0
) -> Distribution:
    """Build ``config.kind``; ``seed`` is for those that draw."""
    if config.kind == "quadtree":
        return QuadtreeDistribution(max_features)
    if config.kind == "anms":
        return AnmsDistribution(max_features)
    if config.kind == "uniform_random":
        return UniformRandomDistribution(max_features, np.random.default_rng([seed, _STREAM]))
    quotas = _quotas(config, grid, max_features, sensors)
    return Refilled(quotas) if config.refill else quotas


def _quotas(
    config: DistributionConfig, grid: CellGrid, max_features: int, sensors: Sensors
) -> Distribution:
    baseline = GridDistribution(grid, max_features)
    if config.kind == "p2gd":
        return P2gd(config.p2gd, baseline, grid, max_features, sensors)
    return baseline
