from __future__ import annotations

import numpy as np
import pytest
from frontend_scenes import HEIGHT, WIDTH
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist, pdist

from p2gd_fgo.frontend import CellQuotas, Corners
from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.frontend.selection import select_strongest
from p2gd_fgo.types import FloatArray

GRID = CellGrid(4, 3, WIDTH, HEIGHT)
NOTHING = np.zeros((0, 2))


def _corners(pixels: FloatArray, responses: FloatArray, distance: float) -> Corners:
    return Corners(pixels, responses, GRID.cell_of(pixels), GRID, distance)


def _random(rng: np.random.Generator, count: int, distance: float) -> Corners:
    pixels = rng.integers([0, 0], [WIDTH, HEIGHT], (count, 2)).astype(np.float64)
    return _corners(pixels, rng.integers(10, 60, count).astype(np.float64), distance)


def _in_cells(counts: list[int]) -> Corners:
    """As many corners in each cell as its count says, 10 px apart."""
    pixels = [
        (80.0 * (cell % 4) + 5.0 + 10.0 * (k % 7), 80.0 * (cell // 4) + 5.0 + 10.0 * (k // 7))
        for cell, count in enumerate(counts)
        for k in range(count)
    ]
    return _corners(np.array(pixels), np.full(len(pixels), 20.0), 10.0)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(0, 300),
    kept=st.integers(0, 30),
    quota=st.integers(0, 9),
    budget=st.integers(0, 70),
    distance=st.floats(1.0, 50.0),
)
def test_refilling_adds_to_the_quotas_and_keeps_every_rule(
    seed: int, count: int, kept: int, quota: int, budget: int, distance: float
) -> None:
    rng = np.random.default_rng(seed)
    corners = _random(rng, count, distance)
    old = rng.uniform([0, 0], [WIDTH, HEIGHT], (kept, 2))
    quotas = rng.integers(0, quota + 1, GRID.shape).astype(np.int64)
    capacity = rng.integers(0, 12, GRID.shape).astype(np.int64)
    plain = CellQuotas(quotas).select(corners, old, budget)
    chosen = CellQuotas(quotas, True, capacity).select(corners, old, budget)
    np.testing.assert_array_equal(chosen[: len(plain)], plain)
    assert len(chosen) == len(set(chosen.tolist()))
    assert len(chosen) <= budget
    everything = np.concatenate([old, corners.pixels[chosen]])
    if len(chosen) > len(plain):
        assert len(everything) <= quotas.sum()
    if len(chosen) > 1:
        assert pdist(corners.pixels[chosen]).min() >= distance
    if len(chosen) and kept:
        assert cdist(corners.pixels[chosen], old).min() >= distance
    assert not GRID.count(corners.pixels[chosen])[quotas == 0].any()
    handed_on = GRID.count(corners.pixels[chosen]) - GRID.count(corners.pixels[plain])
    assert (
        GRID.count(everything) <= np.maximum(capacity, GRID.count(everything) - handed_on)
    ).all()
    if len(chosen) < min(budget, quotas.sum() - kept):  # no corner is left that could serve
        left = np.setdiff1d(np.arange(count), chosen)
        open_cells = (quotas > 0) & (GRID.count(everything) < capacity)
        left = left[open_cells.ravel()[corners.cells[left]]]
        assert (
            len(left) == 0 or (cdist(corners.pixels[left], everything).min(axis=1) < distance).all()
        )


def test_what_is_handed_on_goes_in_proportion_to_the_quotas() -> None:
    corners = _in_cells([0, 40, 40, 40] + [0] * 8)
    quotas = np.zeros(GRID.shape, np.int64)
    quotas[0] = 12, 8, 4, 0
    chosen = CellQuotas(quotas, refill=True).select(corners, NOTHING, 100)
    np.testing.assert_array_equal(GRID.count(corners.pixels[chosen])[0], [0, 16, 8, 0])
    capacity = np.full(GRID.shape, 9)
    chosen = CellQuotas(quotas, True, capacity).select(corners, NOTHING, 100)
    np.testing.assert_array_equal(GRID.count(corners.pixels[chosen])[0], [0, 9, 9, 0])
    chosen = CellQuotas(quotas, True, capacity).select(corners, NOTHING, 14)
    np.testing.assert_array_equal(GRID.count(corners.pixels[chosen])[0], [0, 9, 5, 0])


def test_features_that_a_cell_has_already_count_for_its_share() -> None:
    corners = _in_cells([0, 40, 40] + [0] * 9)
    quotas = np.zeros(GRID.shape, np.int64)
    quotas[0] = 12, 8, 4, 0
    old = np.column_stack([85.0 + 6.0 * np.arange(12), np.full(12, 70.0)])  # in the second cell
    chosen = CellQuotas(quotas, refill=True).select(corners, old, 100)
    np.testing.assert_array_equal(GRID.count(corners.pixels[chosen])[0], [0, 4, 8, 0])


def test_tracked_features_count_for_what_is_asked() -> None:
    corners = _in_cells([0, 40] + [0] * 10)
    quotas = np.zeros(GRID.shape, np.int64)
    quotas[0, :2] = 10, 5
    old = np.column_stack([np.full(4, 300.0), np.linspace(10.0, 60.0, 4)])
    chosen = CellQuotas(quotas, refill=True).select(corners, old, 100)
    assert len(chosen) == 15 - 4


def test_quotas_of_another_grid_are_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        CellQuotas(np.ones((4, 3), np.int64)).select(_in_cells([1] * 12), NOTHING, 5)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 1000),
    count=st.integers(0, 200),
    budget=st.integers(0, 60),
    distance=st.floats(1.0, 60.0),
)
def test_the_strongest_first_at_the_distance(
    seed: int, count: int, budget: int, distance: float
) -> None:
    corners = _random(np.random.default_rng(seed), count, distance)
    chosen = select_strongest(corners, budget)
    expected: list[int] = []
    keys = zip(-corners.responses, corners.pixels[:, 1], corners.pixels[:, 0], strict=True)
    for _, index in sorted((key, k) for k, key in enumerate(keys)):
        gaps = np.linalg.norm(corners.pixels[expected] - corners.pixels[index], axis=1)
        if len(expected) < budget and (gaps >= distance).all():
            expected.append(index)
    assert chosen.tolist() == expected
