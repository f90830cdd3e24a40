"""What is written as an ASL folder is read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl_writer import write_asl, write_png
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.datasets.opening import open_sequence
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import Image, ImuBatch, Trajectory, Truth

STAMPS = 1_700_000_000_000_000_000 + 5_000_000 * np.arange(21, dtype=np.int64)
FRAMES = STAMPS[::10]
RADTAN = RadTanCamera(32, 24, 20.5, 21.5, 15.0, 12.0, -0.2, 0.05, 1e-4, -2e-4, 0.01)
FISHEYE = EquidistantCamera(32, 24, 20.5, 21.5, 15.0, 12.0, 0.01, -0.02, 0.003, 0.001)


def recording(camera: Camera) -> tuple[Calibration, list[Image], ImuBatch, Truth]:
    rng = np.random.default_rng(0)
    T = from_rotation_translation(
        so3.exp(rng.standard_normal((21, 3))), rng.standard_normal((21, 3))
    )
    calibration = Calibration(camera, T[0], ImuNoise(1e-4, 2e-5, 3e-3, 4e-4))
    images = list(rng.integers(0, 255, (3, 24, 32)).astype(np.uint8))
    imu = ImuBatch(STAMPS, *rng.standard_normal((2, 21, 3)))
    return calibration, images, imu, Truth(Trajectory(STAMPS, T), *rng.standard_normal((3, 21, 3)))


@pytest.mark.parametrize("camera", [RADTAN, replace(RADTAN, k3=0.0), FISHEYE])
def test_round_trip(camera: Camera, tmp_path: Path) -> None:
    calibration, images, imu, truth = recording(camera)
    write_asl(tmp_path / "made", calibration, FRAMES, images, imu, truth)
    sequence = open_sequence(DatasetConfig(path=str(tmp_path / "made")))
    assert sequence.calibration.camera == camera
    assert sequence.calibration.imu_noise == calibration.imu_noise
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, calibration.T_imu_cam, atol=1e-12)
    np.testing.assert_array_equal(sequence.image_stamps_ns, FRAMES)
    for k, image in enumerate(images):
        np.testing.assert_array_equal(sequence.image(k), image)
    np.testing.assert_array_equal(sequence.imu.stamps_ns, STAMPS)
    np.testing.assert_allclose(sequence.imu.gyro, imu.gyro, rtol=1e-10)
    np.testing.assert_allclose(sequence.imu.accel, imu.accel, rtol=1e-10)
    read = sequence.truth
    assert read is not None
    assert read.velocity is not None and truth.velocity is not None
    assert read.gyro_bias is not None and truth.gyro_bias is not None
    assert read.accel_bias is not None and truth.accel_bias is not None
    np.testing.assert_allclose(read.trajectory.T_world_imu, truth.trajectory.T_world_imu, atol=1e-9)
    np.testing.assert_allclose(read.velocity, truth.velocity, rtol=1e-10)
    np.testing.assert_allclose(read.gyro_bias, truth.gyro_bias, rtol=1e-10)
    np.testing.assert_allclose(read.accel_bias, truth.accel_bias, rtol=1e-10)


def test_a_time_offset_is_written(tmp_path: Path) -> None:
    calibration, images, imu, truth = recording(RADTAN)
    late = replace(calibration, time_offset_s=0.002)
    write_asl(tmp_path / "late", late, FRAMES, images, imu, truth)
    sequence = open_sequence(DatasetConfig(path=str(tmp_path / "late")))
    assert sequence.calibration.time_offset_s == 0.002


@pytest.mark.parametrize("fields", [(), ("velocity",), ("gyro_bias", "accel_bias")])
def test_a_truth_that_knows_less(tmp_path: Path, fields: tuple[str, ...]) -> None:
    calibration, images, imu, whole = recording(RADTAN)
    truth = Truth(whole.trajectory, **{name: getattr(whole, name) for name in fields})
    write_asl(tmp_path / "made", calibration, FRAMES, images, imu, truth)
    read = open_sequence(DatasetConfig(path=str(tmp_path / "made"))).truth
    assert read is not None and len(read.trajectory) == 21
    assert (read.velocity is not None) == ("velocity" in fields)
    assert read.gyro_bias is None and read.accel_bias is None  # the columns come after velocity


def test_no_truth_and_too_few_images(tmp_path: Path) -> None:
    calibration, images, imu, truth = recording(RADTAN)
    write_asl(tmp_path / "made", calibration, FRAMES, images, imu, None)
    assert open_sequence(DatasetConfig(path=str(tmp_path / "made"))).truth is None
    with pytest.raises(ValueError, match="shorter"):
        write_asl(tmp_path / "c", calibration, FRAMES, images[:2], imu, truth)


def test_image_without_compression(tmp_path: Path) -> None:
    image = np.full((24, 32), 7, np.uint8)
    for compress in (True, False):
        write_png(tmp_path / f"{compress}.png", image, compress=compress)
        read = cv2.imread(str(tmp_path / f"{compress}.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(read, image)
    small, large = ((tmp_path / f"{c}.png").stat().st_size for c in (True, False))
    assert small < image.size < large
