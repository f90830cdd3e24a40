from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from p2gd_fgo.distribution import GridDistribution
from p2gd_fgo.frontend import CellGrid
from p2gd_fgo.types import IntArray


def _quotas(grid: CellGrid, features: int, distance: float) -> IntArray:
    return GridDistribution(grid, features).quotas(grid.capacities(distance))


def test_the_papers_settings() -> None:
    quotas = _quotas(CellGrid(10, 6, 1280, 560), 180, 40.0)
    np.testing.assert_array_equal(quotas, np.full((6, 10), 3))


def test_a_remainder_is_spread_through_the_image() -> None:
    quotas = _quotas(CellGrid(8, 6, 800, 600), 150, 30.0)
    assert quotas.sum() == 150
    assert set(quotas.ravel().tolist()) == {3, 4}
    rows, columns = np.nonzero(quotas == 4)
    assert rows.min() < 2
    assert rows.max() > 3
    assert len(set(columns.tolist())) > 1


@given(
    columns=st.integers(1, 12),
    rows=st.integers(1, 9),
    features=st.integers(8, 600),
    distance=st.floats(5.0, 200.0),
)
def test_even_capped_and_complete(columns: int, rows: int, features: int, distance: float) -> None:
    grid = CellGrid(columns, rows, 640, 480)
    quotas = _quotas(grid, features, distance)
    capacity = grid.capacity(distance)
    assert quotas.shape == (rows, columns)
    assert quotas.max() - quotas.min() <= 1
    assert quotas.max() <= capacity
    if -(-features // (columns * rows)) <= capacity:
        assert quotas.sum() == features


def test_masked_cells_ask_for_nothing() -> None:
    grid = CellGrid(4, 3, 640, 480)
    allowed = np.ones((480, 640), np.bool_)
    allowed[:160, :240] = False  # one cell, and the left half of the next
    capacity = grid.capacities(20.0, allowed)
    np.testing.assert_array_equal(capacity[0], [0, 32, 64, 64])
    quotas = GridDistribution(grid, 12 * 40).quotas(capacity)
    np.testing.assert_array_equal(quotas[0], [0, 32, 40, 40])
    assert (quotas[1:] == 40).all()
