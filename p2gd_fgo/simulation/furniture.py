"""What stands in a yard: lawns, trees, hedges, crates, containers, benches, lamps, bins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from p2gd_fgo.simulation.raster import DISC
from p2gd_fgo.simulation.site import Site
from p2gd_fgo.simulation.world import Look, Surfaces, box, patches, prism
from p2gd_fgo.types import FloatArray

_KERB_M = 0.12


def lawn(site: Site) -> None:
    """Build a raised square lawn with a kerb and a tree; with a hedge if it is large enough."""
    rng, m = site.rng, site.materials
    radius = float(rng.uniform(2.0, 3.6))
    xy = site.place(radius)
    if xy is None:
        return
    side = radius * np.sqrt(2.0)
    kerb = Look(m.concrete, (1.5, 1.5), gain=1.1)
    site.add(box([*xy, 0.0], [side, side, _KERB_M], 0.0, kerb))
    inner = side - 0.3
    corner = [*(xy - 0.5 * inner), _KERB_M + 0.01]
    look = Look(m.grass, (5.0, 5.0), rng.uniform(0.0, 1.0, 2))
    site.add(patches(corner, [inner, 0.0, 0.0], [0.0, inner, 0.0], look))
    tree(site, np.array([*(xy + rng.uniform(-0.2, 0.2, 2) * side), _KERB_M]))
    if radius > 2.4:
        hedge(site, np.array([xy[0], xy[1] + 0.3 * side, _KERB_M]), 0.7 * side)


def tree(site: Site, foot: FloatArray) -> None:
    """Build a trunk and a round crown; ``foot`` (3,)."""
    rng, m = site.rng, site.materials
    height, crown = float(rng.uniform(2.2, 3.2)), float(rng.uniform(1.2, 1.9))
    trunk = Look(m.bark, (0.8, 1.2))
    site.add(prism(foot, float(rng.uniform(0.12, 0.2)), height + 0.6, trunk))
    leaves(site, foot + _up(height + 0.7 * crown), np.full(3, crown), 380, 0.3)


def hedge(site: Site, foot: FloatArray, length_m: float) -> None:
    """Build a clipped hedge along x; ``foot`` (3,) is the middle of its bottom."""
    size = np.array([length_m, 0.55, 0.9])
    site.add(box(foot, size, 0.0, Look(site.materials.foliage, (1.2, 1.2), gain=0.75)))
    leaves(site, foot + _up(0.5), 0.5 * size + 0.05, 140, 0.16)


def leaves(site: Site, center: FloatArray, radii: FloatArray, count: int, size_m: float) -> None:
    """Tufts of leaves, every way turned, near the hull of an ellipsoid (3,), (3,)."""
    rng = site.rng
    directions, a, b = rng.standard_normal((3, count, 3))
    b = np.cross(a, b)
    directions, a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (directions, a, b))
    middle = center + directions * radii * rng.uniform(0.45, 1.0, (count, 1)) ** 0.7
    lengths = size_m * rng.uniform(0.6, 1.4, (count, 2))
    a, b = a * lengths[:, :1], b * lengths[:, 1:]
    look = Look(
        site.materials.foliage,
        (1.0, 1.0),
        rng.uniform(0.0, 1.0, (count, 2)),
        rng.uniform(0.7, 1.5, count),
        DISC,
    )
    site.add(patches(middle - 0.5 * (a + b), a, b, look))


def crate(site: Site) -> None:
    """Build a wooden crate, now and then with another on it."""
    rng = site.rng
    spot = _spot(site, 0.6)
    if spot is None:
        return
    foot, yaw = spot
    size = rng.uniform(0.55, 0.85, 3)
    look = Look(site.materials.planks, gain=float(rng.uniform(0.8, 1.2)))
    site.add(box(foot, size, yaw, look))
    if rng.random() < 0.5:
        site.add(box(foot + _up(size[2]), 0.75 * size, yaw + 0.4, look))


def container(site: Site) -> None:
    """Build a metal container with a lid."""
    spot = _spot(site, 1.3)
    if spot is None:
        return
    foot, yaw = spot
    site.add(box(foot, [1.9, 1.0, 1.15], yaw, _metal(site)))
    lid = Look(site.materials.painted[0])
    site.add(box(foot + _up(1.15), [1.96, 1.06, 0.08], yaw, lid))


def bench(site: Site) -> None:
    """Build a bench of boards on two blocks."""
    spot = _spot(site, 1.0)
    if spot is None:
        return
    foot, yaw = spot
    along = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    block, wood = Look(site.materials.concrete), Look(site.materials.planks, (1.0, 0.6))
    for side in (-0.65, 0.65):
        site.add(box(foot + side * along, [0.12, 0.4, 0.42], yaw, block))
    site.add(box(foot + _up(0.42), [1.8, 0.45, 0.06], yaw, wood))
    site.add(box(foot + 0.24 * across + _up(0.58), [1.8, 0.05, 0.3], yaw, wood))


def lamp(site: Site) -> None:
    """Build a lamp on a pole."""
    spot = _spot(site, 0.3)
    if spot is None:
        return
    foot, yaw = spot
    pole, head = Look(_metal(site).texture, (0.5, 1.5)), Look(site.materials.painted[2], gain=1.25)
    site.add(prism(foot, 0.07, 4.2, pole))
    site.add(prism(foot, 0.14, 0.5, Look(site.materials.painted[0])))
    site.add(box(foot + _up(4.2), [0.45, 0.45, 0.3], yaw, head))


def bollard(site: Site) -> None:
    """Build a bright post with a dark top."""
    spot = _spot(site, 0.3)
    if spot is None:
        return
    foot, _ = spot
    dark = Look(site.materials.painted[0])
    site.add(prism(foot, 0.1, 0.75, Look(site.materials.painted[2])))
    site.add(prism(foot + _up(0.75), 0.1, 0.15, dark))
    site.add(_lid(foot + _up(0.9), 0.1, dark))


def planter(site: Site) -> None:
    """Build a concrete trough with a bush."""
    spot = _spot(site, 0.7)
    if spot is None:
        return
    foot, yaw = spot
    site.add(box(foot, [1.1, 0.7, 0.5], yaw, Look(site.materials.concrete)))
    leaves(site, foot + _up(0.65), np.array([0.5, 0.35, 0.3]), 70, 0.16)


def litter_bin(site: Site) -> None:
    """Build a round bin."""
    spot = _spot(site, 0.5)
    if spot is None:
        return
    foot, _ = spot
    site.add(prism(foot, 0.3, 0.95, _metal(site), sides=10))
    site.add(_lid(foot + _up(0.95), 0.32, Look(site.materials.painted[0])))


KINDS: tuple[Callable[[Site], None], ...] = (
    crate,
    container,
    bench,
    lamp,
    bollard,
    planter,
    litter_bin,
)
"""Everything that stands by itself, to be built in turn."""


def _spot(site: Site, radius_m: float) -> tuple[FloatArray, float] | None:
    """Take a free foot (3,) on the ground and a heading, rad."""
    xy = site.place(radius_m)
    if xy is None:
        return None
    return np.array([*xy, 0.0]), float(site.rng.uniform(0.0, np.pi))


def _metal(site: Site) -> Look:
    gain = float(site.rng.uniform(0.8, 1.2))
    return Look(int(site.rng.choice(site.materials.painted)), gain=gain)


def _lid(center: FloatArray, radius: float, look: Look) -> Surfaces:
    corner = center - [radius, radius, 0.0]
    disc = replace(look, shape=DISC)
    return patches(corner, [2.0 * radius, 0.0, 0.0], [0.0, 2.0 * radius, 0.0], disc)


def _up(height_m: float) -> FloatArray:
    return np.array([0.0, 0.0, height_m])
