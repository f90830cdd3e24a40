"""Reference trajectory of an ASL folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.asl_calibration import body_from_sensor, read_yaml
from p2gd_fgo.datasets.csv_tables import Table, read_table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose, so3
from p2gd_fgo.types import Event, FloatArray, Trajectory, Truth

FOLDERS = ("state_groundtruth_estimate0", "mocap0")
_POSE, _VELOCITY, _ALL = 8, 11, 17
_NORM_TOLERANCE = 0.01


def load_truth(root: Path) -> tuple[Truth | None, list[Event]]:
    """Read the truth of ``mav0``; None where the recording has none.

    Looked for in ``state_groundtruth_estimate0`` (EuRoC), then ``mocap0`` (TUM-VI, whose
    calibrated sequences give the pose of the IMU in the motion-capture frame). Columns: stamp,
    position, quaternion w first; optionally velocity; optionally both biases. Poses are taken as
    those of the body, or, with a ``sensor.yaml`` beside them, of the frame that its ``T_BS``
    names, and brought to the IMU by the ``T_BS`` of ``imu0``. A velocity is that of a point: where
    the two frames' origins differ it is left out.

    Raises
    ------
    DataError
        A malformed row, a number that isn't finite, a quaternion whose norm isn't 1, a
        ``T_BS`` that isn't rigid.
    """
    folder = next((f for f in FOLDERS if (root / f / "data.csv").is_file()), None)
    if folder is None:
        return None, []
    table = read_table(root / folder / "data.csv", (_POSE, _VELOCITY, _ALL))
    _check(table)
    order, events = increasing_order(table.stamps_ns, "truth")
    stamps, values = table.stamps_ns[order], table.values[order]
    T_world_sensor = pose.from_rotation_translation(
        so3.from_quaternion(values[:, 3:7], w_first=True), values[:, :3]
    )
    T_sensor_imu = pose.inverse(_body_from(root / folder)) @ _body_from(root / "imu0")
    width = values.shape[1] + 1
    same_origin = np.abs(T_sensor_imu[:3, 3]).max() < 1e-9
    truth = Truth(
        trajectory=Trajectory(stamps, T_world_sensor @ T_sensor_imu),
        velocity=values[:, 7:10] if width >= _VELOCITY and same_origin else None,
        gyro_bias=values[:, 10:13] if width >= _ALL else None,
        accel_bias=values[:, 13:16] if width >= _ALL else None,
    )
    return truth, events


def _body_from(folder: Path) -> FloatArray:
    path = folder / "sensor.yaml"
    return body_from_sensor(read_yaml(path), path) if path.is_file() else np.eye(4)


def _check(table: Table) -> None:
    bad = ~np.isfinite(table.values).all(axis=1)
    if bad.any():
        raise DataError(f"{table.where(int(np.argmax(bad)))}: the truth holds NaN or infinity")
    norm = np.linalg.norm(table.values[:, 3:7], axis=1)
    bad = np.abs(norm - 1.0) > _NORM_TOLERANCE
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(
            f"{table.where(row)}: the quaternion (columns 5 to 8, w first) has norm "
            f"{norm[row]:.4g} instead of 1"
        )
