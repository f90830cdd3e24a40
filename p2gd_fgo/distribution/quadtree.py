"""The strongest corner in every leaf of a quadtree, as ORB-SLAM spreads its features.

Mur-Artal, Montiel, Tardós: ORB-SLAM: a versatile and accurate monocular SLAM system, IEEE
Transactions on Robotics 31(5), 2015, section V-A, and its successors' implementations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.distribution.base import Decision, DistributionContext
from p2gd_fgo.frontend import Corners
from p2gd_fgo.frontend.selection import select_by_need
from p2gd_fgo.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class QuadtreeLeaves:
    """One feature in each leaf: the tracked one if there is, else the strongest corner.

    Leaves with several points are split in four, the fullest first, until there are as many
    leaves as features wanted. Where corners of neighbouring leaves are too near to each other, a
    new tree over what is left free fills up the budget.

    Attributes
    ----------
    asked
        Features wanted, the tracked ones included.
    """

    asked: int

    def select(self, corners: Corners, kept: FloatArray, budget: int) -> IntArray:
        """Choose among the corners; see :class:`p2gd_fgo.frontend.Selection`."""
        budget = min(budget, self.asked - len(kept))
        size = np.array([corners.grid.width, corners.grid.height], dtype=np.float64)
        chosen = np.zeros(0, np.int64)
        free = np.flatnonzero(corners.free_of(kept))
        while len(free) and len(chosen) < budget:
            part = corners.part(free)
            occupied = np.concatenate([kept, corners.pixels[chosen]])
            leaves = quadtree_leaves(np.concatenate([part.pixels, occupied]), size, self.asked)
            need = np.ones(int(leaves.max()) + 1, np.int64)
            need[leaves[len(free) :]] = 0
            part = replace(part, cells=leaves[: len(free)])
            new = select_by_need(part, need, budget - len(chosen))
            if len(new) == 0:  # every free corner shares a leaf with a feature
                new = select_by_need(part, np.ones_like(need), budget - len(chosen))
            chosen = np.concatenate([chosen, free[new]])
            free = free[part.free_of(corners.pixels[free[new]])]
        return chosen


class QuadtreeDistribution:
    """Asks for ``max_features`` corners, spread by :class:`QuadtreeLeaves`."""

    def __init__(self, max_features: int) -> None:
        self._selection = QuadtreeLeaves(max_features)

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        return Decision(self._selection)


def quadtree_leaves(points: FloatArray, size: FloatArray, wanted: int) -> IntArray:
    """Split an image until ``wanted`` leaves hold points, or none holds points that differ.

    Parameters
    ----------
    points
        (N, 2) pixels, N at least 1.
    size
        (2,) width and height; the roots stand side by side, each about as wide as high.
    wanted
        Leaves.

    Returns
    -------
    IntArray
        (N,) leaf of each point, from 0 on.
    """
    roots = max(1, round(size[0] / size[1]))
    place = points / (size / [roots, 1])
    leaf = _numbered(np.clip(np.floor(place[:, 0]), 0, roots - 1))
    for level in range(1, int(np.ceil(np.log2(size[1]))) + 1):
        count = np.bincount(leaf)
        if len(count) >= wanted or count.max() == 1:
            break
        quarter = np.floor(place * 2.0**level).astype(np.int64) % 2 @ [1, 2]
        children = np.bincount(np.unique(leaf * 4 + quarter) // 4)
        full = np.argsort(-count, kind="stable")[: int((count > 1).sum())]
        leaves = len(count) + np.cumsum(children[full] - 1)
        split = np.zeros(len(count), np.bool_)
        split[full[: int(np.searchsorted(leaves, wanted)) + 1]] = True
        leaf = _numbered(leaf * 4 + np.where(split[leaf], quarter, 0))
    return leaf


def _numbered(keys: FloatArray | IntArray) -> IntArray:
    """Numbers (N,) from 0 on instead of keys (N,)."""
    return np.asarray(np.unique(keys, return_inverse=True)[1], dtype=np.int64)
