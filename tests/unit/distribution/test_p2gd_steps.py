"""Each step of P2GD against its equation, written out slowly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2gd_fgo.distribution.p2gd.allocate import proportional
from p2gd_fgo.distribution.p2gd.predict import predict_tracks, predicted_cameras
from p2gd_fgo.distribution.p2gd.weigh import cell_means, total_parallax, track_length
from p2gd_fgo.frontend import CellGrid
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse
from p2gd_fgo.types import FloatArray, IntArray

CAMERA = RadTanCamera(640, 480, 400.0, 410.0, 321.0, 238.0, -0.2, 0.05, 1e-3, -2e-3)


def _cameras(rng: np.random.Generator, count: int) -> FloatArray:
    """A camera that drives along its axis and turns."""
    step = from_rotation_translation(
        so3.exp(np.array([0.0, rng.normal(0, 0.03), 0.0])), np.array([0.02, 0.0, 0.5])
    )
    poses = [from_rotation_translation(so3.exp(rng.normal(0, 1, 3)), rng.normal(0, 5, 3))]
    for _ in range(count):
        poses.append(poses[-1] @ step)
    return np.array(poses)


def _points(rng: np.random.Generator, camera: FloatArray, count: int) -> FloatArray:
    local = rng.uniform([-8, -5, -2], [8, 5, 30], (count, 3))
    return np.asarray(local @ camera[:3, :3].T + camera[:3, 3])


@given(seed=st.integers(0, 10_000))
def test_predicted_cameras_are_eq_1(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R = so3.exp(rng.normal(0, 1, (5, 3)))
    p = rng.normal(0, 3, (5, 3))
    world, extrinsic = from_rotation_translation(R[:2], p[:2])
    priors = from_rotation_translation(R[2:], p[2:])
    out = predicted_cameras(world, priors, extrinsic)
    for i in range(3):  # paper eq. 1, term by term
        np.testing.assert_allclose(out[i + 1, :3, :3], R[0] @ R[2 + i] @ R[1])
        position = R[0] @ p[2 + i] + p[0] + R[0] @ R[2 + i] @ p[1]
        np.testing.assert_allclose(out[i + 1, :3, 3], position, atol=1e-12)
    np.testing.assert_allclose(out[0], world @ extrinsic)


@given(seed=st.integers(0, 10_000))
def test_tracks_follow_eqs_4_and_5_up_to_the_first_loss(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cameras = _cameras(rng, 8)
    points = _points(rng, cameras[0], 30)
    tracks = predict_tracks(points, cameras, CAMERA)
    for j, point in enumerate(points):
        lost = False
        for i, T in enumerate(cameras):
            x, y, z = (inverse(T) @ np.append(point, 1.0))[:3]
            if z > 0.05 and not lost:
                x, y = x / z, y / z
                r2 = x * x + y * y
                d = 1 - 0.2 * r2 + 0.05 * r2 * r2
                u = 400.0 * (x * d + 2 * 1e-3 * x * y - 2e-3 * (r2 + 2 * x * x)) + 321.0
                v = 410.0 * (y * d - 2 * 2e-3 * x * y + 1e-3 * (r2 + 2 * y * y)) + 238.0
                inside = 0 <= u <= 639 and 0 <= v <= 479 and math.sqrt(r2) < CAMERA.max_radius
            lost = lost or z <= 0.05 or not inside
            assert tracks.visible[j, i] == (not lost)
            if lost:
                assert np.isnan(tracks.pixels[j, i]).all()
            else:
                np.testing.assert_allclose(tracks.pixels[j, i], [u, v], atol=1e-9)
        assert tracks.lengths[j] == max(tracks.visible[j].sum() - 1, 0)


@given(seed=st.integers(0, 10_000))
def test_total_parallax_is_eq_6(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cameras = _cameras(rng, 8)
    points = _points(rng, cameras[0], 20)
    tracks = predict_tracks(points, cameras, CAMERA)
    values = total_parallax(points, tracks)
    literal = total_parallax(points, tracks, into_loss=True)
    for j, point in enumerate(points):
        expected = 0.0
        seen_now = bool(tracks.visible[j, 0])
        for i in range(min(tracks.lengths[j] + seen_now, 8)):
            if i == tracks.lengths[j]:
                assert values[j] == pytest.approx(expected, abs=1e-6)
            here = (inverse(cameras[i]) @ np.append(point, 1.0))[:3]
            there = (inverse(cameras[i + 1]) @ np.append(point, 1.0))[:3]
            turned = cameras[i + 1, :3, :3].T @ cameras[i, :3, :3] @ here
            cosine = turned @ there / np.linalg.norm(turned) / np.linalg.norm(there)
            expected += math.acos(min(cosine, 1.0))
        assert literal[j] == pytest.approx(expected, abs=1e-6)
    np.testing.assert_array_equal(track_length(tracks), tracks.lengths)


def test_a_point_nearer_than_5_cm_is_lost_though_it_is_in_the_image() -> None:
    cameras = np.tile(np.eye(4), (4, 1, 1))
    cameras[1:, 2, 3] = 0.2, 0.28, 0.1
    tracks = predict_tracks(np.array([[0.0, 0.0, 0.3]]), cameras, CAMERA)
    np.testing.assert_array_equal(tracks.visible, [[True, True, False, False]])


def test_a_point_that_comes_back_stays_lost() -> None:
    R = so3.exp(np.column_stack([np.zeros(4), [0.0, 0.1, 1.5, 0.0], np.zeros(4)]))
    cameras = from_rotation_translation(R, np.zeros((4, 3)))
    tracks = predict_tracks(np.array([[0.0, 0.0, 5.0]]), cameras, CAMERA)
    np.testing.assert_array_equal(tracks.visible, [[True, True, False, False]])
    assert np.isnan(tracks.pixels[0, 3]).all()
    assert tracks.lengths.tolist() == [1]


def test_pure_rotation_is_worth_nothing() -> None:
    R = so3.exp(np.column_stack([np.zeros(6), np.linspace(0, 0.2, 6), np.zeros(6)]))
    cameras = from_rotation_translation(R, np.zeros((6, 3)))
    points = np.array([[0.5, 0.1, 4.0], [-1.0, 0.2, 9.0]])
    tracks = predict_tracks(points, cameras, CAMERA)
    assert (tracks.lengths == 5).all()
    np.testing.assert_allclose(total_parallax(points, tracks), 0.0, atol=1e-12)


def test_cells_get_the_mean_of_their_points_and_zero_without_any() -> None:
    grid = CellGrid(4, 3, 640, 480)
    pixels = np.array([[0.0, 0.0], [159.0, 159.0], [161.0, 10.0], [639.0, 479.0]])
    weights = cell_means(np.array([1.0, 3.0, 5.0, 7.0]), grid.cell_of(pixels), grid.shape)
    expected = np.zeros((3, 4))
    expected[0, 0], expected[0, 1], expected[2, 3] = 2.0, 5.0, 7.0
    np.testing.assert_array_equal(weights, expected)


def _algorithm_1(weights: list[float], cap: int, total: int) -> list[int]:
    """The paper's Algorithm 1 by its prose, one cell after the other, in exact shares."""
    weight_left = sum(weights)
    left = total
    quotas = [0] * len(weights)
    order = sorted(range(len(weights)), key=lambda k: -weights[k])
    waiting = list(order)
    for k in order:
        if weights[k] == 0 or left == 0:
            break
        share = 1.0 if weight_left <= weights[k] * (1 + 1e-12) else weights[k] / weight_left
        quotas[k] = min(math.ceil(share * left - 1e-9), cap, left)
        weight_left -= weights[k]
        left -= quotas[k]
        waiting.remove(k)
    while left > 0 and waiting:
        k = waiting[0]
        quotas[k] = min(math.ceil(left / len(waiting)), cap, left)
        left -= quotas[k]
        waiting.remove(k)
    return quotas


sizes = st.lists(st.integers(0, 20).map(float), min_size=1, max_size=60)


@given(weights=sizes, cap=st.integers(1, 12), total=st.integers(0, 400))
def test_allocation_is_algorithm_1(weights: list[float], cap: int, total: int) -> None:
    capacity = np.full(len(weights), cap, np.int64)
    quotas = proportional(np.array(weights), capacity, total)
    assert quotas.tolist() == _algorithm_1(weights, cap, total)
    assert quotas.sum() == min(total, cap * len(weights))


@given(data=st.data(), weights=sizes, total=st.integers(0, 400))
def test_nothing_is_lost_whatever_the_caps(
    data: st.DataObject, weights: list[float], total: int
) -> None:
    caps = data.draw(st.lists(st.integers(0, 12), min_size=len(weights), max_size=len(weights)))
    capacity: IntArray = np.array(caps, np.int64)
    quotas = proportional(np.array(weights), capacity, total)
    assert (quotas >= 0).all()
    assert (quotas <= capacity).all()
    assert quotas.sum() == min(total, capacity.sum())


@given(weights=sizes, cap=st.integers(1, 12), total=st.integers(0, 400))
def test_more_weight_never_gets_fewer_features(weights: list[float], cap: int, total: int) -> None:
    quotas = proportional(np.array(weights), np.full(len(weights), cap, np.int64), total)
    order = np.argsort(-np.array(weights), kind="stable")
    positive = quotas[order][: np.count_nonzero(weights)]
    assert (np.diff(positive) <= 0).all()


def test_the_last_of_many_linear_weights_get_nothing() -> None:
    """The paper says that rounding up leaves no weighted cell at zero; it can."""
    quotas = proportional(np.arange(34, 0, -1.0), np.full(34, 20, np.int64), 60)
    assert quotas.sum() == 60
    assert (quotas[-2:] == 0).all()
