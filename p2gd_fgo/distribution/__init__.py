"""How the feature quota is spread over the image: one small class a file, same call."""

from __future__ import annotations

from p2gd_fgo.distribution.base import Decision, Distribution, DistributionContext, Explanation
from p2gd_fgo.distribution.factory import make_distribution
from p2gd_fgo.distribution.grid import GridDistribution
from p2gd_fgo.distribution.p2gd import Sensors

__all__ = [
    "Decision",
    "Distribution",
    "DistributionContext",
    "Explanation",
    "GridDistribution",
    "Sensors",
    "make_distribution",
]
