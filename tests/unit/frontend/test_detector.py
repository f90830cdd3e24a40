from __future__ import annotations

import numpy as np
import pytest
from frontend_scenes import HEIGHT, WIDTH, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist, pdist

from p2gd_fgo.frontend import CellQuotas, Corners
from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.frontend.detector import CornerDetector
from p2gd_fgo.frontend.selection import select_by_need
from p2gd_fgo.types import FloatArray

GRID = CellGrid(4, 3, WIDTH, HEIGHT)
DISTANCE = 15.0


def _detector(subpixel: bool = True, threshold: int = 15) -> CornerDetector:
    return CornerDetector(
        GRID,
        fast_threshold=threshold,
        min_distance_px=DISTANCE,
        border_px=8,
        subpixel=subpixel,
    )


def _quotas(value: int) -> CellQuotas:
    return CellQuotas(np.full(GRID.shape, value, np.int64))


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(0, 400),
    quota=st.integers(0, 12),
    budget=st.integers(0, 80),
    distance=st.floats(1.0, 60.0),
)
def test_selection_keeps_every_rule(
    seed: int, count: int, quota: int, budget: int, distance: float
) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.integers([0, 0], [WIDTH, HEIGHT], (count, 2)).astype(np.float64)
    responses = rng.integers(10, 60, count).astype(np.float64)
    need = rng.integers(0, quota + 1, GRID.rows * GRID.columns).astype(np.int64)
    cells = GRID.cell_of(corners)
    chosen = select_by_need(Corners(corners, responses, cells, GRID, distance), need, budget)
    assert len(chosen) <= budget
    assert len(set(chosen.tolist())) == len(chosen)
    served = np.bincount(cells[chosen], minlength=len(need))
    assert (served <= need).all()
    if len(chosen) > 1:
        assert pdist(corners[chosen]).min() >= distance
    if len(chosen) < budget:  # whatever was left out would have broken a rule
        left = np.setdiff1d(np.arange(count), chosen)
        left = left[(need - served)[cells[left]] > 0]
        assert (
            len(left) == 0 or (cdist(corners[left], corners[chosen]).min(axis=1) < distance).all()
        )


def test_the_largest_need_is_served_first_and_in_it_the_strongest() -> None:
    corners = np.array([[10.0, 10.0], [40.0, 10.0], [10.0, 50.0], [100.0, 10.0], [130.0, 40.0]])
    responses = np.array([1.0, 5.0, 3.0, 90.0, 80.0])
    need = np.zeros(12, np.int64)
    need[:2] = 3, 2

    def chosen(budget: int) -> list[int]:
        cells = GRID.cell_of(corners)
        return list(select_by_need(Corners(corners, responses, cells, GRID, 10.0), need, budget))

    assert chosen(1) == [1]
    assert chosen(2) == [1, 3]  # now both need 2: the stronger corner
    assert chosen(5) == [1, 3, 2, 4, 0]


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 50), quota=st.integers(0, 8), kept=st.integers(0, 60))
def test_new_features_respect_distance_quota_cap_and_border(
    seed: int, quota: int, kept: int
) -> None:
    rng = np.random.default_rng(seed)
    old = rng.uniform([0, 0], [WIDTH - 1, HEIGHT - 1], (kept, 2))
    new = _detector().detect(texture(seed % 5), old, _quotas(quota), 50)
    everything = np.concatenate([new, old])
    if len(new) and len(everything) > 1:
        distances = cdist(new, everything)
        np.fill_diagonal(distances, np.inf)
        assert distances.min() >= DISTANCE
    assert len(new) <= max(0, 50 - kept)
    assert (GRID.count(new) <= np.maximum(quota - GRID.count(old), 0)).all()
    assert (new >= 8).all()
    assert (new <= [WIDTH - 9, HEIGHT - 9]).all()


def test_quotas_are_filled_where_the_texture_allows() -> None:
    quotas = np.zeros(GRID.shape, np.int64)
    quotas[1, 2], quotas[2, 0] = 5, 3
    new = _detector().detect(texture(), np.zeros((0, 2)), CellQuotas(quotas), 200)
    np.testing.assert_array_equal(GRID.count(new), quotas)


def test_nothing_is_asked_for_nothing_comes() -> None:
    old = np.column_stack([np.full(20, 50.0), np.full(20, 50.0)])
    assert len(_detector().detect(texture(), old, _quotas(0), 200)) == 0
    assert len(_detector().detect(texture(), old, _quotas(4), 20)) == 0


def test_mask() -> None:
    allowed = np.zeros((HEIGHT, WIDTH), np.bool_)
    allowed[:, :100] = True
    detector = _detector()
    new = detector.detect(texture(), np.zeros((0, 2)), _quotas(8), 200, allowed)
    assert len(new) > 10
    assert (new[:, 0] < 99.5).all()
    assert detector.corner_counts[:, 2:].sum() == 0


@pytest.mark.parametrize("grey", [0, 128])
def test_no_texture_no_features(grey: int) -> None:
    blank = np.full((HEIGHT, WIDTH), grey, np.uint8)
    assert _detector().detect(blank, np.zeros((0, 2)), _quotas(4), 50).shape == (0, 2)


def test_subpixel_refinement_finds_the_corner() -> None:
    corner = np.array([100.3, 80.7])
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    soft = 1 / (1 + np.exp(-4 * (u - corner[0]))) / (1 + np.exp(-4 * (v - corner[1])))
    image = (30 + 180 * soft).astype(np.uint8)

    def error(subpixel: bool) -> float:
        new: FloatArray = _detector(subpixel).detect(image, np.zeros((0, 2)), _quotas(1), 10)
        assert len(new) == 1
        return float(np.linalg.norm(new[0] - corner))

    assert error(True) < 0.5 * error(False)
