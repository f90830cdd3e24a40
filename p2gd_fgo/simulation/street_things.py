"""What stands along streets: trees, lamps, signs, traffic lights, parked cars."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation import furniture
from p2gd_fgo.simulation.plots import Plots
from p2gd_fgo.simulation.vehicles import CAR_M, VAN_M, car, van
from p2gd_fgo.simulation.world import Look, box, patches, prism
from p2gd_fgo.types import FloatArray

_TREE_EVERY_M, _LAMP_EVERY_M, _SIGN_EVERY_M = 11.0, 27.0, 38.0


def line_streets(site: Plots, parked_share: float) -> None:
    """Rows of trees, lamps and signs on the pavements, parked cars at the kerbs."""
    rng, half = site.rng, 0.5 * site.network.width_m
    for run in site.network.runs():
        first, length = run.margin_m, run.length
        last = length - first
        trees = rng.random() < 0.65
        for at in np.arange(first + 7.0, last - 7.0, 6.4):
            if rng.random() < parked_share:
                long = rng.random() < 0.15
                size = VAN_M if long else CAR_M
                place, e, n = run.at(at)
                xy = place + (half + 0.62 * size[1]) * n
                if site.take(xy, 0.5 * size[1]):
                    body = (van if long else car)(site.palette, rng)
                    turn = float(np.arctan2(e[1], e[0])) + float(rng.normal(0.0, 0.03))
                    site.add(body.transformed(_pose(xy, turn)))
        shift = rng.uniform(0.0, 4.0)
        for at in np.arange(first + 5.0 + shift, last - 4.0, _TREE_EVERY_M):
            place, _, n = run.at(at + rng.uniform(-0.8, 0.8))
            xy = place + (half + 2.6) * n
            if trees and rng.random() < 0.8 and site.take(xy, 0.5):
                street_tree(site, np.array([*xy, 0.0]))
        for at in np.arange(first + 2.0, last, _LAMP_EVERY_M):
            place, _, n = run.at(at)
            xy = place + (half + 0.6) * n
            if site.take(xy, 0.15):
                _lamp(site, xy, -n)
        for at in np.arange(first + 3.0 + 6.0 * shift, last - 2.0, _SIGN_EVERY_M):
            place, e, n = run.at(at)
            xy = place + (half + 0.8) * n
            if site.take(xy, 0.15):
                _sign(site, xy, e)


def traffic_lights(site: Plots) -> None:
    """Lights on masts at the corners of crossings."""
    half = 0.5 * site.network.width_m
    used = np.bincount(site.network.edges.ravel(), minlength=len(site.network.nodes))
    for place in site.network.nodes[used > 2]:
        for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
            xy = place + (half + 0.6) * np.array([sx, sy])
            if not site.take(xy, 0.2):
                continue
            metal = Look(site.materials.painted[0], (0.5, 1.5))
            foot = np.array([*xy, 0.0])
            site.add(prism(foot, 0.09, 5.6, metal))
            arm = np.array([-sx, 0.0]) if sx * sy > 0 else np.array([0.0, -sy])
            middle = xy + 2.3 * arm
            site.add(box([*middle, 5.3], _along(arm, 4.6, 0.12, 0.12), 0.0, metal))
            dark = Look(site.materials.painted[0], gain=0.6)
            head = xy + 4.3 * arm
            site.add(box([*head, 4.7], [0.36, 0.36, 1.0], 0.0, dark))
            for z in (4.85, 5.15, 5.45):
                lens = Look(site.materials.painted[2], gain=1.2 if z > 5.4 else 0.5)
                site.add(box([*head, z - 0.09], [0.4, 0.4, 0.18], 0.0, lens))


def street_tree(site: Plots, foot: FloatArray) -> None:
    """A tall trunk and a crown of three balls; ``foot`` (3,)."""
    rng, m = site.rng, site.materials
    height, crown = float(rng.uniform(2.6, 3.6)), float(rng.uniform(1.2, 1.8))
    trunk = Look(m.bark, (0.8, 1.2))
    site.add(prism(foot, float(rng.uniform(0.13, 0.2)), height + 0.8, trunk))
    top = foot + np.array([0.0, 0.0, height + 0.8 * crown])
    furniture.leaves(site, top, np.array([crown, crown, 1.15 * crown]), 210, 0.4)
    for _ in range(2):
        shift = rng.uniform(-0.7, 0.7, 3) * crown
        furniture.leaves(site, top + shift, np.full(3, 0.7 * crown), 70, 0.36)


def _lamp(site: Plots, xy: FloatArray, inwards: FloatArray) -> None:
    metal = Look(site.materials.painted[1], (0.5, 1.5))
    foot = np.array([*xy, 0.0])
    site.add(prism(foot, 0.08, 7.2, metal, sides=6))
    site.add(prism(foot, 0.13, 0.7, Look(site.materials.painted[0]), sides=6))
    arm = xy + 0.8 * inwards
    heading = float(np.arctan2(inwards[1], inwards[0]))
    site.add(box([*arm, 7.1], [1.7, 0.08, 0.08], heading, metal))
    head = xy + 1.6 * inwards
    site.add(box([*head, 7.0], [0.5, 0.5, 0.14], 0.0, Look(site.materials.painted[2], gain=2.2)))


def _sign(site: Plots, xy: FloatArray, e: FloatArray) -> None:
    rng = site.rng
    site.add(prism([*xy, 0.0], 0.035, 2.9, Look(site.materials.painted[2]), sides=6))
    size = float(rng.uniform(0.55, 0.8))
    n = np.array([-e[1], e[0]])
    face = Look(site.palette.signs[int(rng.integers(len(site.palette.signs)))])
    corner = np.array([*(xy + 0.5 * size * n - 0.05 * e), 2.1])
    site.add(patches(corner, [*(-size * n), 0.0], [0.0, 0.0, size], face))


def _along(direction: FloatArray, length: float, width: float, height: float) -> list[float]:
    """Size of a box along one of the axes, or turned by the caller."""
    if abs(direction[0]) > abs(direction[1]):
        return [length, width, height]
    return [width, length, height]


def _pose(xy: FloatArray, yaw: float) -> FloatArray:
    c, s = np.cos(yaw), np.sin(yaw)
    T = np.eye(4)
    T[:2, :2] = [[c, -s], [s, c]]
    T[:2, 3] = xy
    return T
