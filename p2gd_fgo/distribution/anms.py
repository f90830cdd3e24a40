"""Adaptive non-maximal suppression by square covering: evenly spread strong corners.

Bailo, Rameau, Joo, Park, Bogdan, Kweon: Efficient adaptive non-maximal suppression algorithms for
homogeneous spatial keypoint distribution, Pattern Recognition Letters 106, 2018 ("SSC").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.distribution.base import Decision, DistributionContext
from p2gd_fgo.frontend import Corners
from p2gd_fgo.frontend.selection import select_strongest
from p2gd_fgo.types import FloatArray, IntArray

_WIDTH_STEP_PX = 1.0  # the search for the square's width ends here


@dataclass(frozen=True, slots=True, eq=False)
class SquareCovering:
    """The strongest corner first; each covers a square in which no weaker one is taken.

    The square is as wide as still leaves enough corners. Tracked features cover squares too.
    Corners nearer to each other than the minimum distance are thinned out before, the stronger
    one stays; where no more than the budget are left, all of them are taken.

    Attributes
    ----------
    asked
        Features wanted, the tracked ones included.
    """

    asked: int

    def select(self, corners: Corners, kept: FloatArray, budget: int) -> IntArray:
        """Choose among the corners; see :class:`p2gd_fgo.frontend.Selection`."""
        budget = min(budget, self.asked - len(kept))
        if budget <= 0:
            return np.zeros(0, np.int64)
        free = np.flatnonzero(corners.free_of(kept))
        free = free[select_strongest(corners.part(free), len(free))]
        if len(free) <= budget:
            return free
        pixels = corners.pixels[free]
        apart = _chebyshev(pixels, pixels)
        to_kept = _chebyshev(pixels, kept).min(axis=1, initial=np.inf)
        low, high = 0.0, float(max(corners.grid.width, corners.grid.height))
        taken = np.arange(budget)
        while high - low > _WIDTH_STEP_PX:
            half_width = 0.5 * (low + high)
            trial = _uncovered(apart, to_kept, half_width, budget)
            if len(trial) == budget:
                low, taken = half_width, trial
            else:
                high = half_width
        return free[taken]


class AnmsDistribution:
    """Asks for ``max_features`` corners, spread by :class:`SquareCovering`."""

    def __init__(self, max_features: int) -> None:
        self._selection = SquareCovering(max_features)

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        return Decision(self._selection)


def _chebyshev(a: FloatArray, b: FloatArray) -> FloatArray:
    """Larger of the distances (N, M) along u and v."""
    return np.asarray(np.abs(a[:, None] - b[None]).max(axis=2))


def _uncovered(apart: FloatArray, to_kept: FloatArray, half_width: float, at_most: int) -> IntArray:
    """Corners, in order, that no square of one before them or of a kept feature covers."""
    covered = to_kept < half_width
    taken: list[int] = []
    while len(taken) < at_most and not covered.all():
        taken.append(int(covered.argmin()))
        covered |= apart[taken[-1]] < half_width
        covered[taken[-1]] = True
    return np.array(taken, np.int64)
