"""Folders in the style of the TUM data sets: lists with a time in seconds in front.

::

    rgb.txt                     time, file name; relative to the folder
    imu.txt                     time, gyro (3, rad/s), accel (3, m/s²)
    groundtruth.txt             optional: time, position, quaternion with w last
    *.yaml                      calibration, or by dataset.calibration
"""

from __future__ import annotations

from pathlib import Path

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.calibration_files import find_calibration, named_calibration, with_offset
from p2gd_fgo.datasets.folder_sequence import FolderSequence, check_first_image
from p2gd_fgo.datasets.imu_samples import imu_from_table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.datasets.poses import ordered_trajectory, poses_from_quaternions, truth_frame
from p2gd_fgo.datasets.seconds_tables import read_seconds_list, read_seconds_table
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Event, Truth

_IMU_WIDTH, _POSE_WIDTH = 7, 8


class TumSequence(FolderSequence):
    """A recording in a TUM-style folder."""

    __slots__ = ()


def is_tum(folder: Path) -> bool:
    """Whether the folder holds the list of images."""
    return (folder / "rgb.txt").is_file()


def open_tum(folder: Path, config: DatasetConfig, max_gap_s: float) -> TumSequence:
    """Read everything but the images.

    The truth's poses are those of the IMU, or of the frame that ``dataset.T_truth_imu`` names.

    Raises
    ------
    DataError
        Files are missing or malformed, no calibration, sensors that don't overlap in time, no
        image, or a first one of another size.
    """
    calibration = with_offset(_calibration(folder, config), config.time_offset_s)
    stamps, names = read_seconds_list(folder / "rgb.txt")
    order, image_events = increasing_order(stamps, "image")
    stamps = stamps[order]
    paths = [folder / names[k] for k in order.tolist()]
    check_first_image(TumSequence, paths, calibration)
    imu, imu_events = imu_from_table(read_seconds_table(folder / "imu.txt", _IMU_WIDTH), 0, 3)
    truth, truth_events = _truth(folder / "groundtruth.txt", config)
    return TumSequence.of_part(
        folder, calibration, stamps, paths, imu, truth, config, max_gap_s,
        (*image_events, *imu_events, *truth_events),
    )  # fmt: skip


def _calibration(folder: Path, config: DatasetConfig) -> Calibration:
    if config.calibration is not None:
        return named_calibration(config)
    found = find_calibration(folder, config.camera)
    if found is None:
        raise DataError(
            f"{folder}: no calibration of '{config.camera}' in it: name a Kalibr or OpenVINS "
            "camera chain, or an ASL sensor.yaml, by dataset.calibration"
        )
    return found


def _truth(path: Path, config: DatasetConfig) -> tuple[Truth | None, list[Event]]:
    if not path.is_file():
        return None, []
    table = read_seconds_table(path, _POSE_WIDTH)
    poses = poses_from_quaternions(table, w_first=False)
    trajectory, _, events = ordered_trajectory(table.stamps_ns, poses, truth_frame(config))
    return Truth(trajectory), events
