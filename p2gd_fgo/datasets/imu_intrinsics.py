"""What Kalibr and OpenVINS may say of an IMU beyond its noise, and no back end here models."""

from __future__ import annotations

import reprlib
from typing import Any

import numpy as np

from p2gd_fgo.datasets.calibration_fields import numbers, rigid_transform
from p2gd_fgo.errors import DataError

# Scale and misalignment, sensitivity to acceleration, and rotations between the two sensors.
_IDENTITIES = ("Tw", "Ta", "R_IMUtoGYRO", "R_IMUtoACC", "M", "C_gyro_i")
_ZEROS = ("Tg", "A")
_PARTS = ("gyroscopes", "accelerometers")  # Kalibr's models with intrinsics
_AGREE = 1e-3


def check_plain_imu(data: dict[str, Any], where: str) -> None:
    """Refuse an IMU that isn't the body, has a clock of its own, or errs beyond biases.

    Raises
    ------
    DataError
        Names the key and its value: samples would be read as if it weren't there.
    """
    if data.get("T_i_b") is not None:
        T = rigid_transform(data, "T_i_b", where)
        if np.abs(T - np.eye(4)).max() > _AGREE:
            raise DataError(
                f"{where}: T_i_b is not the identity, but the body is this IMU: give the chain of "
                "the IMU that is used"
            )
    if data.get("time_offset") is not None and numbers(data, "time_offset", (1,), where) != [0.0]:
        raise DataError(
            f"{where}: time_offset is {data['time_offset']}, but the clock here is this IMU's: "
            "put it into the camera's timeshift_cam_imu, and 0 here"
        )
    parts = [(name, data.get(name)) for name in _PARTS]
    for name, part in (("", data), *parts):
        if isinstance(part, dict):
            _check_matrices(part, f"{where}: {name}" if name else where)


def _check_matrices(data: dict[str, Any], where: str) -> None:
    for keys, nominal in ((_IDENTITIES, np.eye(3)), (_ZEROS, np.zeros((3, 3)))):
        for key in keys:
            if data.get(key) is None:
                continue
            found = np.array(numbers(data, key, (9,), where)).reshape(3, 3)
            if np.abs(found - nominal).max() > _AGREE:
                kind = "the identity" if nominal.any() else "0"
                raise DataError(
                    f"{where}: {key} is {reprlib.repr(data[key])}, and only {kind} is known: "
                    f"correct the samples with it, and put {kind} there"
                )
