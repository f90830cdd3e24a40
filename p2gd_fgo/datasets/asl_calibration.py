"""Calibration of an ASL folder: ``sensor.yaml`` of the camera and of the IMU."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.calibration_fields import (
    imu_noise,
    known_model,
    make_camera,
    numbers,
    read_yaml,
    rigid_transform,
)
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray

_OFFSET_KEYS = ("time_offset_s", "timeshift_cam_imu")


def load_asl_calibration(camera_yaml: Path, imu_yaml: Path) -> Calibration:
    """Read both files.

    ``T_BS`` takes the sensor's points to the common body B, so T_imu_cam = T_B_imu⁻¹ T_B_cam. An
    IMU without a ``sensor.yaml`` is taken as the body itself (the convention of the format), its
    noise as unknown. Camera files may say ``time_offset_s`` or Kalibr's ``timeshift_cam_imu``,
    both t_imu = t_cam + offset.

    Raises
    ------
    DataError
        A file that is missing or not YAML; a field that is missing, malformed or impossible.
    """
    camera = read_yaml(camera_yaml)
    imu = read_yaml(imu_yaml) if imu_yaml.is_file() else {}
    key = next((k for k in _OFFSET_KEYS if k in camera), None)
    offset = 0.0 if key is None else numbers(camera, key, (1,), str(camera_yaml))[0]
    return Calibration(
        camera=_camera(camera, str(camera_yaml)),
        T_imu_cam=pose.inverse(body_from_sensor(imu, imu_yaml))
        @ body_from_sensor(camera, camera_yaml, required=True),
        imu_noise=imu_noise(imu, str(imu_yaml)),
        time_offset_s=offset,
    )


def body_from_sensor(data: dict[str, Any], path: Path, *, required: bool = False) -> FloatArray:
    """``T_BS`` (4, 4): takes points from the sensor to the body; the identity where it's absent.

    Raises
    ------
    DataError
        Absent though required, not 16 numbers, or not a rigid transform.
    """
    if "T_BS" not in data and not required:
        return np.eye(4)
    return rigid_transform(data, "T_BS", str(path))


def _camera(data: dict[str, Any], where: str) -> Camera:
    if data.get("camera_model", "pinhole") != "pinhole":
        raise DataError(f"{where}: camera_model is {data['camera_model']!r}, known is 'pinhole'")
    model = data.get("distortion_model")
    counts = known_model(model, where)
    intrinsics = numbers(data, "intrinsics", (4,), where)
    size = numbers(data, "resolution", (2,), where)
    k = numbers(data, "distortion_coefficients", counts, where, f" with {model}")
    return make_camera(model, size, intrinsics, k, where)
