"""What the ASL reader reads, and what it mends with an event."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asl_folder import START_NS as S
from asl_folder import AslFolder

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import ImuNoise, open_sequence
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose, so3
from p2gd_fgo.geometry.camera import EquidistantCamera, RadTanCamera

TURN = so3.exp(np.array([0.3, -0.2, 1.1]))


@pytest.fixture
def asl(tmp_path: Path) -> AslFolder:
    """A valid recording, not yet written: change it, then ``write()``."""
    return AslFolder(tmp_path / "lap1")


def kinds(sequence: Any) -> list[str]:
    return [event.kind for event in sequence.events]


def transform(R: np.ndarray, p: list[float]) -> np.ndarray:
    return pose.from_rotation_translation(R, np.array(p))


def as_yaml(T: np.ndarray) -> dict[str, Any]:
    return {"rows": 4, "cols": 4, "data": T.ravel().tolist()}


# What it reads


def test_a_whole_recording(asl: AslFolder) -> None:
    sequence = asl.write().open()
    assert sequence.name == "lap1"
    assert sequence.events == ()
    assert sequence.image_stamps_ns.tolist() == asl.image_stamps
    assert sequence.image(3).shape == (48, 64)
    assert (sequence.image(3) == 30).all()
    assert len(sequence.imu) == 131
    assert sequence.imu.stamps_ns[0] == S - 50_000_000
    np.testing.assert_array_equal(sequence.imu.gyro[7], [0.007, 0.2, -0.3])
    np.testing.assert_array_equal(sequence.imu.accel[7], [0.4, 0.5, 9.81])
    calibration = sequence.calibration
    expected = RadTanCamera(64, 48, 40.0, 41.0, 31.5, 23.5, -0.1, 0.01, 0.0002, 1e-5)
    assert calibration.camera == expected
    assert calibration.imu_noise == ImuNoise(1.7e-4, 2e-5, 2e-3, 3e-3)
    assert calibration.time_offset_s == 0.0
    np.testing.assert_allclose(calibration.T_imu_cam, np.eye(4), atol=1e-12)
    truth = sequence.truth
    assert truth is not None
    assert truth.velocity is not None and truth.gyro_bias is not None
    assert truth.accel_bias is not None
    T = truth.trajectory.T_world_imu[20]
    np.testing.assert_allclose(T[:3, 3], [0.2, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(T[:3, :3], so3.exp(np.array([0, 0, np.pi / 2])), atol=1e-8)
    assert truth.velocity[20].tolist() == [1.0, 0.0, 0.0]
    assert truth.gyro_bias[20].tolist() == [0.01, 0.02, 0.03]
    assert truth.accel_bias[20].tolist() == [0.1, 0.2, 0.3]


def test_the_sensor_folder_itself_and_folders_without_mav0(asl: AslFolder) -> None:
    asl.write()
    inner = open_sequence(DatasetConfig(path=str(asl.mav0)))
    assert inner.name == "lap1"
    asl.mav0.rename(asl.root.parent / "flat")
    flat = open_sequence(DatasetConfig(path=str(asl.root.parent / "flat"), format="asl"))
    assert flat.name == "flat"


def test_another_camera(asl: AslFolder) -> None:
    asl.write()
    (asl.mav0 / "cam0").rename(asl.mav0 / "cam1")
    assert len(asl.open(camera="cam1").image_stamps_ns) == 6
    with pytest.raises(DataError, match=r"cam0: no such folder.*may be cam1"):
        asl.open()


def test_equidistant_and_five_coefficients(asl: AslFolder) -> None:
    assert asl.camera is not None
    asl.camera.update(distortion_model="equidistant", distortion_coefficients=[0.1, 0.2, 0.3, 0.4])
    asl.write()
    assert asl.open().calibration.camera == EquidistantCamera(
        64, 48, 40.0, 41.0, 31.5, 23.5, 0.1, 0.2, 0.3, 0.4
    )
    asl.camera.update(distortion_model="radtan", distortion_coefficients=[0.1, 0.2, 0.3, 0.4, 0.5])
    (asl.mav0 / "cam0" / "sensor.yaml").write_text(json.dumps(asl.camera))
    camera = asl.open().calibration.camera
    assert isinstance(camera, RadTanCamera)
    assert (camera.p1, camera.p2, camera.k3) == (0.3, 0.4, 0.5)


def test_an_imu_that_is_not_the_body(asl: AslFolder) -> None:
    T_body_imu = transform(TURN, [0.1, -0.2, 0.3])
    T_body_cam = transform(TURN.T, [-0.5, 0.4, 0.0])
    assert asl.camera is not None and asl.imu_sensor is not None
    asl.imu_sensor["T_BS"] = as_yaml(T_body_imu)
    asl.camera["T_BS"] = T_body_cam.tolist()  # nested lists are read as well
    sequence = asl.write().open()
    expected = pose.inverse(T_body_imu) @ T_body_cam
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, expected, atol=1e-12)
    truth = sequence.truth
    assert truth is not None
    T_world_body = transform(so3.exp(np.array([0, 0, np.pi / 2])), [0.0, 2.0, 3.0])
    np.testing.assert_allclose(
        truth.trajectory.T_world_imu[0], T_world_body @ T_body_imu, atol=1e-8
    )
    assert truth.velocity is None  # the csv's velocity is that of another point
    assert truth.gyro_bias is not None


def test_a_truth_sensor_with_its_own_pose(asl: AslFolder) -> None:
    T_body_marker = transform(TURN, [0.1, -0.2, 0.3])
    asl.write()
    sensor = asl.truth_csv.with_name("sensor.yaml")
    sensor.write_text(json.dumps({"T_BS": as_yaml(T_body_marker)}))
    truth = asl.open().truth
    assert truth is not None
    T_world_marker = transform(so3.exp(np.array([0, 0, np.pi / 2])), [0.0, 2.0, 3.0])
    np.testing.assert_allclose(
        truth.trajectory.T_world_imu[0] @ T_body_marker, T_world_marker, atol=1e-8
    )


def test_pose_only_truth_from_motion_capture(asl: AslFolder) -> None:
    assert asl.truth is not None
    asl.truth = [row[:8] for row in asl.truth]
    asl.write()
    asl.truth_csv.parent.rename(asl.mav0 / "mocap0")
    sequence = asl.open()
    truth = sequence.truth
    assert truth is not None and sequence.events == ()
    assert len(truth.trajectory) == 66
    assert truth.velocity is None and truth.gyro_bias is None and truth.accel_bias is None


def test_an_imu_without_sensor_file_has_unknown_noise(asl: AslFolder) -> None:
    asl.imu_sensor = None
    calibration = asl.write().open().calibration
    assert calibration.imu_noise is None
    np.testing.assert_allclose(calibration.T_imu_cam, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("key", ["time_offset_s", "timeshift_cam_imu"])
def test_time_offset(asl: AslFolder, key: str) -> None:
    assert asl.camera is not None
    asl.camera[key] = -0.0125
    asl.write()
    assert asl.open().calibration.time_offset_s == -0.0125
    assert asl.open(time_offset_s=0.5).calibration.time_offset_s == 0.5


def test_a_part_of_a_recording(asl: AslFolder) -> None:
    asl.image_stamps = [S + k * 500_000_000 for k in range(20)]
    rows = [[str(S + k * 10_000_000), *["0"] * 5, str(k)] for k in range(1000)]
    asl.imu = rows
    assert asl.truth is not None
    asl.truth = [[row[0], *asl.truth[0][1:]] for row in rows]
    asl.write()
    part = asl.open(start_s=4.2, duration_s=2.0)
    assert part.image_stamps_ns.tolist() == asl.image_stamps[9:13]
    assert part.image_paths[0] == asl.image(9)
    assert (part.image(0) == 90).all()
    assert part.imu.accel[0, 2] == 350.0  # a second before 4.5 s
    assert part.imu.accel[-1, 2] == 700.0
    truth = part.truth
    assert truth is not None and truth.velocity is not None
    assert len(truth.trajectory) == len(part.imu) == len(truth.velocity)
    assert part.events == ()
    assert len(asl.open(start_s=9.5).image_stamps_ns) == 1
    with pytest.raises(DataError, match=r"dataset.start_s = 9.6 leaves no image .* 9.500 s"):
        asl.open(start_s=9.6)
    with pytest.raises(DataError, match=r"start_s = 1.1 with dataset.duration_s = 0.2 leaves"):
        asl.open(start_s=1.1, duration_s=0.2)


# What it mends


def test_duplicate_and_disordered_imu_samples(asl: AslFolder) -> None:
    tidy = [list(row) for row in asl.imu]
    asl.imu[10], asl.imu[13] = asl.imu[13], asl.imu[10]
    asl.imu.insert(50, [asl.imu[49][0], *["7"] * 6])
    sequence = asl.write().open()
    assert sequence.imu.stamps_ns.tolist() == [int(row[0]) for row in tidy]
    expected = [[float(value) for value in row[1:4]] for row in tidy]
    np.testing.assert_array_equal(sequence.imu.gyro, expected)
    assert kinds(sequence) == ["imu_unsorted", "imu_duplicates"]
    assert [event.data["count"] for event in sequence.events] == [3, 1]


def test_gaps_in_the_imu(asl: AslFolder) -> None:
    del asl.imu[40:70]
    del asl.imu[70:95]
    asl.write()
    (event,) = asl.open().events
    assert event.kind == "imu_gap"
    assert event.data == {"count": 2, "longest_s": pytest.approx(0.155)}
    assert event.stamp_ns == int(asl.imu[39][0])
    assert asl.open(max_gap_s=0.2).events == ()


def test_images_outside_the_imu(asl: AslFolder) -> None:
    asl.imu = [row for row in asl.imu if S + 150_000_000 <= int(row[0]) <= S + 450_000_000]
    asl.write()
    sequence = asl.open()
    assert kinds(sequence) == ["images_outside_imu"]
    assert sequence.events[0].data == {"before": 2, "after": 1}
    assert len(sequence.image_stamps_ns) == 6
    assert asl.open(time_offset_s=0.1).events[0].data == {"before": 1, "after": 2}


def test_truth_that_covers_a_part_or_nothing(asl: AslFolder) -> None:
    assert asl.truth is not None
    asl.truth = asl.truth[:30]
    sequence = asl.write().open()
    assert kinds(sequence) == ["truth_partial"]
    assert sequence.events[0].data == {"covered": 3, "images": 6, "holes": 0}
    asl.truth_csv.unlink()
    sequence = asl.open()
    assert sequence.truth is None
    assert kinds(sequence) == ["truth_missing"]


def test_missing_and_broken_images_are_told_when_asked_for(asl: AslFolder) -> None:
    asl.write()
    asl.image(0).write_bytes(asl.image(0).read_bytes()[:40])
    asl.image(2).unlink()
    sequence = asl.open()
    assert len(sequence.image_stamps_ns) == 6
    with pytest.raises(DataError, match=f"{S}.png: the image is truncated"):
        sequence.image(0)
    with pytest.raises(DataError, match="no such image"):
        sequence.image(2)
    assert (sequence.image(3) == 30).all()


# Real recordings


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "images", "samples", "width"),
    [("euroc_mh01", 320, 3488, 752), ("kitti_0039", 398, 4125, 1392)],
)
def test_the_real_recordings(
    recordings: Path, name: str, images: int, samples: int, width: int
) -> None:
    sequence = open_sequence(DatasetConfig(path=str(recordings / name)))
    assert sequence.name == name
    assert len(sequence.image_stamps_ns) == images
    assert len(sequence.imu) == samples
    assert sequence.image(images - 1).shape[1] == sequence.calibration.camera.width == width
    assert sequence.calibration.imu_noise is not None
    assert sequence.events == ()
    truth = sequence.truth
    assert truth is not None and truth.velocity is not None and truth.gyro_bias is not None
    # The truth's velocity is the derivative of its position: stamps, units and frames agree.
    p, t = truth.trajectory.T_world_imu[:, :3, 3], truth.trajectory.stamps_ns
    speed = (p[20:] - p[:-20]) / ((t[20:] - t[:-20]) * 1e-9)[:, None]
    error = np.linalg.norm(speed - truth.velocity[10:-10], axis=1)
    assert np.median(error) < 0.05
    # Gravity, turned into the world by the truth, points up: so do z axis and accelerometer.
    k = np.searchsorted(t, sequence.imu.stamps_ns[200:-200]).clip(0, len(t) - 1)
    up = truth.trajectory.T_world_imu[k, :3, :3] @ sequence.imu.accel[200:-200, :, None]
    np.testing.assert_allclose(up.mean(axis=0)[:, 0], [0.0, 0.0, 9.81], atol=0.5)
