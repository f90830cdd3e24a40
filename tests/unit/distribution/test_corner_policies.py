"""Policies that choose among the corners found, whatever lies ahead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist, pdist

from p2gd_fgo.config import DistributionConfig
from p2gd_fgo.datasets import ImuNoise
from p2gd_fgo.distribution import (
    DistributionContext,
    GridDistribution,
    Sensors,
    make_distribution,
)
from p2gd_fgo.distribution.anms import SquareCovering
from p2gd_fgo.distribution.quadtree import QuadtreeLeaves, quadtree_leaves
from p2gd_fgo.distribution.refill import Refilled
from p2gd_fgo.distribution.uniform_random import RandomCorners
from p2gd_fgo.frontend import CellGrid, CellQuotas, Corners, FeatureBuffer, Selection
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.types import FloatArray, IntArray, Trajectory

WIDTH, HEIGHT = 400, 200
GRID = CellGrid(4, 2, WIDTH, HEIGHT)
SIZE = np.array([WIDTH, HEIGHT], np.float64)
NOTHING = np.zeros((0, 2))
SENSORS = Sensors(ImuNoise(1e-3, 1e-4, 1e-2, 1e-3), 9.81, 1.0)
POLICIES: dict[str, Callable[[int], Selection]] = {
    "quadtree": QuadtreeLeaves,
    "anms": SquareCovering,
    "uniform_random": lambda asked: RandomCorners(asked, np.random.default_rng(5)),
}


def corners_at(pixels: FloatArray, responses: FloatArray, distance: float) -> Corners:
    return Corners(pixels, responses, GRID.cell_of(pixels), GRID, distance)


def crowded(seed: int, count: int, distance: float) -> Corners:
    """Half of the corners anywhere, the stronger half in one corner of the image."""
    rng = np.random.default_rng(seed)
    spread = rng.integers([0, 0], [WIDTH, HEIGHT], (count - count // 2, 2))
    crowd = rng.integers([0, 0], [WIDTH // 4, HEIGHT // 2], (count // 2, 2))
    responses = np.concatenate(
        [rng.integers(20, 40, len(spread)), rng.integers(60, 90, len(crowd))]
    )
    pixels = np.concatenate([spread, crowd]).astype(np.float64)
    return corners_at(pixels, responses.astype(np.float64), distance)


def context(capacity: IntArray | None = None) -> DistributionContext:
    return DistributionContext(
        RadTanCamera(WIDTH, HEIGHT, 200.0, 200.0, 199.5, 99.5, 0.0, 0.0, 0.0, 0.0),
        np.eye(4),
        FeatureBuffer(5),
        Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4))),
        None,
        np.full(GRID.shape, 9) if capacity is None else capacity,
        np.zeros(GRID.shape, np.int64),
    )


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(0, 250),
    kept=st.integers(0, 25),
    budget=st.integers(0, 60),
    distance=st.floats(1.0, 70.0),
)
@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_keeps_the_rules_and_wastes_no_budget(
    policy: str, seed: int, count: int, kept: int, budget: int, distance: float
) -> None:
    corners = crowded(seed, count, distance)
    old = np.random.default_rng(seed).uniform([0, 0], SIZE - 1.0, (kept, 2))
    chosen = POLICIES[policy](kept + budget).select(corners, old, budget)
    assert len(chosen) == len(set(chosen.tolist())) <= budget
    everything = np.concatenate([old, corners.pixels[chosen]])
    if len(chosen) > 1:
        assert pdist(corners.pixels[chosen]).min() >= distance
    if len(chosen) and kept:
        assert cdist(corners.pixels[chosen], old).min() >= distance
    if len(chosen) < budget and len(everything):
        left = np.setdiff1d(np.arange(count), chosen)
        assert (cdist(corners.pixels[left], everything).min(axis=1) < distance).all()


def outside_the_crowd(pixels: FloatArray) -> float:
    return float(((pixels[:, 0] >= WIDTH // 4) | (pixels[:, 1] >= HEIGHT // 2)).mean())


@pytest.mark.parametrize("policy", ["quadtree", "anms"])
def test_spreading_beats_strength(policy: str) -> None:
    corners = crowded(1, 600, 2.0)
    strongest = corners.pixels[np.argsort(-corners.responses)[:60]]
    assert outside_the_crowd(strongest) == 0.0
    spread = corners.pixels[POLICIES[policy](60).select(corners, NOTHING, 60)]
    drawn = corners.pixels[POLICIES["uniform_random"](60).select(corners, NOTHING, 60)]
    assert outside_the_crowd(spread) > 0.7 > outside_the_crowd(drawn) + 0.05


@pytest.mark.parametrize("policy", ["quadtree", "anms"])
def test_tracked_features_hold_their_place(policy: str) -> None:
    corners = crowded(2, 600, 2.0)
    rng = np.random.default_rng(0)
    old = rng.uniform([200, 0], SIZE - 1.0, (50, 2))  # they hold the right half already
    new = corners.pixels[POLICIES[policy](80).select(corners, old, 30)]
    assert len(new) == 30
    assert (new[:, 0] < 210).mean() > 0.85


def test_quadtree_leaves_by_hand() -> None:
    points = np.array([[10.0, 10.0], [90.0, 10.0], [10.0, 90.0], [15.0, 12.0], [150.0, 50.0]])
    size = np.array([200.0, 100.0])
    assert quadtree_leaves(points, size, 2).tolist() == [0, 0, 0, 0, 1]
    once = quadtree_leaves(points, size, 3)  # the first root is split, the second has one point
    assert once[0] == once[3] and len(set(once.tolist())) == 4
    assert len(set(quadtree_leaves(points, size, 5).tolist())) == 5
    same = np.repeat(points[:1], 3, axis=0)
    assert set(quadtree_leaves(same, size, 9).tolist()) == {0}


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 1000), count=st.integers(1, 300), wanted=st.integers(1, 120))
def test_quadtree_stops_as_soon_as_there_are_enough_leaves(
    seed: int, count: int, wanted: int
) -> None:
    flat = np.random.default_rng(seed).choice(WIDTH * HEIGHT, count, replace=False)
    points = np.column_stack([flat % WIDTH, flat // WIDTH]).astype(np.float64)
    leaves = quadtree_leaves(points, SIZE, wanted)
    found = int(leaves.max()) + 1
    assert np.unique(leaves).tolist() == list(range(found))
    assert min(wanted, count) <= found <= max(wanted + 2, 2)  # 2 roots; a split makes at most 4
    for leaf in np.unique(leaves):  # compact: no leaf is larger than a root
        assert (np.ptp(points[leaves == leaf], axis=0) <= HEIGHT).all()


def test_the_strongest_corner_of_a_leaf_is_taken() -> None:
    pixels = np.array([[20.0, 20.0], [40.0, 30.0], [350.0, 150.0], [320.0, 130.0]])
    corners = corners_at(pixels, np.array([10.0, 20.0, 30.0, 25.0]), 5.0)
    assert sorted(QuadtreeLeaves(2).select(corners, NOTHING, 2).tolist()) == [1, 2]


def test_square_covering_by_hand() -> None:
    """On a line: the strongest covers its neighbours, the widest squares that leave three."""
    pixels = np.column_stack([np.arange(0.0, 400.0, 20.0), np.full(20, 50.0)])
    responses = np.full(20, 20.0)
    responses[10] = 90.0
    chosen = SquareCovering(3).select(corners_at(pixels, responses, 5.0), NOTHING, 3)
    assert chosen[0] == 10
    assert pdist(pixels[chosen]).min() >= 180.0


def test_random_corners_are_drawn_by_the_generator_alone() -> None:
    corners = crowded(3, 300, 8.0)
    stronger = replace(corners, responses=corners.responses[::-1].copy())

    def drawn(seed: int, images: int = 2) -> list[list[int]]:
        selection = RandomCorners(40, np.random.default_rng(seed))
        return [selection.select(corners, NOTHING, 40).tolist() for _ in range(images)]

    assert drawn(0) == drawn(0)
    assert drawn(0)[0] != drawn(0)[1]
    assert drawn(0)[0] != drawn(1)[0]
    selection = RandomCorners(40, np.random.default_rng(0))
    assert selection.select(stronger, NOTHING, 40).tolist() == drawn(0)[0]


@pytest.mark.parametrize("kind", ["grid", "quadtree", "anms", "uniform_random"])
@pytest.mark.parametrize("refill", [False, True])
def test_the_factory_makes_what_the_configuration_names(kind: str, refill: bool) -> None:
    config = DistributionConfig.model_validate({"kind": kind, "refill": refill})
    corners = crowded(4, 300, 8.0)

    def chosen(seed: int) -> list[int]:
        selection = make_distribution(config, GRID, 40, SENSORS, seed).decide(context()).selection
        assert selection.asked == 40
        return [int(k) for k in selection.select(corners, NOTHING, 40)]

    assert chosen(0) == chosen(0)
    assert (chosen(0) != chosen(1)) == (kind == "uniform_random")


def test_refilling_wraps_quotas_and_leaves_the_rest_alone() -> None:
    capacity = np.array([[9, 9, 9, 0], [9, 9, 9, 9]])
    decision = Refilled(GridDistribution(GRID, 40)).decide(context(capacity))
    selection = decision.selection
    assert isinstance(selection, CellQuotas) and selection.refill
    np.testing.assert_array_equal(selection.quotas, np.minimum(5, capacity))
    chosen = selection.select(crowded(4, 400, 8.0), NOTHING, 40)
    count = GRID.count(crowded(4, 400, 8.0).pixels[chosen])
    assert count[0, 3] == 0
    assert count.max() <= 9
    other = make_distribution(DistributionConfig(kind="anms"), GRID, 40, SENSORS)
    assert isinstance(Refilled(other).decide(context()).selection, SquareCovering)
