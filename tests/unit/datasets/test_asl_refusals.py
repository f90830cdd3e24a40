"""Recordings that the ASL reader refuses, and what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asl_folder import START_NS as S
from asl_folder import AslFolder

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import DataError


@pytest.fixture
def asl(tmp_path: Path) -> AslFolder:
    """A valid recording, not yet written: change it, then ``write()``."""
    return AslFolder(tmp_path / "lap1")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        ({"distortion_model": "fov"}, "distortion_model is 'fov', known are equidistant, none"),
        ({"distortion_model": None}, "distortion_model is None, known are"),
        (
            {"distortion_coefficients": [0.1, 0.2]},
            "distortion_coefficients holds 2 numbers, needed are 4 or 5 with radial-tangential",
        ),
        (
            {"distortion_model": "equidistant", "distortion_coefficients": [0.1] * 5},
            "holds 5 numbers, needed are 4 with equidistant",
        ),
        ({"intrinsics": [1.0, 2.0]}, "intrinsics holds 2 numbers"),
        ({"intrinsics": None}, "intrinsics is missing"),
        ({"intrinsics": ["a", 1, 1, 1]}, "intrinsics is .*, not numbers"),
        ({"intrinsics": [0.0, 40.0, 30.0, 20.0]}, r"sensor.yaml: the camera's fx is 0.0"),
        ({"intrinsics": [float("nan"), 1.0, 1.0, 1.0]}, "intrinsics is .* finite"),
        ({"resolution": [64.5, 48]}, "resolution is .* not two whole numbers"),
        ({"camera_model": "omni"}, "camera_model is 'omni', known is 'pinhole'"),
        ({"T_BS": None}, "T_BS is missing"),
        ({"T_BS": {"data": [1.0] * 12}}, "T_BS holds 12 numbers, needed are 16"),
        ({"T_BS": (1.1 * np.eye(4)).tolist()}, "T_BS is not a rigid transform"),
        ({"T_BS": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()}, "determinant -1"),
        ({"time_offset_s": "soon"}, "time_offset_s is 'soon', not numbers"),
        ({"resolution": [65, 48]}, r"\.png: the image is 64x48 px, but .* 65x48"),
    ],
)
def test_camera_files_that_cannot_be_used(
    asl: AslFolder, edit: dict[str, Any], message: str
) -> None:
    assert asl.camera is not None
    asl.camera.update(edit)
    asl.write()
    with pytest.raises(DataError, match=message) as caught:
        asl.open()
    assert str(asl.mav0 / "cam0") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_calibration_that_is_elsewhere_or_unreadable(asl: AslFolder) -> None:
    asl.camera = None
    asl.write()
    with pytest.raises(DataError, match=r"cam0/sensor\.yaml: no such file; some releases"):
        asl.open()
    (asl.mav0 / "cam0" / "sensor.yaml").write_text("a: [1,\nb: }")
    with pytest.raises(DataError, match=r"cam0/sensor\.yaml: not readable as YAML"):
        asl.open()
    (asl.mav0 / "cam0" / "sensor.yaml").write_text("[1, 2]")
    with pytest.raises(DataError, match="a mapping of keys expected"):
        asl.open()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gyroscope_random_walk", None, "gyroscope_random_walk is missing"),
        ("accelerometer_noise_density", 0.0, "accelerometer_noise_density is 0.0"),
        ("T_BS", {"data": [2.0] * 16}, "T_BS is not a rigid transform"),
    ],
)
def test_imu_files_that_cannot_be_used(
    asl: AslFolder, key: str, value: object, message: str
) -> None:
    assert asl.imu_sensor is not None
    asl.imu_sensor[key] = value
    asl.write()
    with pytest.raises(DataError, match=rf"imu0/sensor\.yaml: {message}"):
        asl.open()


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_imu_values_that_are_not_finite(asl: AslFolder, value: str) -> None:
    asl.imu[5][3] = value
    asl.write()
    with pytest.raises(DataError, match=rf"imu0/data\.csv, line 7: column 4 is {value}"):
        asl.open()


def test_malformed_and_too_few_imu_rows(asl: AslFolder) -> None:
    whole = asl.imu
    asl.imu = [*whole[:8], whole[8][:5], *whole[9:]]
    asl.write()
    with pytest.raises(DataError, match=r"imu0/data\.csv, line 10: 5 columns found, 7 needed"):
        asl.open()
    asl.imu_csv.write_text(",".join(whole[0]))
    with pytest.raises(DataError, match="only 1 IMU sample, at least 2 needed"):
        asl.open()
    asl.imu_csv.unlink()
    with pytest.raises(DataError, match=r"imu0/data\.csv: no such file"):
        asl.open()


def test_sensors_that_do_not_overlap(asl: AslFolder) -> None:
    asl.write()
    with pytest.raises(DataError, match=r"images and IMU don't overlap.*dataset\.time_offset_s"):
        asl.open(time_offset_s=100.0)


def test_image_lists_that_cannot_be_used(asl: AslFolder) -> None:
    asl.write()
    for k in range(6):
        asl.image(k).unlink()
    with pytest.raises(DataError, match=rf"none of the 6 listed images exists.*{S}\.png"):
        asl.open()
    asl.camera_csv.write_text("#timestamp [ns],filename\n")
    with pytest.raises(DataError, match=r"cam0/data\.csv: no data rows"):
        asl.open()
    asl.camera_csv.write_text(f"{S},a.png\n{S},b.png\n")
    with pytest.raises(DataError, match=r"cam0/data\.csv, line 2: image stamp .* must increase"):
        asl.open()


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (4, "0.9", r"line 6: the quaternion .* has norm 1\.\d+ instead of 1"),
        (4, "nan", "line 6: the truth holds NaN"),
        (1, "x", "line 6: column 2 holds 'x', not a number"),
    ],
)
def test_truth_that_cannot_be_used(asl: AslFolder, column: int, value: str, message: str) -> None:
    assert asl.truth is not None
    asl.truth[4][column] = value
    asl.write()
    with pytest.raises(DataError, match=message) as caught:
        asl.open()
    assert str(asl.truth_csv) in str(caught.value)


def test_paths_without_a_recording(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"dataset\.path is not set"):
        open_sequence(DatasetConfig())
    with pytest.raises(DataError, match="nowhere doesn't exist"):
        open_sequence(DatasetConfig(path=str(tmp_path / "nowhere")))
    (tmp_path / "file.txt").touch()
    with pytest.raises(
        DataError, match=r"dataset.path: .* is a file, not the folder of a recording"
    ):
        open_sequence(DatasetConfig(path=str(tmp_path / "file.txt")))
    with pytest.raises(DataError, match=r"dataset.path: .* would hold mav0/ or cam0/"):
        open_sequence(DatasetConfig(path=str(tmp_path)))
