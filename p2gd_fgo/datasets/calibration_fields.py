"""Fields of calibration files, whatever the dialect: numbers, transforms, lenses, IMU noise.

A file comes from anywhere: what makes YAML treacherous (aliases that expand to gigabytes, a key
given twice, endless nesting) is refused by :mod:`p2gd_fgo.config.yaml_text`.
"""

from __future__ import annotations

import math
import re
import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from p2gd_fgo.config import yaml_text
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray

_COEFFICIENTS = {
    "radial-tangential": (4, 5),
    "radtan": (4, 5),
    "plumb_bob": (4, 5),
    "equidistant": (4,),
    "none": (0,),
}
NOISE_KEYS = (
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "accelerometer_noise_density",
    "accelerometer_random_walk",
)
_RIGID_TOLERANCE = 1e-3
_MAX_BYTES = 200_000  # some thousand lines; YAML is read slowly
_OPENCV = re.compile(r"\A%YAML:[^\n]*\n|!!opencv-matrix")


def read_yaml(path: Path) -> dict[str, Any]:
    """Read a mapping from a YAML file; OpenCV's dialect (``%YAML:1.0``) too.

    Raises
    ------
    DataError
        Missing, too large, not YAML or not a mapping.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"longer than {_MAX_BYTES} bytes")
        data = yaml_text.parse(_OPENCV.sub("", path.read_text(encoding="utf-8-sig")))
    except FileNotFoundError:
        raise DataError(
            f"{path}: no such file; some releases of recordings keep the calibration elsewhere: "
            "name it with dataset.calibration (Kalibr's, OpenVINS's or ASL's YAML, or a folder)"
        ) from None
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not readable as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise DataError(f"{path}: a mapping of keys expected")
    return data


def numbers(
    data: dict[str, Any], key: str, counts: tuple[int, ...], where: str, context: str = ""
) -> list[float]:
    """Finite numbers under a key: a list, nested lists, one number, or a matrix with ``data``.

    Parameters
    ----------
    counts
        How many there may be.
    where
        The file, for messages.

    Raises
    ------
    DataError
        Missing, not numbers, too few or many, NaN or infinite.
    """
    if data.get(key) is None:
        raise DataError(f"{where}: {key} is missing")
    value = data[key]
    if isinstance(value, dict):
        value = value.get("data")
    entries = value if isinstance(value, list) else [value]
    if entries and all(isinstance(row, list) for row in entries):
        entries = [number for row in entries for number in row]
    try:
        found = [float(entry) for entry in entries]
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{where}: {key} is {reprlib.repr(value)}, not numbers") from None
    if len(found) not in counts:
        need = " or ".join(str(count) for count in counts)
        raise DataError(f"{where}: {key} holds {len(found)} numbers, needed are {need}{context}")
    if not all(math.isfinite(number) for number in found):
        raise DataError(f"{where}: {key} is {reprlib.repr(value)}: every number must be finite")
    return found


def rigid_transform(data: dict[str, Any], key: str, where: str) -> FloatArray:
    """Read a transform (4, 4) under a key; its rotation made exact, since files round.

    Raises
    ------
    DataError
        Missing, not 16 numbers, or not rigid.
    """
    T = np.array(numbers(data, key, (16,), where)).reshape(4, 4)
    return exact_transform(T, f"{where}: {key}")


def exact_transform(T: FloatArray, what: str) -> FloatArray:
    """The rigid transform (4, 4) nearest to ``T``, which is nearly one.

    Raises
    ------
    DataError
        It isn't, by more than a thousandth.
    """
    if not np.isfinite(T).all():
        raise DataError(f"{what}: every number must be finite")
    R = T[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = max(np.abs(R.T @ R - np.eye(3)).max(), np.abs(T[3] - [0.0, 0.0, 0.0, 1.0]).max())
        if not error <= _RIGID_TOLERANCE or np.linalg.det(R) < 0.0:
            raise DataError(
                f"{what} is not a rigid transform: its 3x3 part must be a rotation (off by "
                f"{error:.3g}, determinant {np.linalg.det(R):.4g}) and its last row 0 0 0 1"
            )
    U, _, Vt = np.linalg.svd(R)
    return pose.from_rotation_translation(U @ Vt, T[:3, 3])


def make_camera(
    model: object, size: list[float], intrinsics: list[float], k: list[float], where: str
) -> Camera:
    """A camera of a distortion model's name; 'none' is a lens without distortion.

    Parameters
    ----------
    size
        Width and height, px.
    intrinsics
        fx, fy, cx, cy, px.
    k
        Coefficients in the model's order.

    Raises
    ------
    DataError
        An unknown model, a size that isn't whole, an impossible camera.
    """
    known_model(model, where)
    if any(n != int(n) for n in size):
        raise DataError(f"{where}: resolution is {size}, not two whole numbers of px")
    width, height = (int(n) for n in size)
    lens = EquidistantCamera if model == "equidistant" else RadTanCamera
    try:
        return lens(width, height, *intrinsics, *(k or [0.0] * 4))
    except DataError as error:
        raise DataError(f"{where}: {error}") from None


def known_model(model: object, where: str) -> tuple[int, ...]:
    """How many coefficients a distortion model may have.

    Raises
    ------
    DataError
        An unknown model: it is never guessed.
    """
    if not isinstance(model, str) or model not in _COEFFICIENTS:
        raise DataError(
            f"{where}: distortion_model is {reprlib.repr(model)}, known are "
            f"{', '.join(sorted(_COEFFICIENTS))}"
        )
    return _COEFFICIENTS[model]


def imu_noise(data: dict[str, Any], where: str) -> ImuNoise | None:
    """Read the four densities; None where there is none of them.

    Raises
    ------
    DataError
        Some are missing, or not positive numbers.
    """
    if not any(key in data for key in NOISE_KEYS):
        return None
    values = []
    for key in NOISE_KEYS:
        (value,) = numbers(data, key, (1,), where)
        if value <= 0.0:
            raise DataError(f"{where}: {key} is {value}, but must be positive")
        values.append(value)
    return ImuNoise(*values)
