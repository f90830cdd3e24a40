from __future__ import annotations

import numpy as np
import pytest

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
