"""Tracking measures against scenes worked out by hand."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from p2gd_fgo.evaluation.tracking_quality import (
    CameraRotations,
    angles,
    camera_rotations,
    tracking_quality,
)
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray, TrackRecord, Trajectory

STEP_NS = 100_000_000


def record(images: list[dict[int, tuple[float, float]]], asked: int = 5) -> TrackRecord:
    """From one mapping of id to normalised point per image."""
    return TrackRecord(
        np.arange(len(images), dtype=np.int64) * STEP_NS,
        np.array([len(image) for image in images], dtype=np.int64),
        np.full(len(images), asked, dtype=np.int64),
        np.array([i for image in images for i in image], dtype=np.int64),
        np.array([p for image in images for p in image.values()]).reshape(-1, 2),
    )


def turned(R: FloatArray) -> CameraRotations:
    return CameraRotations("truth", np.ones(len(R), np.bool_), R)


def level(images: int) -> CameraRotations:
    return turned(np.tile(np.eye(3), (images, 1, 1)))


def seen(points: FloatArray, R_world_cam: FloatArray, p_world: FloatArray) -> TrackRecord:
    """Every point (P, 3) in every image (F, 3, 3), (F, 3)."""
    images = []
    for R, p in zip(R_world_cam, p_world, strict=True):
        cam = (points - p) @ R
        images.append({k: (q[0] / q[2], q[1] / q[2]) for k, q in enumerate(cam)})
    return record(images)


def test_angles_agree_with_the_arc_cosine_and_are_exact_below_it() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 500, 3)) * rng.uniform(0.1, 30.0, (2, 500, 1))
    cosine = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    np.testing.assert_allclose(angles(a, b), np.arccos(cosine), atol=1e-12)
    small = np.array([1e-12, 1e-9, 1e-6, 1e-3])
    turned = np.stack([np.sin(small), np.zeros(4), np.cos(small)], axis=1)
    ahead = np.tile([0.0, 0.0, 1.0], (4, 1))
    np.testing.assert_allclose(angles(3.0 * ahead, turned), small, rtol=1e-12)
    assert angles(ahead[:1], -ahead[:1]) == pytest.approx(np.pi)
    np.testing.assert_array_equal(angles(turned, turned), 0.0)


def test_driving_past_a_point() -> None:
    # Looking sideways at a point 1 m off, then 1 m and 2 m further on: it is seen straight ahead,
    # at 45 degrees and at atan 2.
    R = np.tile(np.eye(3), (3, 1, 1))
    p = np.array([[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    quality = tracking_quality(seen(np.array([[0.0, 0.0, 1.0]]), R, p), turned(R))
    total = math.degrees(math.atan(2.0))
    assert quality.total_parallax_deg == pytest.approx(total)
    assert quality.two_view_parallax_deg == pytest.approx(total / 3)
    assert quality.total_parallax_per_frame_deg == pytest.approx(total / 3)
    assert (quality.mean_length, quality.tracks, quality.pairs_left_out) == (3.0, 1, 0)


def test_turning_the_camera_changes_nothing_and_alone_is_no_parallax() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform([-4.0, -3.0, 5.0], [4.0, 3.0, 20.0], (30, 3))
    still = np.zeros((6, 3))
    R = so3.exp(np.cumsum(rng.normal(scale=0.03, size=(6, 3)), axis=0))
    assert tracking_quality(seen(points, R, still), turned(R)).total_parallax_deg < 1e-10
    wrong = np.swapaxes(R, 1, 2)
    assert tracking_quality(seen(points, R, still), turned(wrong)).total_parallax_deg > 1.0

    moving = np.cumsum(rng.uniform(0.0, 0.3, (6, 3)), axis=0)
    straight = np.tile(np.eye(3), (6, 1, 1))
    level_deg = tracking_quality(seen(points, straight, moving), turned(straight))
    turning_deg = tracking_quality(seen(points, R, moving), turned(R))
    assert turning_deg.total_parallax_deg == pytest.approx(level_deg.total_parallax_deg, rel=1e-9)


def test_white_noise_has_a_floor_that_grows_with_the_length() -> None:
    # Angle between two directions, each off by a normal (0, s) in two axes: a Rayleigh variable of
    # s √2, with mean s √2 √(π/2) = s √π.
    sigma, images, tracks = 1e-3, 20, 200
    rng = np.random.default_rng(2)
    noisy = rng.normal(scale=sigma, size=(images, tracks, 2))
    quality = tracking_quality(
        record([{k: tuple(xy) for k, xy in enumerate(image)} for image in noisy]), level(images)
    )
    floor_deg = math.degrees(sigma * math.sqrt(math.pi))
    assert quality.total_parallax_deg == pytest.approx((images - 1) * floor_deg, rel=0.02)


def test_which_tracks_count() -> None:
    # Track 0 lives all along and is alive at the end, 1 is seen once, 2 twice with an image
    # between, 3 once, in the last image.
    here = (0.0, 0.0)
    images = [{0: here, 1: here}, {0: here, 2: here}, {0: here}, {0: here, 2: (1.0, 0.0), 3: here}]
    quality = tracking_quality(record(images, asked=2), level(4))
    assert (quality.frames, quality.tracks) == (4, 4)
    assert quality.mean_length == pytest.approx(8 / 4)
    assert quality.length_shares == {1: 0.5, 5: 0.0, 10: 0.0, 15: 0.0, 20: 0.0}
    assert quality.single_frame_share == 0.5
    assert quality.total_parallax_deg == pytest.approx(45.0 / 4)
    assert quality.two_view_parallax_deg == pytest.approx(45.0 / 8)
    assert quality.total_parallax_per_frame_deg == pytest.approx(45.0 / 4)
    assert quality.features_per_frame == 2.0
    assert (quality.tracks_3_per_frame, quality.tracks_10_per_frame) == (0.25, 0.0)
    assert quality.quota_asked_per_frame == 2.0
    assert quality.quota_served_per_frame == pytest.approx((2 + 2 + 1 + 2) / 4)


def test_shares_are_of_exact_lengths() -> None:
    lengths = {0: 20, 1: 20, 2: 19, 3: 15, 4: 10, 5: 9, 6: 5, 7: 1}
    images = [{k: (0.0, 0.0) for k, n in lengths.items() if image < n} for image in range(20)]
    quality = tracking_quality(record(images), level(20))
    assert quality.length_shares == {1: 1 / 8, 5: 1 / 8, 10: 1 / 8, 15: 1 / 8, 20: 2 / 8}
    assert (quality.tracks_3_per_frame, quality.tracks_10_per_frame) == (7 / 20, 5 / 20)


def test_images_without_a_rotation_are_left_out_and_counted() -> None:
    images = [{0: (float(k), 0.0), 1: (0.0, 0.0)} for k in range(4)]
    known = np.array([True, True, False, True])
    rotations = CameraRotations("truth", known, np.tile(np.eye(3), (4, 1, 1)))
    quality = tracking_quality(record(images), rotations)
    assert (quality.frames_without_rotation, quality.pairs_left_out) == (1, 4)
    assert quality.mean_length == 4.0
    assert quality.total_parallax_deg == pytest.approx(45.0 / 2)
    assert quality.two_view_parallax_deg == pytest.approx(45.0 / 6)
    assert quality.total_parallax_per_frame_deg == pytest.approx(45.0 / 3)


def test_without_rotations_or_images_there_is_no_number() -> None:
    unknown = CameraRotations("estimate", np.zeros(2, np.bool_), np.tile(np.eye(3), (2, 1, 1)))
    quality = tracking_quality(record([{0: (0.0, 0.0)}, {0: (1.0, 0.0)}]), unknown)
    assert quality.mean_length == 2.0 and math.isnan(quality.total_parallax_deg)
    nothing = tracking_quality(record([]), level(0))
    assert nothing.tracks == 0 and math.isnan(nothing.mean_length)
    assert math.isnan(nothing.single_frame_share)


def test_rotations_come_from_truth_where_there_is_any() -> None:
    stamps = np.arange(5, dtype=np.int64) * STEP_NS
    R = so3.exp(np.linspace(0.0, 0.4, 5)[:, None] * [0.0, 0.0, 1.0])
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3] = R
    T_imu_cam = np.eye(4)
    T_imu_cam[:3, :3] = so3.exp(np.array([0.3, -0.2, 0.1]))
    estimate = Trajectory(stamps, np.tile(np.eye(4), (5, 1, 1)))

    found = camera_rotations(stamps, Trajectory(stamps[:3], poses[:3]), estimate, T_imu_cam)
    assert found.source == "truth"
    np.testing.assert_array_equal(found.known, [True, True, True, False, False])
    np.testing.assert_allclose(found.R_world_cam[:3], R[:3] @ T_imu_cam[:3, :3], atol=1e-12)

    elsewhere = Trajectory(stamps + 10 * STEP_NS, poses)
    for truth in (None, elsewhere):
        found = camera_rotations(stamps + STEP_NS, truth, estimate, T_imu_cam)
        assert found.source == "estimate"
        np.testing.assert_array_equal(found.known, [True, True, True, True, False])

    nowhere = Trajectory(stamps[:0], poses[:0])
    assert not camera_rotations(stamps, None, nowhere, T_imu_cam).known.any()


def test_json_holds_the_names_that_scripts_read() -> None:
    quality = tracking_quality(record([{0: (0.0, 0.0)}, {0: (1.0, 0.0)}]), level(2))
    plain = json.loads(json.dumps(quality.to_json()))
    assert plain["mean_length"] == 2.0
    assert plain["two_view_parallax_deg"] == pytest.approx(22.5)
    assert plain["total_parallax_deg"] == pytest.approx(45.0)
    assert plain["single_frame_share"] == 0.0
    assert plain["total_parallax_per_frame_deg"] == pytest.approx(22.5)
    assert plain["features_per_frame"] == 1.0
    assert plain["rotations"] == "truth"
    assert plain["length_shares"].keys() == {"1", "5", "10", "15", "20"}
