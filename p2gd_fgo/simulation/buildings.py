"""Houses along streets, free-standing halls on a campus, and the skyline behind everything."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation.palette import HouseDesign, Palette
from p2gd_fgo.simulation.plots import Plots
from p2gd_fgo.simulation.raster import TRIANGLE
from p2gd_fgo.simulation.street_paint import SHOP_M
from p2gd_fgo.simulation.world import Look, Surfaces, concatenate, patches
from p2gd_fgo.types import FloatArray


def house_rows(site: Plots, setback_m: float, open_share: float) -> None:
    """Rows of houses on both sides of every street, ``setback_m`` behind its border."""
    rng, half = site.rng, 0.5 * site.network.width_m
    for run in site.network.runs():
        if rng.random() < open_share:
            continue
        at, length = run.margin_m + setback_m, run.length
        while at < length - 8.0:
            design = site.palette.houses[int(rng.integers(len(site.palette.houses)))]
            back = half + setback_m + float(rng.choice([0.0, 0.0, 0.6, 1.5]))
            place, e, out = run.at(at, design.width_m)
            if site.take_house(_outline(place + back * out, e, out, design), setback_m - 0.1):
                _house(site, place + back * out, e, out, design, shops=True)
                at += design.width_m + float(rng.choice([0.0, 0.0, 1.6, 3.5]))
            else:
                at += 4.0


def halls(site: Plots, setback_m: tuple[float, float], share: float) -> None:
    """Free-standing buildings of a campus, at varying distance from its paths."""
    rng, half = site.rng, 0.5 * site.network.width_m
    for run in site.network.runs():
        if rng.random() > share:
            continue
        for _ in range(4):
            design = site.palette.houses[int(rng.integers(len(site.palette.houses)))]
            at = rng.uniform(1.0, max(run.length - design.width_m, 2.0))
            setback = rng.uniform(*setback_m)
            place, e, out = run.at(at, design.width_m)
            corner = place + (half + setback) * out
            if site.take_house(_outline(corner, e, out, design), 0.6 * setback_m[0]):
                _house(site, corner, e, out, design, shops=False)
                break


def skyline(
    palette: Palette, center: FloatArray, reach_m: float, rng: np.random.Generator
) -> Surfaces:
    """Towers at 1.2 to 2 times ``reach_m``, wooded hills behind."""
    parts = []
    for _ in range(36):
        angle, away = rng.uniform(0.0, 2.0 * np.pi), reach_m * rng.uniform(1.15, 1.9)
        width, depth, height = rng.uniform(16.0, 34.0), rng.uniform(14.0, 24.0), rng.uniform(18, 62)
        design = palette.houses[int(rng.integers(len(palette.houses)))]
        e = np.array([-np.sin(angle), np.cos(angle)])
        out = np.array([np.cos(angle), np.sin(angle)])
        corner = _at(center + away * out - 0.5 * width * e)
        look = Look(
            design.front, (design.width_m, design.height_m), gain=float(rng.uniform(0.8, 1.2))
        )
        up, along, into = [0.0, 0.0, height], _at(width * e), _at(depth * out)
        parts.append(patches(corner, along, up, look))
        parts.append(patches([corner, corner + along], into, up, look))
        parts.append(patches(corner + up, along, into, Look(palette.materials.concrete)))
    count = 72
    angles = np.linspace(0.0, 2.0 * np.pi, count + 1)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count + 1)]) * 2.6 * reach_m
    ring[:, :2] += center
    waves = sum(
        rng.uniform(4.0, 14.0) * np.sin(k * angles[:-1] + rng.uniform(0.0, 6.3))
        for k in (2, 3, 5, 9)
    )
    heights = np.zeros((count, 3))
    heights[:, 2] = np.clip(0.05 * reach_m + waves, 6.0, None)
    hills = Look(palette.hills, (90.0, 45.0), rng.random((count, 2)), rng.uniform(0.9, 1.1, count))
    parts.append(patches(ring[:-1], np.diff(ring, axis=0), heights, hills))
    return concatenate(parts)


def _house(
    site: Plots,
    corner: FloatArray,
    e: FloatArray,
    out: FloatArray,
    design: HouseDesign,
    *,
    shops: bool,
) -> None:
    """Front, back, flanks, roof, and now and then a shop; e runs along the front."""
    rng, palette = site.rng, site.palette
    gain = float(rng.uniform(0.82, 1.18))
    front = Look(design.front, gain=gain)
    if rng.random() < 0.5:  # mirrored
        front = Look(design.front, (-design.width_m, design.height_m), (1.0, 0.0), gain)
    o, up = _at(corner), np.array([0.0, 0.0, design.height_m])
    along, into = _at(design.width_m * e), _at(design.depth_m * out)
    site.add(patches([o, o + into], along, up, front))
    site.add(patches([o + into, o + along], [-into, into], up, Look(design.flank, gain=gain)))
    if shops and rng.random() < 0.55 and design.width_m > 13.0:
        count = int((design.width_m - 1.0) // SHOP_M[0])
        shop = Look(palette.shops[int(rng.integers(len(palette.shops)))], gain=gain)
        first = o + _at((0.5 * (design.width_m - count * SHOP_M[0])) * e - 0.05 * out)
        ends = first + np.arange(1, count + 1)[:, None] * _at(SHOP_M[0] * e)
        site.add(patches(ends, _at(-SHOP_M[0] * e), [0.0, 0.0, SHOP_M[1]], shop))
        awning = first + np.array([0.0, 0.0, 2.6])
        cloth = Look(palette.materials.painted[int(rng.integers(3))], (0.8, 1.2))
        slope = _at(-1.1 * out) - [0.0, 0.0, 0.35]
        site.add(patches(awning, _at(count * SHOP_M[0] * e), slope, cloth))
    tiles = Look(palette.materials.painted[0], (1.3, 1.3))
    if rng.random() < 0.6:
        site.add(patches(o + up - 0.03 * into, along, 1.03 * into, tiles))
        return
    ridge = 0.5 * into + [0.0, 0.0, rng.uniform(2.5, 4.0)]
    eaves = o + up - 0.05 * ridge
    site.add(patches([eaves, eaves + into], along, [1.05 * ridge, ridge - into], tiles))
    gable = Look(palette.materials.concrete, (3.0, 3.0), gain=0.8, shape=TRIANGLE)
    site.add(patches([o + up, o + up + along], into, ridge, gable))


def _outline(corner: FloatArray, e: FloatArray, out: FloatArray, design: HouseDesign) -> FloatArray:
    """Corners (4, 2) of a house, in order."""
    along, into = design.width_m * e, design.depth_m * out
    return np.array([corner, corner + along, corner + along + into, corner + into])


def _at(xy: FloatArray) -> FloatArray:
    return np.array([xy[0], xy[1], 0.0])
