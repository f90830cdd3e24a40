from __future__ import annotations

import itertools

import numpy as np
import pytest

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.distribution.p2gd.allocate import proportional
from p2gd_fgo.distribution.p2gd.d_optimal import d_optimal
from p2gd_fgo.distribution.p2gd.information import (
    cell_information,
    imu_information,
    pose_information,
)
from p2gd_fgo.distribution.p2gd.predict import predict_tracks
from p2gd_fgo.distribution.p2gd.weigh import cell_means, total_parallax
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation, transform
from p2gd_fgo.types import FloatArray, IntArray

PRIOR = imu_information(ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4), 2.0)
FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # camera looks along x
CAMERA = RadTanCamera(1200, 400, 700.0, 700.0, 600.0, 200.0, 0.0, 0.0, 0.0, 0.0)


def log_det(information: FloatArray, prior: FloatArray, quotas: IntArray) -> float:
    total = prior + np.tensordot(quotas, information, axes=1)
    return float(np.linalg.slogdet(total)[1])


def best_gain(
    information: FloatArray, prior: FloatArray, capacity: IntArray, total: int
) -> tuple[float, IntArray]:
    """Gain of the best of all allocations."""
    nothing = log_det(information, prior, np.zeros(len(capacity), np.int64))
    choices = (
        np.array(quotas)
        for quotas in itertools.product(*(range(c + 1) for c in capacity))
        if sum(quotas) == total
    )
    gains = [(log_det(information, prior, q) - nothing, q) for q in choices]
    return max(gains, key=lambda pair: pair[0])


def random_information(rng: np.random.Generator, cells: int, rank: int) -> FloatArray:
    factors = rng.normal(size=(cells, 6, rank)) * rng.lognormal(0.0, 0.3, (cells, 1, 1))
    return np.asarray(factors @ factors.transpose(0, 2, 1))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rank", [1, 3])
def test_no_allocation_is_much_better(seed: int, rank: int) -> None:
    rng = np.random.default_rng(seed)
    information = random_information(rng, 5, rank)
    prior = np.diag(rng.lognormal(-1.0, 1.0, 6))
    capacity = np.array([2, 3, 1, 3, 2])
    quotas = d_optimal(information, prior, capacity, 6)
    assert quotas.sum() == 6
    assert (quotas <= capacity).all()
    gain = log_det(information, prior, quotas) - log_det(information, prior, 0 * quotas)
    best, _ = best_gain(information, prior, capacity, 6)
    assert gain >= 0.98 * best  # guaranteed: 0.63


def street() -> tuple[FloatArray, FloatArray, IntArray]:
    """A drive straight on in 20 images: near walls at both sides, a far house ahead.

    Returns the points, the camera poses, and the column (of 12) that each point is in.
    """
    rng = np.random.default_rng(3)
    cameras = np.tile(from_rotation_translation(FORWARD, np.zeros(3)), (21, 1, 1))
    cameras[:, 0, 3] = 0.8 * np.arange(21)
    columns = np.repeat(np.arange(12), 8)
    u = (columns + rng.uniform(0.1, 0.9, len(columns))) * 100.0
    x = (u - CAMERA.cx) / CAMERA.fx
    y = rng.uniform(-0.25, 0.25, len(u))
    near = abs(x) > 0.15
    depth = np.where(near, 5.0 / np.maximum(abs(x), 0.1), 55.0)
    return (
        transform(cameras[0], np.column_stack([x, y, np.ones_like(x)]) * depth[:, None]),
        (cameras),
        columns,
    )


def test_on_a_street_nothing_is_better() -> None:
    points, cameras, columns = street()
    tracks = predict_tracks(points, cameras, CAMERA)
    information = pose_information(points, cameras, tracks.visible, 1.0 / CAMERA.fx)
    cells = cell_information(information, columns // 2, 6)
    capacity = np.full(6, 4)
    for total in (3, 8, 12):
        quotas = d_optimal(cells, PRIOR, capacity, total)
        gain = log_det(cells, PRIOR, quotas) - log_det(cells, PRIOR, 0 * quotas)
        assert gain >= 0.99 * best_gain(cells, PRIOR, capacity, total)[0]


def test_far_cells_stay_in_play_where_total_parallax_starves_them() -> None:
    points, cameras, columns = street()
    tracks = predict_tracks(points, cameras, CAMERA)
    capacity = np.full(12, 8)
    far = np.array([5, 6])
    weights = cell_means(total_parallax(points, tracks), columns, (1, 12)).ravel()
    by_parallax = proportional(weights, capacity, 30)
    information = pose_information(points, cameras, tracks.visible, 1.0 / CAMERA.fx)
    cells = cell_information(information, columns, 12)
    quotas = d_optimal(cells, PRIOR, capacity, 30)
    assert quotas.sum() == by_parallax.sum() == 30
    assert by_parallax[far].sum() <= 1
    assert quotas[far].sum() >= 5
    assert quotas[[0, 1, 2, 3, 4]].sum() > 0 < quotas[[7, 8, 9, 10, 11]].sum()
    imu, parallax, optimal = (_rotation_sigma(cells, q) for q in (0 * quotas, by_parallax, quotas))
    assert imu - optimal > 2.0 * (imu - parallax) > 0.0


def _rotation_sigma(cells: FloatArray, quotas: IntArray) -> float:
    covariance = np.linalg.inv(PRIOR + np.tensordot(quotas, cells, axes=1))
    return float(np.sqrt(np.trace(covariance[:3, :3])))


def test_returns_diminish() -> None:
    """The strong cell doesn't take all: the weak one is the only one to know its direction."""
    information = np.zeros((2, 6, 6))
    information[0, 0, 0], information[1, 1, 1] = 1000.0, 1.0
    quotas = d_optimal(information, np.eye(6), np.array([100, 100]), 100)
    np.testing.assert_array_equal(quotas, [50, 50])


def test_equal_cells_are_served_from_the_first() -> None:
    information = np.tile(np.eye(6), (4, 1, 1))
    quotas = d_optimal(information, np.eye(6), np.array([2, 2, 2, 2]), 5)
    np.testing.assert_array_equal(quotas, [2, 2, 1, 0])


def test_cells_without_information_get_nothing_and_the_caps_hold() -> None:
    information = np.tile(np.eye(6), (4, 1, 1)) * np.array([1.0, 0.0, 2.0, 5.0])[:, None, None]
    capacity = np.array([3, 9, 2, 0])
    np.testing.assert_array_equal(d_optimal(information, np.eye(6), capacity, 30), [3, 0, 2, 0])
    np.testing.assert_array_equal(d_optimal(information, np.eye(6), capacity, 0), [0, 0, 0, 0])
    np.testing.assert_array_equal(capacity, [3, 9, 2, 0])


def test_units_do_not_matter() -> None:
    """Determinants of 1e60 or 1e-60 are nothing special, and metres are as good as millimetres."""
    rng = np.random.default_rng(5)
    information, capacity = random_information(rng, 8, 3), np.full(8, 6)
    expected = d_optimal(information, np.eye(6), capacity, 20)
    units = np.diag([1e5, 1e5, 1e5, 1e-4, 1e-4, 1e-4])
    for factor in (1.0, 1e40, 1e-40):
        scaled = factor * (units @ information @ units)
        actual = d_optimal(scaled, factor * (units @ units), capacity, 20)
        np.testing.assert_array_equal(actual, expected)
