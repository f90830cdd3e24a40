"""Ground to build on: what is taken, and where along the streets there is room."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation.network import Network
from p2gd_fgo.simulation.palette import Palette
from p2gd_fgo.simulation.site import Site
from p2gd_fgo.types import FloatArray


class Plots(Site):
    """A site along the streets of a network; places are found beside them.

    Parameters
    ----------
    route
        (N, 2) places that stay free.
    beside_m
        Nearest and farthest distance of free-standing things from a street's border.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        network: Network,
        route: FloatArray,
        palette: Palette,
        beside_m: tuple[float, float],
    ) -> None:
        low, high = network.nodes.min(0), network.nodes.max(0)
        super().__init__(rng, route[::4], low, high, palette.materials)
        self.network = network
        self.palette = palette
        self._beside = beside_m
        self._driven = np.flatnonzero(network.on_walk())
        self._houses: list[FloatArray] = []  # corners (4, 2)

    def place(self, radius_m: float, *, tries: int = 60) -> FloatArray | None:
        """Take a free place (2,) beside a street that is driven; None: no room."""
        for _ in range(tries):
            edge = self.network.edges[int(self.rng.choice(self._driven))]
            a, b = self.network.nodes[edge]
            e = (b - a) / np.linalg.norm(b - a)
            aside = 0.5 * self.network.width_m + radius_m + self.rng.uniform(*self._beside)
            side = self.rng.choice([-1.0, 1.0]) * aside
            xy = a + self.rng.random() * (b - a) + side * np.array([-e[1], e[0]])
            if self.take(xy, radius_m):
                return np.asarray(xy)
        return None

    def take(self, xy: FloatArray, radius_m: float) -> bool:
        """Take this place if it is free: off the streets, the houses and other things."""
        gap = np.linalg.norm(self._taken[:, :2] - xy, axis=1) - self._taken[:, 2]
        if gap.min() <= radius_m or self.network.clearance(xy[None])[0] <= radius_m:
            return False
        if self._houses and _gaps(xy, np.array(self._houses)).min() < radius_m:
            return False
        self._taken = np.vstack([self._taken, [*xy, radius_m]])
        return True

    def take_house(self, corners: FloatArray, clearance_m: float) -> bool:
        """Take a rectangle, corners (4, 2) in order, if it keeps off streets and other houses."""
        share = np.linspace(0.0, 1.0, 6)[:, None]
        along = [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
        if self.network.clearance(np.vstack(along)).min() < clearance_m:
            return False
        if any(_overlap(corners, house) for house in self._houses):
            return False
        rims = np.vstack(along)
        gap = np.linalg.norm(self._taken[:, None, :2] - rims, axis=2) - self._taken[:, 2:]
        if gap.min() < 0.0:
            return False
        self._houses.append(corners)
        return True


def _overlap(a: FloatArray, b: FloatArray) -> bool:
    """Whether two rectangles (4, 2) meet, by their separating axes."""
    for corners in (a, b):
        for k in range(2):
            axis = corners[k + 1] - corners[k]
            p, q = a @ axis, b @ axis
            if p.max() < q.min() or q.max() < p.min():
                return False
    return True


def _gaps(point: FloatArray, houses: FloatArray) -> FloatArray:
    """Distances (H,) of a point from rectangles (H, 4, 2), 0 inside."""
    away = point - houses[:, 0]
    for k in (1, 3):
        edge = houses[:, k] - houses[:, 0]
        share = np.einsum("hi,hi->h", point - houses[:, 0], edge) / np.einsum(
            "hi,hi->h", edge, edge
        )
        away = away - np.clip(share, 0.0, 1.0)[:, None] * edge
    return np.asarray(np.linalg.norm(away, axis=1))
