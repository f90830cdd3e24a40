"""Reference trajectory of an ASL folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.asl_calibration import body_from_sensor
from p2gd_fgo.datasets.calibration_fields import read_yaml
from p2gd_fgo.datasets.csv_tables import read_table
from p2gd_fgo.datasets.poses import ordered_trajectory, poses_from_quaternions
from p2gd_fgo.geometry import pose
from p2gd_fgo.types import Event, FloatArray, Truth

FOLDERS = ("state_groundtruth_estimate0", "mocap0")
_POSE, _VELOCITY, _ALL = 8, 11, 17


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
    T_sensor_imu = pose.inverse(_body_from(root / folder)) @ _body_from(root / "imu0")
    trajectory, order, events = ordered_trajectory(
        table.stamps_ns, poses_from_quaternions(table, w_first=True), T_sensor_imu
    )
    values = table.values[order]
    width = values.shape[1] + 1
    same_origin = np.abs(T_sensor_imu[:3, 3]).max() < 1e-9
    truth = Truth(
        trajectory=trajectory,
        velocity=values[:, 7:10] if width >= _VELOCITY and same_origin else None,
        gyro_bias=values[:, 10:13] if width >= _ALL else None,
        accel_bias=values[:, 13:16] if width >= _ALL else None,
    )
    return truth, events


def _body_from(folder: Path) -> FloatArray:
    path = folder / "sensor.yaml"
    return body_from_sensor(read_yaml(path), path) if path.is_file() else np.eye(4)
