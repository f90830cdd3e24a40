"""All textures that streets and campuses are built of, made once a process and shared by worlds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from p2gd_fgo.simulation import materials, street_paint
from p2gd_fgo.simulation.facades import FacadeStyle, facade, random_style
from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.simulation.site import Materials
from p2gd_fgo.simulation.textures import TextureAtlas, build_atlas

_SEED = 20
_HOUSES = ((16.0, 4), (20.0, 5), (14.0, 3), (18.0, 6), (24.0, 4), (12.0, 3), (16.0, 5), (26.0, 3))
_FLANK_M = 11.0
_TEXELS_PER_M = 64.0


@dataclass(frozen=True, slots=True)
class HouseDesign:
    """A house that is built in many places: sizes in m, textures of front and flank."""

    width_m: float
    height_m: float
    depth_m: float
    front: int
    flank: int


@dataclass(frozen=True, slots=True, eq=False)
class Palette:
    """Where everything is in the atlas.

    Attributes
    ----------
    road, lane_road
        A street with four lanes and its kerbs, and a plain path; the columns run along it.
    """

    materials: Materials
    road: int
    zebra: int
    plaza: int
    houses: tuple[HouseDesign, ...]
    shops: tuple[int, ...]
    paint: tuple[int, ...]
    car_side: tuple[int, ...]
    glass: int
    tyre: int
    plate: int
    cloth: tuple[int, ...]
    signs: tuple[int, ...]
    hills: int
    atlas: TextureAtlas


@lru_cache(maxsize=2)
def palette(detail: float = 1.0, contrast: float = 1.0) -> Palette:
    """Paint all textures.

    Parameters
    ----------
    detail
        Factor on their resolution, rounded to a power of two.
    contrast
        Below 1, walls and grounds fade towards their mean.
    """
    rng = np.random.default_rng(_SEED)
    scale = 2.0 ** round(np.log2(detail))
    images: list[Float32Array] = []

    def add(image: Float32Array) -> int:
        images.append(image)
        return len(images) - 1

    def ground(image: Float32Array) -> Float32Array:
        mean = np.float32(image.mean())
        return mean + np.float32(contrast) * (image - mean)

    large, middle = int(2048 * scale), int(512 * scale)
    asphalt = ground(materials.asphalt(rng, large))
    slab = int(large // 16)
    basics = Materials(
        add(asphalt),
        add(materials.parking(rng, asphalt)),
        add(ground(materials.slabs(rng, large, (slab, slab)))),
        add(ground(materials.grass(rng, large))),
        add(ground(materials.concrete(rng, middle))),
        add(materials.planks(rng, middle, int(64 * scale))),
        add(ground(materials.foliage(rng, middle))),
        add(materials.bark(rng)),
        tuple(add(materials.painted(rng, shade=s)) for s in (70.0, 120.0, 185.0)),
    )
    road = add(street_paint.road(rng, asphalt))
    zebra = add(street_paint.zebra(rng, asphalt))
    plaza = add(ground(materials.slabs(rng, large // 2, (slab // 2, slab // 4), 128.0)))
    houses = tuple(
        _house(rng, width, storeys, contrast, _TEXELS_PER_M * scale, add)
        for width, storeys in _HOUSES
    )
    return Palette(
        basics,
        road,
        zebra,
        plaza,
        houses,
        tuple(add(street_paint.shop(rng)) for _ in range(3)),
        tuple(add(street_paint.body_paint(rng, s)) for s in (45.0, 95.0, 150.0, 215.0)),
        tuple(add(street_paint.car_side(rng, s)) for s in (45.0, 95.0, 150.0, 215.0)),
        add(street_paint.glass(rng)),
        add(street_paint.tyre()),
        add(street_paint.car_end(rng)),
        tuple(add(street_paint.cloth(rng, s)) for s in (70.0, 95.0, 140.0, 190.0)),
        tuple(add(street_paint.sign(rng, k)) for k in range(3)),
        add(ground(street_paint.hills(rng))),
        build_atlas(images),
    )


def _house(
    rng: np.random.Generator,
    width: float,
    storeys: int,
    contrast: float,
    texels_per_m: float,
    add: object,
) -> HouseDesign:
    style = random_style(rng)
    if contrast < 1.0:
        style = FacadeStyle(False, style.shade if style.shade > 130.0 else 160.0, spacing_m=4.5)
    height = style.storey_m * storeys + 0.9

    def wall(length: float, scale: float) -> int:
        image = facade(rng, length, height, style, scale)
        if contrast < 1.0:
            near = np.abs(image - style.shade) < 45.0
            image[near] = style.shade + contrast * (image[near] - style.shade)
        assert callable(add)
        return int(add(image))

    front = wall(width, texels_per_m)
    return HouseDesign(width, height, _FLANK_M, front, wall(_FLANK_M, 0.5 * texels_per_m))
