"""A building site: the parts and textures of a world in the making, and where there is room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.simulation import materials as paint
from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.simulation.world import Surfaces
from p2gd_fgo.types import FloatArray

_CLEARANCE_M = 1.0  # around the route


@dataclass(frozen=True, slots=True)
class Materials:
    """Where each material is in the atlas."""

    asphalt: int
    parking: int
    slabs: int
    grass: int
    concrete: int
    planks: int
    foliage: int
    bark: int
    painted: tuple[int, ...]


class Site:
    """What has been built so far, within ``low`` to ``high`` (2,), and where nothing may stand.

    Parameters
    ----------
    route
        (N, 2) places that stay free.
    materials
        Of an atlas that exists; None: they are made here, and :attr:`images` holds them.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        route: FloatArray,
        low: FloatArray,
        high: FloatArray,
        materials: Materials | None = None,
    ) -> None:
        self.rng = rng
        self.low, self.high = low, high
        self.images: list[Float32Array] = []
        self.parts: list[Surfaces] = []
        self._taken = np.column_stack([route, np.full(len(route), _CLEARANCE_M)])
        self.materials = materials or self._make_materials()

    def _make_materials(self) -> Materials:
        rng = self.rng
        asphalt = paint.asphalt(rng)
        return Materials(
            self.texture(asphalt),
            self.texture(paint.parking(rng, asphalt)),
            self.texture(paint.slabs(rng)),
            self.texture(paint.grass(rng)),
            self.texture(paint.concrete(rng)),
            self.texture(paint.planks(rng)),
            self.texture(paint.foliage(rng)),
            self.texture(paint.bark(rng)),
            tuple(self.texture(paint.painted(rng, shade=s)) for s in (70.0, 120.0, 185.0)),
        )

    def texture(self, image: Float32Array) -> int:
        """Add a texture (H, W) and return its index in the atlas."""
        self.images.append(image)
        return len(self.images) - 1

    def add(self, part: Surfaces) -> None:
        """Build something."""
        self.parts.append(part)

    def place(self, radius_m: float, *, tries: int = 60) -> FloatArray | None:
        """Take a free place (2,) for something of this radius; None: no room."""
        for _ in range(tries):
            xy = self.rng.uniform(self.low + radius_m, self.high - radius_m)
            gap = np.linalg.norm(self._taken[:, :2] - xy, axis=1) - self._taken[:, 2]
            if gap.min() > radius_m:
                self._taken = np.vstack([self._taken, [*xy, radius_m]])
                return np.asarray(xy)
        return None
