"""Reference poses of any format: checked, put in order, brought to the IMU."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.calibration_fields import exact_transform
from p2gd_fgo.datasets.csv_tables import Table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose, so3
from p2gd_fgo.types import Event, FloatArray, IntArray, Trajectory

_NORM_TOLERANCE = 0.01
_RIGID_TOLERANCE = 0.01


def poses_from_quaternions(table: Table, *, w_first: bool) -> FloatArray:
    """Poses (N, 4, 4) of rows that begin with a position and a quaternion.

    Raises
    ------
    DataError
        A number that isn't finite; a quaternion whose norm isn't 1.
    """
    check_finite(table)
    norm = np.linalg.norm(table.values[:, 3:7], axis=1)
    bad = np.abs(norm - 1.0) > _NORM_TOLERANCE
    if bad.any():
        row = int(np.argmax(bad))
        last = "first" if w_first else "last"
        raise DataError(
            f"{table.where(row)}: the quaternion (columns 5 to 8, w {last}) has norm "
            f"{norm[row]:.4g} instead of 1"
        )
    R = so3.from_quaternion(table.values[:, 3:7], w_first=w_first)
    return pose.from_rotation_translation(R, table.values[:, :3])


def poses_from_matrices(table: Table) -> FloatArray:
    """Poses (N, 4, 4) of rows that begin with the twelve numbers of a 3x4 matrix.

    Raises
    ------
    DataError
        A number that isn't finite; a 3x3 part that isn't a rotation.
    """
    check_finite(table)
    T = table.values[:, :12].reshape(-1, 3, 4)
    R = T[:, :, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(1, 2))
        bad = ~(error <= _RIGID_TOLERANCE) | (np.linalg.det(R) < 0.0)
    if bad.any():
        row = int(np.argmax(bad))
        raise DataError(
            f"{table.where(row)}: the first three columns of the 3x4 matrix are no rotation "
            f"(off by {error[row]:.3g})"
        )
    U, _, Vt = np.linalg.svd(R)
    return pose.from_rotation_translation(U @ Vt, T[:, :, 3])


def ordered_trajectory(
    stamps_ns: IntArray, T_world_sensor: FloatArray, T_sensor_imu: FloatArray
) -> tuple[Trajectory, IntArray, list[Event]]:
    """Trajectory of the IMU from another frame's poses, the order that was chosen, and events.

    Holes stay: no pose is made where none was measured.
    """
    order, events = increasing_order(stamps_ns, "truth")
    return Trajectory(stamps_ns[order], T_world_sensor[order] @ T_sensor_imu), order, events


def truth_frame(config: DatasetConfig) -> FloatArray:
    """``dataset.T_truth_imu`` (4, 4): takes IMU points to the frame whose poses the truth holds.

    Raises
    ------
    DataError
        It isn't rigid.
    """
    if config.T_truth_imu is None:
        return np.eye(4)
    return exact_transform(np.array(config.T_truth_imu), "dataset.T_truth_imu")


def check_finite(table: Table) -> None:
    """Refuse NaN and infinity.

    Raises
    ------
    DataError
        Names the first row.
    """
    bad = ~np.isfinite(table.values).all(axis=1)
    if bad.any():
        raise DataError(f"{table.where(int(np.argmax(bad)))}: the truth holds NaN or infinity")
