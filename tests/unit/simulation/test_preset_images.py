"""Every preset's pictures: what moves in them moves as pose and depth say."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.geometry.pose import inverse, transform
from p2gd_fgo.simulation.presets import PRESETS, find_preset, load_scenario
from p2gd_fgo.simulation.production import Studio, plan
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.types import FloatArray

NAMES = sorted(path.stem for path in PRESETS.glob("*.yaml"))
FRAME = 12  # tracked into the next


def clip(name: str) -> Scenario:
    """The first seconds of a preset, in motion from the start."""
    return load_scenario(find_preset(name), {"vehicle.standstill_s": 0.0, "duration_s": 2.4})


def flow_of(studio: Studio, index: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Corners of image ``index``, where KLT and where truth find them in the next, pose between."""
    camera: Camera = studio.plan.calibration.camera
    views = [studio.view(index), studio.view(index + 1)]
    images = [studio.expose(view, index + k) for k, view in enumerate(views)]
    stamps = studio.plan.image_stamps_ns[index : index + 2]
    T_imu_cam = studio.plan.calibration.T_imu_cam
    poses = studio.plan.drive.trajectory.sample(stamps).T_world_imu @ T_imu_cam
    detector = cv2.FastFeatureDetector_create(20)  # type: ignore[attr-defined]
    keypoints = detector.detect(images[0], views[0].mask())
    pixels = np.array([k.pt for k in sorted(keypoints, key=lambda k: -k.response)], np.float32)
    pixels = np.ascontiguousarray(pixels[:: max(len(pixels) // 300, 1)])
    tracked, status, _ = cv2.calcOpticalFlowPyrLK(
        images[0], images[1], pixels, None, winSize=(15, 15), maxLevel=4  # type: ignore[call-overload]
    )  # fmt: skip
    rays = np.column_stack([camera.undistort(pixels.astype(float)), np.ones(len(pixels))])
    depth = views[0].inverse_depth[tuple(np.rint(pixels[:, ::-1]).astype(int).T)]
    T_next_this = inverse(poses[1]) @ poses[0]
    points = transform(T_next_this, rays / np.maximum(depth, 1e-6)[:, None])
    expected = camera.project(np.where(points[:, 2:] > 0.1, points, 1.0))
    keep = (depth > 0) & (status[:, 0] > 0) & (points[:, 2] > 0.1) & camera.inside(expected, 10.0)
    return pixels[keep], tracked[keep], expected[keep], T_next_this


@cache
def studio_of(name: str) -> Studio:
    return Studio(plan(clip(name)))


@pytest.mark.parametrize("name", NAMES)
def test_tracks_follow_pose_and_depth(name: str) -> None:
    studio = studio_of(name)
    camera = studio.plan.calibration.camera
    pixels, tracked, expected, T = flow_of(studio, FRAME)
    errors = np.linalg.norm(tracked - expected, axis=1)
    assert len(errors) > 75
    assert np.median(np.linalg.norm(expected - pixels, axis=1)) > 0.3  # or it would show nothing
    assert np.median(errors) < 0.3
    a, b = (
        np.column_stack([camera.undistort(p.astype(float)), np.ones(len(p))])
        for p in (pixels, tracked)
    )
    lines = np.cross(T[:3, 3], a @ T[:3, :3].T)
    distance = np.abs(np.einsum("ni,ni->n", lines, b)) / np.linalg.norm(lines[:, :2], axis=1)
    assert np.median(distance) * camera.fx < 0.3


def test_the_textureless_city_has_less_to_track_than_the_other() -> None:
    counts = []
    for name in ("kaist_like", "textureless"):
        studio = studio_of(name)
        image = studio.expose(studio.view(FRAME), FRAME)
        counts.append(len(cv2.FastFeatureDetector_create(20).detect(image)))  # type: ignore[attr-defined]
    assert counts[1] < 0.75 * counts[0]
