"""Calibration of an ASL folder: ``sensor.yaml`` of the camera and of the IMU."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray

_MODELS = {
    "radial-tangential": (4, 5),
    "radtan": (4, 5),
    "equidistant": (4,),
}
_NOISE_KEYS = (
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "accelerometer_noise_density",
    "accelerometer_random_walk",
)
_OFFSET_KEYS = ("time_offset_s", "timeshift_cam_imu")
_RIGID_TOLERANCE = 1e-3


def load_calibration(camera_yaml: Path, imu_yaml: Path, time_offset_s: float | None) -> Calibration:
    """Read both files; ``time_offset_s``, where given, replaces the camera file's.

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
    if time_offset_s is None:
        key = next((k for k in _OFFSET_KEYS if k in camera), None)
        time_offset_s = 0.0 if key is None else _numbers(camera, key, (1,), camera_yaml)[0]
    return Calibration(
        camera=_camera(camera, camera_yaml),
        T_imu_cam=pose.inverse(body_from_sensor(imu, imu_yaml))
        @ body_from_sensor(camera, camera_yaml, required=True),
        imu_noise=_noise(imu, imu_yaml),
        time_offset_s=time_offset_s,
    )


def read_yaml(path: Path) -> dict[str, Any]:
    """Read a mapping from a YAML file.

    Raises
    ------
    DataError
        Missing, not YAML or not a mapping.
    """
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise DataError(
            f"{path}: no such file; some releases of recordings keep the calibration elsewhere: "
            "write it in EuRoC's format (T_BS, resolution, intrinsics, distortion_model, "
            "distortion_coefficients)"
        ) from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise DataError(f"{path}: not readable as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise DataError(f"{path}: a mapping of keys expected")
    return data


def body_from_sensor(data: dict[str, Any], path: Path, *, required: bool = False) -> FloatArray:
    """``T_BS`` (4, 4): takes points from the sensor to the body; the identity where it's absent.

    Raises
    ------
    DataError
        Absent though required, not 16 numbers, or not a rigid transform.
    """
    if "T_BS" not in data and not required:
        return np.eye(4)
    value = data.get("T_BS")
    entries = value if not isinstance(value, dict) else value.get("data")
    if isinstance(entries, list) and all(isinstance(row, list) for row in entries):
        entries = [number for row in entries for number in row]
    T = np.array(_numbers({"T_BS": entries}, "T_BS", (16,), path)).reshape(4, 4)
    R = T[:3, :3]
    error = max(
        np.abs(R.T @ R - np.eye(3)).max(),
        np.abs(T[3] - [0.0, 0.0, 0.0, 1.0]).max(),
    )
    if error > _RIGID_TOLERANCE or np.linalg.det(R) < 0.0:
        raise DataError(
            f"{path}: T_BS is not a rigid transform: its 3x3 part must be a rotation (off by "
            f"{error:.3g}, determinant {np.linalg.det(R):.4g}) and its last row 0 0 0 1"
        )
    U, _, Vt = np.linalg.svd(R)  # files round to a few digits
    return pose.from_rotation_translation(U @ Vt, T[:3, 3])


def _camera(data: dict[str, Any], path: Path) -> Camera:
    if data.get("camera_model", "pinhole") != "pinhole":
        raise DataError(f"{path}: camera_model is {data['camera_model']!r}, known is 'pinhole'")
    model = data.get("distortion_model")
    if model not in _MODELS:
        raise DataError(
            f"{path}: distortion_model is {model!r}, known are {', '.join(sorted(_MODELS))}"
        )
    fx, fy, cx, cy = _numbers(data, "intrinsics", (4,), path)
    size = _numbers(data, "resolution", (2,), path)
    if any(n != int(n) for n in size):
        raise DataError(f"{path}: resolution is {size}, not two whole numbers of px")
    width, height = (int(n) for n in size)
    k = _numbers(data, "distortion_coefficients", _MODELS[model], path, f" with {model}")
    lens = EquidistantCamera if model == "equidistant" else RadTanCamera
    try:
        return lens(width, height, fx, fy, cx, cy, *k)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def _noise(data: dict[str, Any], path: Path) -> ImuNoise | None:
    if not any(key in data for key in _NOISE_KEYS):
        return None
    values = []
    for key in _NOISE_KEYS:
        (value,) = _numbers(data, key, (1,), path)
        if value <= 0.0:
            raise DataError(f"{path}: {key} is {value}, but must be positive")
        values.append(value)
    return ImuNoise(*values)


def _numbers(
    data: dict[str, Any], key: str, counts: tuple[int, ...], path: Path, context: str = ""
) -> list[float]:
    """Finite numbers under a key, also such that YAML 1.1 reads as text (1e-05)."""
    if data.get(key) is None:
        raise DataError(f"{path}: {key} is missing")
    value = data[key]
    entries = value if isinstance(value, list) else [value]
    try:
        numbers = [float(entry) for entry in entries]
    except (TypeError, ValueError):
        raise DataError(f"{path}: {key} is {value!r}, not numbers") from None
    if len(numbers) not in counts:
        need = " or ".join(str(count) for count in counts)
        raise DataError(f"{path}: {key} holds {len(numbers)} numbers, needed are {need}{context}")
    if not all(math.isfinite(number) for number in numbers):
        raise DataError(f"{path}: {key} is {value!r}: every number must be finite")
    return numbers
