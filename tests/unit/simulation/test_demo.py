"""The demo's recording: consistent, repeatable, readable, and fit for a front end."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.opening import open_sequence
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import inverse, transform
from p2gd_fgo.simulation.demo import (
    DemoParameters,
    default_cache,
    demo_calibration,
    demo_sequence,
    demo_trajectory,
    demo_world,
)
from p2gd_fgo.simulation.renderer import Renderer, SensorModel
from p2gd_fgo.types import NANOSECONDS

SMALL = DemoParameters(duration_s=4.0, width=96, height=72)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cache")
    demo_sequence(path, parameters=SMALL)
    return path


def test_the_recording_says_what_was_simulated(cache: Path) -> None:
    folder = demo_sequence(cache, parameters=SMALL)
    sequence = open_sequence(DatasetConfig(path=str(folder)))
    assert not sequence.events
    assert len(sequence.image_stamps_ns) == 41
    assert np.all(np.diff(sequence.image_stamps_ns) == NANOSECONDS // 10)
    expected = demo_calibration(SMALL)
    assert sequence.calibration.camera == expected.camera
    assert sequence.calibration.imu_noise == expected.imu_noise
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, expected.T_imu_cam, atol=1e-12)
    truth = sequence.truth
    assert truth is not None and truth.velocity is not None
    assert truth.gyro_bias is not None and truth.accel_bias is not None
    stamps = truth.trajectory.stamps_ns
    state = demo_trajectory(SMALL).sample(stamps)
    np.testing.assert_allclose(truth.trajectory.T_world_imu, state.T_world_imu, atol=1e-8)
    np.testing.assert_allclose(truth.velocity, state.velocity, atol=1e-8)
    np.testing.assert_array_equal(stamps, sequence.imu.stamps_ns)
    assert stamps[0] < sequence.image_stamps_ns[0] and stamps[-1] > sequence.image_stamps_ns[-1]
    # At rest the IMU reads its biases and gravity; later the robot moves.
    still = stamps < sequence.image_stamps_ns[0] + 2 * NANOSECONDS
    assert np.abs(truth.velocity[still]).max() < 1e-6
    assert np.linalg.norm(truth.velocity[-1]) > 0.3
    gyro = (sequence.imu.gyro - truth.gyro_bias)[still].mean(0)
    accel = (sequence.imu.accel - truth.accel_bias)[still].mean(0)
    np.testing.assert_allclose(gyro, 0.0, atol=1e-3)
    np.testing.assert_allclose(accel, [0.0, 0.0, 9.81], atol=0.02)
    assert sequence.image(0).shape == (72, 96)


def test_two_at_once_give_the_bytes_of_one(cache: Path, tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as pool:
        folders = list(pool.map(lambda _: demo_sequence(tmp_path, parameters=SMALL), range(2)))
    assert folders[0] == folders[1]
    assert [p.name for p in tmp_path.iterdir()] == [folders[0].name]
    reference = demo_sequence(cache, parameters=SMALL)
    files = sorted(p.relative_to(reference) for p in reference.rglob("*") if p.is_file())
    assert len(files) == 41 + 6
    for name in files:
        assert (folders[0] / name).read_bytes() == (reference / name).read_bytes()


def test_a_cached_recording_is_not_rendered_again(cache: Path) -> None:
    def refuse(done: int, total: int) -> None:
        raise AssertionError("rendered again")

    demo_sequence(cache, refuse, parameters=SMALL)


def test_a_render_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo_sequence(tmp_path, stop, parameters=SMALL)
    assert list(tmp_path.iterdir()) == []


def test_a_cache_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match=r"file/cache .*XDG_CACHE_HOME"):
        demo_sequence(tmp_path / "file" / "cache", parameters=SMALL)


def test_the_default_cache_follows_xdg(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_cache() == tmp_path / "p2gd_fgo"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert default_cache() == Path.home() / ".cache" / "p2gd_fgo"


def test_optical_flow_follows_pose_and_depth() -> None:
    parameters = DemoParameters()
    trajectory, calibration = demo_trajectory(parameters), demo_calibration(parameters)
    camera = calibration.camera
    renderer = Renderer(camera, demo_world(parameters, trajectory))
    detector = cv2.FastFeatureDetector_create(20)  # type: ignore[attr-defined]
    errors = []
    for second in (6.0, 12.0, 18.0):
        start = trajectory.span_ns[0] + int((0.5 + second) * NANOSECONDS)
        stamps = np.array([start, start + NANOSECONDS // 10])
        poses = trajectory.sample(stamps).T_world_imu @ calibration.T_imu_cam
        views = [renderer.render(T) for T in poses]
        images = [
            SensorModel().expose(view.brightness, np.random.default_rng(k))
            for k, view in enumerate(views)
        ]
        keypoints = sorted(detector.detect(images[0]), key=lambda k: -k.response)
        pixels = np.array([k.pt for k in keypoints], np.float32)
        assert len(pixels) > 300
        cells = np.unique((pixels // 80.0).astype(int), axis=0)
        assert len(cells) > 0.8 * 8 * 6
        pixels = np.ascontiguousarray(pixels[::10])
        tracked, status, _ = cv2.calcOpticalFlowPyrLK(
            images[0],
            images[1],
            pixels,
            None,
            winSize=(21, 21),
            maxLevel=4,  # type: ignore[call-overload]
        )
        rays = np.column_stack([camera.undistort(pixels.astype(float)), np.ones(len(pixels))])
        inverse_depth = views[0].inverse_depth[tuple(np.rint(pixels[:, ::-1]).astype(int).T)]
        points = transform(
            inverse(poses[1]) @ poses[0], rays / np.maximum(inverse_depth, 1e-6)[:, None]
        )
        expected = camera.project(np.where(points[:, 2:] > 0.1, points, 1.0))
        keep = (inverse_depth > 0) & (status[:, 0] > 0) & (points[:, 2] > 0.1)
        keep &= camera.inside(expected, 10.0)
        errors.append(np.linalg.norm(tracked - expected, axis=1)[keep])
    assert np.median(np.concatenate(errors)) < 0.15
