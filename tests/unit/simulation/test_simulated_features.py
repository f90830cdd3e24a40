"""Simulated tracks: on their landmarks but for the noise, the losses and the outliers ordered."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from p2gd_fgo.geometry.pose import inverse, transform
from p2gd_fgo.simulation.demo import DemoParameters, demo_calibration
from p2gd_fgo.simulation.features import (
    ROBOT_FEATURES,
    FeatureModel,
    scatter_landmarks,
    simulate_features,
)
from p2gd_fgo.simulation.routes import ROBOT, make_route
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Observations

CALIBRATION = demo_calibration(DemoParameters())
STAMPS: IntArray = NANOSECONDS + NANOSECONDS // 10 * np.arange(300)
CLEAN = replace(ROBOT_FEATURES, pixel_noise_px=0.0)


@pytest.fixture(scope="module")
def route() -> SplineTrajectory:
    return make_route(ROBOT, 30.0, np.random.default_rng(8))


@pytest.fixture(scope="module")
def standing() -> SplineTrajectory:
    t = NANOSECONDS * np.arange(0, 40)
    return SplineTrajectory(t, np.zeros((len(t), 3)), np.tile(np.eye(3), (len(t), 1, 1)))


def simulate(
    trajectory: SplineTrajectory, model: FeatureModel, seed: int = 0
) -> list[Observations]:
    camera, T_imu_cam = CALIBRATION.camera, CALIBRATION.T_imu_cam
    rng = np.random.default_rng(seed)
    return simulate_features(trajectory, STAMPS, camera, T_imu_cam, model, rng)


def landmark_of(
    trajectory: SplineTrajectory, frames: list[Observations], model: FeatureModel
) -> list[tuple[IntArray, FloatArray]]:
    """For each frame: the nearest landmark of each observation, and its distance in px."""
    landmarks = scatter_landmarks(trajectory, model, np.random.default_rng(0))
    poses = trajectory.sample(STAMPS).T_world_imu @ CALIBRATION.T_imu_cam
    found = []
    for frame, T in zip(frames, poses, strict=True):
        points = transform(inverse(T), landmarks)
        ahead = np.flatnonzero((points[:, 2] > 0.5) & (points[:, 2] < model.max_range_m))
        pixels = CALIBRATION.camera.project(points[ahead])
        distance = np.linalg.norm(frame.pixels[:, None] - pixels, axis=-1)
        nearest = distance.argmin(axis=1)
        found.append((ahead[nearest], distance[np.arange(len(frame)), nearest]))
    return found


def tracks(frames: list[Observations]) -> dict[int, list[int]]:
    """The frames in which each track was seen."""
    seen: dict[int, list[int]] = defaultdict(list)
    for k, frame in enumerate(frames):
        for track in frame.ids.tolist():
            seen[track].append(k)
    return seen


def test_a_track_stays_on_one_landmark(route: SplineTrajectory) -> None:
    frames = simulate(route, CLEAN)
    landmark: dict[int, int] = {}
    for frame, (nearest, distance) in zip(frames, landmark_of(route, frames, CLEAN), strict=True):
        assert distance.max() < 1e-9
        for track, index in zip(frame.ids.tolist(), nearest.tolist(), strict=True):
            assert landmark.setdefault(track, index) == index
        assert len(np.unique(nearest)) == len(nearest)


def test_observations_are_whole(route: SplineTrajectory) -> None:
    frames = simulate(route, ROBOT_FEATURES)
    assert [frame.stamp_ns for frame in frames] == STAMPS.tolist()
    for frame in frames:
        assert len(np.unique(frame.ids)) == len(frame) <= ROBOT_FEATURES.features
        undistorted = CALIBRATION.camera.undistort(frame.pixels)
        np.testing.assert_array_equal(frame.normalized, undistorted)
    assert np.median([len(frame) for frame in frames]) == ROBOT_FEATURES.features


def test_noise_is_white_and_of_its_size(route: SplineTrajectory) -> None:
    model = replace(ROBOT_FEATURES, pixel_noise_px=0.7)
    noisy, clean = simulate(route, model), simulate(route, CLEAN)
    errors = []
    for a, b in zip(noisy, clean, strict=True):
        np.testing.assert_array_equal(a.ids, b.ids)
        errors.append(a.pixels - b.pixels)
    error = np.concatenate(errors)
    np.testing.assert_allclose(error.std(0), 0.7, rtol=0.02)
    np.testing.assert_allclose(error.mean(0), 0.0, atol=0.02)
    assert abs(np.mean(error[:, 0] * error[:, 1])) < 0.02


def test_an_id_is_one_track_without_holes_and_of_limited_length(route: SplineTrajectory) -> None:
    model = replace(ROBOT_FEATURES, max_track_length=7, survival=0.99)
    lengths = []
    for seen in tracks(simulate(route, model)).values():
        assert seen == list(range(seen[0], seen[-1] + 1))
        lengths.append(len(seen))
    assert max(lengths) == 7
    assert np.mean(np.array(lengths) == 7) > 0.5


@pytest.mark.parametrize("survival", [0.8, 0.95])
def test_tracks_survive_by_their_chance(standing: SplineTrajectory, survival: float) -> None:
    model = replace(CLEAN, survival=survival, max_track_length=1000)
    frames = simulate(standing, model)
    kept = [np.isin(a.ids, b.ids).mean() for a, b in pairwise(frames)]
    assert np.mean(kept) == pytest.approx(survival, abs=0.01)


def test_the_share_of_outliers_and_their_reach(standing: SplineTrajectory) -> None:
    model = replace(CLEAN, outlier_share=0.2, survival=0.97)
    frames = simulate(standing, model)
    first: dict[int, FloatArray] = {}
    last: dict[int, FloatArray] = {}
    for frame in frames:
        for track, pixel in zip(frame.ids.tolist(), frame.pixels, strict=True):
            first.setdefault(track, pixel)
            last[track] = pixel
    shift = {k: np.abs(last[k] - first[k]).max() for k, s in tracks(frames).items() if len(s) > 5}
    moved = np.array(list(shift.values()))
    assert np.mean(moved > 1e-6) == pytest.approx(0.2, abs=0.03)
    assert 40.0 < moved.max() <= 50.0 + 1e-6


def test_the_generator_decides(route: SplineTrajectory) -> None:
    a, b, c = (simulate(route, ROBOT_FEATURES, seed) for seed in (3, 3, 4))
    for one, two in zip(a, b, strict=True):
        np.testing.assert_array_equal(one.ids, two.ids)
        np.testing.assert_array_equal(one.pixels, two.pixels)
    assert not np.array_equal(a[0].pixels, c[0].pixels)
