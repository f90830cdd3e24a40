"""The ground along the streets of a network: carriageways, crossings, pavements, lawns."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation.palette import Palette
from p2gd_fgo.simulation.plots import Plots
from p2gd_fgo.simulation.raster import DISC
from p2gd_fgo.simulation.street_paint import ROAD_M, ZEBRA_M
from p2gd_fgo.simulation.world import Look, patches
from p2gd_fgo.types import FloatArray

PAVEMENT_M = 4.2
_SLAB_M = 8.0
_LAWN_CELL_M, _LAWN_REACH_M = 16.0, 42.0


def pave_streets(site: Plots) -> None:
    """Carriageways with markings, and pavements; layers lie millimetres above each other."""
    network, palette, rng = site.network, site.palette, site.rng
    half = 0.5 * network.width_m
    asphalt = Look(palette.materials.asphalt, (_SLAB_M, _SLAB_M))
    used = np.bincount(network.edges.ravel(), minlength=len(network.nodes))
    for k, (i, j) in enumerate(network.edges.tolist()):
        a, b = network.nodes[i], network.nodes[j]
        length = float(np.linalg.norm(b - a))
        e = (b - a) / length
        n = np.array([-e[1], e[0]])
        # At a crossing the street stops at its border; a bend is driven through.
        cut = [half if network.crossings and used[node] > 1 else 0.0 for node in (i, j)]
        start, reach = a + cut[0] * e, length - cut[0] - cut[1]
        z = 0.001 * (k % 4)
        look = Look(palette.road, ROAD_M, (float(rng.random()), 0.0))
        site.add(patches(_at(start - half * n, z), _at(reach * e), _at(2.0 * half * n), look))
        for side in (-1.0, 1.0):
            inner = start + side * half * n
            slabs = Look(palette.materials.slabs, (_SLAB_M, _SLAB_M), rng.random(2))
            width = side * PAVEMENT_M * n
            site.add(patches(_at(inner, -0.02 - z), _at(reach * e), _at(width), slabs))
        if network.crossings:
            for node, direction, first in ((i, e, a), (j, -e, b)):
                if used[node] > 1:
                    side_way = np.array([-direction[1], direction[0]])
                    foot = first + (half + 1.2) * direction + half * side_way
                    bars = Look(palette.zebra)
                    across, along = -2.0 * half * side_way, ZEBRA_M * direction
                    site.add(patches(_at(foot, 0.006), _at(along), _at(across), bars))
    for node, place in enumerate(network.nodes):
        if used[node] < 2:
            continue
        if network.crossings:
            corner = _at(place - half, 0.005)
            site.add(patches(corner, [2 * half, 0.0, 0.0], [0.0, 2 * half, 0.0], asphalt))
        else:
            disc = Look(palette.materials.asphalt, (_SLAB_M, _SLAB_M), shape=DISC)
            corner = _at(place - half, -0.004)
            site.add(patches(corner, [2 * half, 0.0, 0.0], [0.0, 2 * half, 0.0], disc))
    for _ in range(2 * len(network.edges)):  # covers of drains
        i, j = network.edges[rng.integers(len(network.edges))]
        a, b = network.nodes[i], network.nodes[j]
        xy = a + rng.random() * (b - a) + rng.uniform(-0.8, 0.8, 2) * half
        size = float(rng.uniform(0.5, 0.75))
        cover = Look(palette.materials.painted[0], gain=0.8, shape=DISC)
        site.add(patches(_at(xy, 0.008), [size, 0.0, 0.0], [0.0, size, 0.0], cover))


def pave_paths(site: Plots) -> None:
    """Paths of slabs with a kerb, and a round place where they meet."""
    network, palette, rng = site.network, site.palette, site.rng
    half = 0.5 * network.width_m
    materials = palette.materials
    for k, (i, j) in enumerate(network.edges.tolist()):
        a, b = network.nodes[i], network.nodes[j]
        length = float(np.linalg.norm(b - a))
        e = (b - a) / length
        n = np.array([-e[1], e[0]])
        z = 0.001 * (k % 5)
        slabs = materials.slabs if (k // 2) % 3 else materials.asphalt
        look = Look(slabs, (_SLAB_M, _SLAB_M), rng.random(2))
        site.add(patches(_at(a - half * n, z), _at(length * e), _at(2.0 * half * n), look))
        kerb = Look(materials.concrete, (1.0, 0.6), gain=1.15)
        for side in (-1.0, 1.0):
            inner = a + side * half * n
            stone = _at(side * 0.15 * n)
            site.add(patches(_at(inner, -0.002), _at(length * e), stone, kerb))
    for place in network.nodes:
        radius = half * float(rng.uniform(1.25, 1.7)) if network.crossings else 1.02 * half
        z = 0.007 if network.crossings else -0.003
        corner = _at(place - radius, z)
        stones = palette.plaza if network.crossings else materials.slabs
        look = Look(stones, (4.0, 4.0), rng.random(2), shape=DISC)
        site.add(patches(corner, [2 * radius, 0.0, 0.0], [0.0, 2 * radius, 0.0], look))


def lay_lawns(site: Plots, *, stone_share: float) -> None:
    """Grass, here and there concrete, wherever a street is near; coarse ground further out."""
    rng, materials = site.rng, site.palette.materials
    low = site.low - _LAWN_REACH_M - _LAWN_CELL_M
    count = np.ceil((site.high + _LAWN_REACH_M - low) / _LAWN_CELL_M).astype(int)
    i, j = (v.ravel() for v in np.meshgrid(*(np.arange(n) for n in count)))
    corner = low + np.column_stack([i, j]) * _LAWN_CELL_M
    near = site.network.clearance(corner + 0.5 * _LAWN_CELL_M) < _LAWN_REACH_M
    corner = corner[near]
    stone = rng.random(len(corner)) < stone_share
    look = Look(
        np.where(stone, materials.asphalt, materials.grass), (6.0, 6.0), rng.random(corner.shape)
    )
    edge = [_LAWN_CELL_M, 0.0, 0.0], [0.0, _LAWN_CELL_M, 0.0]
    site.add(patches(np.column_stack([corner, np.full(len(corner), -0.04)]), *edge, look))


def far_ground(palette: Palette, center: FloatArray, reach_m: float) -> tuple[FloatArray, Look]:
    """Corner (3,) and look of one large plate."""
    return _at(center - reach_m, -0.08), Look(palette.materials.grass, (9.0, 9.0))


def _at(xy: FloatArray, z: float = 0.0) -> FloatArray:
    return np.array([xy[0], xy[1], z])
