from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2gd_fgo.frontend.cells import CellGrid


def test_cells_follow_the_papers_equation() -> None:
    grid = CellGrid(10, 6, 1280, 560)
    pixels = np.array([[0.0, 0.0], [127.99, 93.0], [128.0, 93.4], [1279.0, 559.0]])
    assert grid.cell_of(pixels).tolist() == [0, 0, 11, 59]
    assert grid.shape == (6, 10)


def test_a_pixel_outside_counts_for_the_nearest_cell() -> None:
    grid = CellGrid(4, 3, 320, 240)
    assert grid.cell_of(np.array([[-5.0, 500.0], [400.0, -1.0]])).tolist() == [8, 3]


def test_count_adds_up() -> None:
    grid = CellGrid(4, 3, 320, 240)
    pixels = np.random.default_rng(0).uniform([0, 0], [319, 239], (500, 2))
    count = grid.count(pixels)
    assert count.shape == (3, 4)
    assert count.sum() == 500
    assert grid.count(np.zeros((0, 2))).sum() == 0


@pytest.mark.parametrize(
    ("grid", "distance", "capacity"),
    [
        (CellGrid(10, 6, 1280, 560), 40.0, 7),  # the paper's KAIST settings
        (CellGrid(8, 6, 800, 600), 30.0, 11),  # and those of its robot
        (CellGrid(8, 6, 800, 600), 500.0, 1),
    ],
)
def test_capacity(grid: CellGrid, distance: float, capacity: int) -> None:
    assert grid.capacity(distance) == capacity


@given(
    columns=st.integers(1, 15),
    rows=st.integers(1, 12),
    width=st.integers(16, 130),
    height=st.integers(12, 110),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
def test_capacities_count_what_the_mask_leaves_of_each_cell(
    columns: int, rows: int, width: int, height: int, share: float, seed: int
) -> None:
    grid = CellGrid(columns, rows, width, height)
    allowed = np.random.default_rng(seed).random((height, width)) < share
    cells = grid.cell_of(np.argwhere(np.ones_like(allowed))[:, ::-1].astype(np.float64))
    found = grid.capacities(3.0, allowed).ravel()
    for cell in range(columns * rows):
        inside = allowed.ravel()[cells == cell]
        assert found[cell] == np.ceil(grid.capacity(3.0) * inside.mean())
