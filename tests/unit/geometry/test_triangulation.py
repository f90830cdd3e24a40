from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse, transform
from p2gd_fgo.geometry.triangulation import Triangulation, acceptable, triangulate
from p2gd_fgo.types import BoolArray, FloatArray


def _acceptable(t: Triangulation, max_condition: float = 1e4) -> BoolArray:
    return acceptable(
        t,
        min_views=3,
        max_condition=max_condition,
        min_depth=0.05,
        max_depth=60.0,
        max_residual=0.01,
    )


def _views(rng: np.random.Generator, count: int, start: float = 0.0) -> FloatArray:
    """Cameras along x, looking along z, a bit turned."""
    R = so3.exp(rng.normal(0.0, 0.1, (count, 3)))
    p = np.column_stack([start + 0.5 * np.arange(count), rng.normal(0, 0.1, (count, 2))])
    return from_rotation_translation(R, p)


def _sightings(points: FloatArray, views: FloatArray) -> FloatArray:
    local = np.array([transform(inverse(T), points) for T in views]).swapaxes(0, 1)
    return np.asarray(local[..., :2] / local[..., 2:])


@given(seed=st.integers(0, 10_000), start=st.sampled_from([0.0, 1e5]))
def test_exact_sightings_give_exact_points(seed: int, start: float) -> None:
    rng = np.random.default_rng(seed)
    views = _views(rng, 6, start)
    points = rng.uniform([-3, -2, 4], [6, 2, 20], (25, 3)) + np.array([start, 0, 0])
    sightings = _sightings(points, views)
    sightings[rng.random((25, 6)) < 0.3] = np.nan
    t = triangulate(sightings, views)
    seen = np.isfinite(sightings[..., 0])
    np.testing.assert_array_equal(t.views, seen.sum(1))
    enough = t.views >= 2
    np.testing.assert_allclose(t.points[enough], points[enough], atol=1e-6)
    assert np.isnan(t.points[~enough]).all()
    assert (t.residual[enough] < 1e-7).all()
    z = np.array([transform(inverse(T), points)[:, 2] for T in views]).T
    np.testing.assert_allclose(t.depth[enough], np.where(seen, z, np.inf).min(1)[enough], atol=1e-6)
    np.testing.assert_allclose(t.distance[enough], z[enough, -1], atol=1e-6)


def test_the_point_is_the_nearest_to_the_rays() -> None:
    rng = np.random.default_rng(3)
    views = _views(rng, 5)
    truth = np.array([[1.0, 0.5, 8.0]])
    sightings = _sightings(truth, views) + rng.normal(0, 0.005, (1, 5, 2))

    def cost(p: FloatArray) -> float:
        total = 0.0
        for T, xy in zip(views, sightings[0], strict=True):
            d = T[:3, :3] @ np.append(xy, 1.0)
            d /= np.linalg.norm(d)
            away = p - T[:3, 3]
            total += float(np.sum((away - d * (d @ away)) ** 2))
        return total

    found = triangulate(sightings, views)
    best = cost(found.points[0])
    for step in np.concatenate([np.eye(3), -np.eye(3)]):
        assert cost(found.points[0] + 1e-4 * step) > best
    miss = _sightings(found.points, views) - sightings
    assert found.residual[0] == pytest.approx(np.sqrt((miss**2).sum(-1).mean()))


def test_without_parallax_there_is_no_point() -> None:
    rng = np.random.default_rng(0)
    R = so3.exp(rng.normal(0.0, 0.1, (5, 3)))
    turning = from_rotation_translation(R, np.zeros((5, 3)))
    t = triangulate(_sightings(np.array([[1.0, 1.0, 9.0]]), turning), turning)
    assert not _acceptable(t).any()


def test_each_limit_refuses() -> None:
    rng = np.random.default_rng(1)
    views = _views(rng, 6)
    points = np.array([[1.0, 0.0, 8.0], [1.0, 0.0, 8.0], [2.0, 1.0, 90.0], [1.0, 0.0, 8.0]])
    sightings = _sightings(points, views)
    sightings[1, 2:] = np.nan  # two views
    sightings[3, 0] += 0.2  # inconsistent
    np.testing.assert_array_equal(
        _acceptable(triangulate(sightings, views)), [True, False, False, False]
    )
    behind = _sightings(np.array([[1.0, 0.5, -8.0]]), views)
    assert not _acceptable(triangulate(behind, views)).any()
    assert not _acceptable(triangulate(sightings[:1], views), 5.0).any()


def test_nothing_in_nothing_out() -> None:
    t = triangulate(np.zeros((0, 4, 2)), np.tile(np.eye(4), (4, 1, 1)))
    assert t.points.shape == (0, 3)
    assert _acceptable(t).shape == (0,)
