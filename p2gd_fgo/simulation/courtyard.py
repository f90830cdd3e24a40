"""A yard between houses: asphalt and pavement, lawns with trees, and things that stand about."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from p2gd_fgo.simulation import furniture
from p2gd_fgo.simulation.facades import facade, random_style
from p2gd_fgo.simulation.lighting import Sun, bake
from p2gd_fgo.simulation.raster import DISC, RECTANGLE, TRIANGLE
from p2gd_fgo.simulation.site import Site
from p2gd_fgo.simulation.textures import build_atlas
from p2gd_fgo.simulation.world import Look, Sky, World, concatenate, patches
from p2gd_fgo.types import BoolArray, FloatArray, IntArray

_MARGIN_M = 7.0  # between the route and the houses
_PAVEMENT_M = 4.2  # width of the pavement before the houses
_CELL_M = 4.0  # of the ground's tiling
_TILE_M = 8.0  # of a ground texture
_SLABS_PER_TILE = 16
_HOUSE_DEPTH_M = 9.0
_BELT_M = 70.0  # distance of the belt of trees around everything
_LAWNS, _THINGS, _PARKINGS = 3, 32, 10


def courtyard(route: FloatArray, rng: np.random.Generator, *, ground_z: float = 0.0) -> World:
    """Build a yard around a route that nothing obstructs.

    Parameters
    ----------
    route
        (N, 2) places in the world that stay free within 1 m.
    ground_z
        Height of the ground in the world.
    """
    route = np.asarray(route, np.float64)
    margin = _MARGIN_M * rng.uniform(0.8, 1.2, (2, 2))
    site = Site(rng, route, route.min(0) - margin[0], route.max(0) + margin[1])
    _ground(site)
    _covers(site)
    _surroundings(site)
    _houses(site)
    for _ in range(_LAWNS):
        furniture.lawn(site)
    for k in range(_THINGS):
        furniture.KINDS[k % len(furniture.KINDS)](site)
    T_world_yard = np.eye(4)
    T_world_yard[2, 3] = ground_z
    surfaces = concatenate(site.parts).transformed(T_world_yard)
    return World(surfaces, bake(surfaces, Sun(), rng), build_atlas(site.images), Sky())


def _ground(site: Site) -> None:
    """Cells of asphalt, with slabs along the houses; slabs are shuffled cell by cell."""
    low, high = site.low - 2.0 * _MARGIN_M, site.high + 2.0 * _MARGIN_M
    nx, ny = np.ceil((high - low) / _CELL_M).astype(int)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx), np.arange(ny)))
    corner = np.column_stack([low[0] + i * _CELL_M, low[1] + j * _CELL_M, np.zeros(nx * ny)])
    middle = corner[:, :2] + 0.5 * _CELL_M
    paved = np.minimum(middle - site.low, site.high - middle).min(1) < _PAVEMENT_M
    slabs = site.rng.integers(0, _SLABS_PER_TILE // 2, (nx * ny, 2)) * 2.0 / _SLABS_PER_TILE
    asphalt = np.column_stack([i, j]) * _CELL_M / _TILE_M
    road = np.where(_parking(site, i, j), site.materials.parking, site.materials.asphalt)
    look = Look(
        np.where(paved, site.materials.slabs, road),
        (_TILE_M, _TILE_M),
        np.where(paved[:, None], slabs, asphalt),
    )
    site.add(patches(corner, [_CELL_M, 0.0, 0.0], [0.0, _CELL_M, 0.0], look))


def _parking(site: Site, i: IntArray, j: IntArray) -> BoolArray:
    """Choose which cells, in column i and row j (N,), are parking bays: short runs of cells."""
    chosen = np.zeros(len(i), bool)
    for _ in range(_PARKINGS):
        row, first = site.rng.integers(j.max() + 1), site.rng.integers(i.max() + 1)
        chosen |= (j == row) & (i >= first) & (i < first + site.rng.integers(2, 5))
    return chosen


def _covers(site: Site) -> None:
    """Put covers of drains a hair above the ground."""
    rng = site.rng
    for _ in range(10):
        xy, size = rng.uniform(site.low + 1.0, site.high - 1.0), float(rng.uniform(0.45, 0.7))
        shape = DISC if rng.random() < 0.6 else RECTANGLE
        cover = Look(site.materials.painted[0], gain=0.8, shape=shape)
        site.add(patches([*xy, 0.003], [size, 0.0, 0.0], [0.0, size, 0.0], cover))


def _surroundings(site: Site) -> None:
    """Plain ground and a belt of trees far out, so that gaps don't show the world's end."""
    rng, center = site.rng, 0.5 * (site.low + site.high)
    reach = _BELT_M + 10.0
    meadow = Look(site.materials.grass, (6.0, 6.0))
    corner = [*(center - reach), -0.05]
    site.add(patches(corner, [2.0 * reach, 0.0, 0.0], [0.0, 2.0 * reach, 0.0], meadow))
    angles = np.linspace(0.0, 2.0 * np.pi, 49)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(49)]) * _BELT_M
    ring[:, :2] += center
    up = np.zeros((48, 3))
    up[:, 2] = rng.uniform(4.0, 9.0, 48)
    trees = Look(
        site.materials.foliage,
        (7.0, 7.0),
        rng.uniform(0.0, 1.0, (48, 2)),
        rng.uniform(0.8, 1.2, 48),
    )
    site.add(patches(ring[:-1], np.diff(ring, axis=0), up, trees))


def _houses(site: Site) -> None:
    """Build a row of houses with gaps on each side of the yard, and a row behind it."""
    rng = site.rng
    (x0, y0), (x1, y1) = site.low, site.high
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        e = (end - start) / length
        out = np.array([e[1], -e[0]])
        count = max(round(length / 15.0), 1)
        joints = (np.arange(1, count) + rng.uniform(-0.2, 0.2, count - 1)) / count
        cuts = length * np.concatenate([[0.0], joints, [1.0]])
        for left, right in pairwise(cuts.tolist()):
            width = right - left - float(rng.choice([0.0, 2.0, 3.5]))
            corner = start + e * left + out * rng.uniform(0.0, 1.5)
            _house(site, corner, e, out, width, int(rng.choice([2, 3, 3, 4])), 105.0)
        corner = start - e * rng.uniform(6.0, 12.0) + out * rng.uniform(14.0, 20.0)
        reach = length + rng.uniform(8.0, 14.0)
        _house(site, corner, e, out, 0.55 * reach, int(rng.choice([3, 5])), 40.0)
        corner = corner + 0.55 * reach * e + 2.0 * out
        _house(site, corner, e, out, 0.45 * reach, int(rng.choice([3, 4, 6])), 40.0)


def _house(
    site: Site,
    corner: FloatArray,
    e: FloatArray,
    out: FloatArray,
    width: float,
    storeys: int,
    texels_per_m: float,
) -> None:
    """Front, flanks and a flat or pitched roof; e runs along the front, ``out`` into the house."""
    rng = site.rng
    style = random_style(rng)
    height = style.storey_m * storeys + 0.9
    front = site.texture(facade(rng, width, height, style, texels_per_m))
    flank = Look(site.texture(facade(rng, _HOUSE_DEPTH_M, height, style, 0.5 * texels_per_m)))
    o, up = np.array([*corner, 0.0]), np.array([0.0, 0.0, height])
    along, into = np.array([*e, 0.0]) * width, np.array([*out, 0.0]) * _HOUSE_DEPTH_M
    site.add(patches(o, along, up, Look(front)))
    site.add(patches([o + into, o + along], [-into, into], up, flank))
    tiles = Look(site.materials.painted[0], (1.3, 1.3))
    if rng.random() < 0.5:
        site.add(patches(o + up - 0.03 * into, along, 1.03 * into, tiles))
        return
    ridge = 0.5 * into + [0.0, 0.0, rng.uniform(2.5, 4.0)]
    eaves = o + up - 0.05 * ridge
    site.add(patches([eaves, eaves + into], along, [1.05 * ridge, ridge - into], tiles))
    gable = Look(site.materials.concrete, (3.0, 3.0), gain=0.8, shape=TRIANGLE)
    site.add(patches([o + up, o + up + along], into, ridge, gable))
