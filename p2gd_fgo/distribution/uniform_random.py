"""Any corner, with the same chance for each: what a distribution has to be better than."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.distribution.base import Decision, DistributionContext
from p2gd_fgo.frontend import Corners
from p2gd_fgo.frontend.selection import select_strongest
from p2gd_fgo.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class RandomCorners:
    """Draws corners one after the other, leaving out those too near to a feature.

    Attributes
    ----------
    asked
        Features wanted, the tracked ones included.
    rng
        Drawn from once in every image that is searched.
    """

    asked: int
    rng: np.random.Generator

    def select(self, corners: Corners, kept: FloatArray, budget: int) -> IntArray:
        """Choose among the corners; see :class:`p2gd_fgo.frontend.Selection`."""
        drawn = replace(corners, responses=self.rng.random(len(corners)))
        free = np.flatnonzero(corners.free_of(kept))
        return free[select_strongest(drawn.part(free), budget)]


class UniformRandomDistribution:
    """Asks for ``max_features`` corners at random, by one generator for the whole run."""

    def __init__(self, max_features: int, rng: np.random.Generator) -> None:
        self._selection = RandomCorners(max_features, rng)

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        return Decision(self._selection)
