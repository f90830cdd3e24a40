"""Whole worlds along a network: a city for cars, a campus for slow robots."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation import furniture
from p2gd_fgo.simulation.buildings import halls, house_rows, skyline
from p2gd_fgo.simulation.lighting import Sun, bake
from p2gd_fgo.simulation.network import Network
from p2gd_fgo.simulation.palette import palette
from p2gd_fgo.simulation.paving import PAVEMENT_M, far_ground, lay_lawns, pave_paths, pave_streets
from p2gd_fgo.simulation.plots import Plots
from p2gd_fgo.simulation.scenario import WorldScenario
from p2gd_fgo.simulation.street_things import line_streets, street_tree, traffic_lights
from p2gd_fgo.simulation.world import Sky, World, concatenate, patches
from p2gd_fgo.types import FloatArray

_SUN = (0.42, -0.5, 0.75)
_CITY_CELL_M, _CAMPUS_CELL_M, _FAR_CELL_M = 0.4, 0.22, 6.0
_HAZE_PER_M = 1.0 / 900.0
_CITY_FAR_M, _CAMPUS_FAR_M = 170.0, 60.0  # from the streets to the skyline
_TREES_PER_M2, _THINGS_PER_M = 0.02, 0.5


def city(
    network: Network,
    route: FloatArray,
    scenario: WorldScenario,
    rng: np.random.Generator,
    ground_z: float,
) -> World:
    """Streets between houses, with everything that stands in them; route (N, 2) stays free."""
    site = Plots(rng, network, route, palette(scenario.detail, scenario.contrast), (0.4, 2.8))
    lay_lawns(site, stone_share=0.35)
    pave_streets(site)
    house_rows(site, PAVEMENT_M, scenario.open_share)
    busy = min(scenario.contrast, 1.0)
    line_streets(site, 0.35 * busy**2)
    if network.crossings:
        traffic_lights(site)
    _scatter(site, 0.12 * busy)
    return _finish(site, scenario, ground_z, _CITY_CELL_M, _CITY_FAR_M)


def campus(
    network: Network,
    route: FloatArray,
    scenario: WorldScenario,
    rng: np.random.Generator,
    ground_z: float,
) -> World:
    """Paths between lawns, trees and halls; route (N, 2) stays free."""
    site = Plots(rng, network, route, palette(scenario.detail, scenario.contrast), (0.3, 5.0))
    lay_lawns(site, stone_share=0.06)
    pave_paths(site)
    halls(site, (4.5, 9.0), 1.0 - scenario.open_share)
    busy = min(scenario.contrast, 1.0)
    _scatter(site, _THINGS_PER_M * busy)
    _wood(site, _TREES_PER_M2 * busy)
    return _finish(site, scenario, ground_z, _CAMPUS_CELL_M, _CAMPUS_FAR_M)


def _scatter(site: Plots, per_m: float) -> None:
    """Benches, bins, hedges and the like beside the driven streets."""
    network = site.network
    edges = network.edges[network.on_walk()]
    length = np.linalg.norm(network.nodes[edges[:, 1]] - network.nodes[edges[:, 0]], axis=1).sum()
    for k in range(int(per_m * length)):
        if k % 9 == 8:
            xy = site.place(1.6)
            if xy is not None:
                furniture.hedge(site, np.array([*xy, 0.0]), float(site.rng.uniform(1.5, 3.0)))
            continue
        furniture.KINDS[k % len(furniture.KINDS)](site)


def _wood(site: Plots, per_m2: float) -> None:
    """Trees on the lawns, within 25 m of a path."""
    low, high = site.low - 12.0, site.high + 12.0
    count = int(per_m2 * np.prod(high - low))
    for xy in site.rng.uniform(low, high, (count, 2)):
        if site.network.clearance(xy[None])[0] < 25.0 and site.take(xy, 1.3):
            street_tree(site, np.array([*xy, 0.0]))


def _finish(
    site: Plots, scenario: WorldScenario, ground_z: float, cell_m: float, far_m: float
) -> World:
    """Add what is far, and let the sun shine."""
    rng, near = site.rng, concatenate(site.parts)
    center = 0.5 * (site.low + site.high)
    reach = 0.5 * float(np.linalg.norm(site.high - site.low)) + far_m
    corner, look = far_ground(site.palette, center, 2.7 * reach)
    edge = 5.4 * reach
    far = [
        patches(corner, [edge, 0.0, 0.0], [0.0, edge, 0.0], look),
        skyline(site.palette, center, reach, rng),
    ]
    together = concatenate([near, *far])
    top = together.corner[:, 2] + np.maximum(together.edge_u[:, 2], 0.0)
    stands = top + np.maximum(together.edge_v[:, 2], 0.0) > 0.05
    T_world_site = np.eye(4)
    T_world_site[2, 3] = ground_z
    surfaces = together.transformed(T_world_site)
    cells = np.full(len(surfaces), cell_m)
    cells[len(near) :] = _FAR_CELL_M
    cells[len(near)] = edge
    sun = Sun(_SUN, scenario.sun, scenario.ambient)
    towards = scenario.sun * np.array(_SUN) / np.linalg.norm(_SUN)
    return World(
        surfaces,
        bake(surfaces, sun, rng, cell_m=cells, casters=stands),
        site.palette.atlas,
        Sky(*scenario.sky, _HAZE_PER_M),
        (float(towards[0]), float(towards[1]), float(towards[2])),
        scenario.ambient,
        ground_z,
    )
