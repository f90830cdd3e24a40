from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2gd_fgo.config import DistributionConfig
from p2gd_fgo.distribution import DistributionContext, GridDistribution, make_distribution
from p2gd_fgo.frontend import CellGrid, FeatureBuffer
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.types import Trajectory


@pytest.fixture
def context() -> DistributionContext:
    camera = RadTanCamera(800, 600, 500.0, 500.0, 400.0, 300.0, 0.0, 0.0, 0.0, 0.0)
    nowhere = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    return DistributionContext(camera, np.eye(4), FeatureBuffer(5), nowhere, None, None)


def test_the_papers_settings(context: DistributionContext) -> None:
    distribution = make_distribution(DistributionConfig(), CellGrid(10, 6, 1280, 560), 180, 40.0)
    np.testing.assert_array_equal(distribution.quotas(context), np.full((6, 10), 3))


def test_a_remainder_is_spread_through_the_image(context: DistributionContext) -> None:
    quotas = GridDistribution(CellGrid(8, 6, 800, 600), 150, 30.0).quotas(context)
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
    quotas = GridDistribution(grid, features, distance)._quotas
    capacity = grid.capacity(distance)
    assert quotas.shape == (rows, columns)
    assert quotas.max() - quotas.min() <= 1
    assert quotas.max() <= capacity
    if -(-features // (columns * rows)) <= capacity:
        assert quotas.sum() == features


def test_the_answer_is_the_callers_to_change(context: DistributionContext) -> None:
    distribution = GridDistribution(CellGrid(4, 3, 640, 480), 60, 20.0)
    distribution.quotas(context)[:] = 0
    assert distribution.quotas(context).sum() == 60
