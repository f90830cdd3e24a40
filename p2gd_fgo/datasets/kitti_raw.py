"""KITTI raw drives (Geiger et al., IJRR 2013), ``extract`` or ``sync``.

::

    image_00/{timestamps.txt, data/*.png}              left grey; image_01 to 03 by dataset.camera
    oxts/{timestamps.txt, data/*.txt}                  30 numbers a file: IMU and truth
    ../calib_{cam_to_cam,velo_to_cam,imu_to_velo}.txt  the day's; also taken from the drive's folder
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.calibration_files import load_calibration, with_offset
from p2gd_fgo.datasets.clock_times import read_clock_times
from p2gd_fgo.datasets.csv_tables import Table
from p2gd_fgo.datasets.folder_sequence import FolderSequence, check_first_image
from p2gd_fgo.datasets.images import decode_grey
from p2gd_fgo.datasets.imu_samples import imu_from_table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.datasets.kitti_calibration import FILES, load_kitti_calibration
from p2gd_fgo.datasets.poses import check_finite, ordered_trajectory
from p2gd_fgo.errors import DataError, ImageError
from p2gd_fgo.geometry import pose, so3
from p2gd_fgo.types import Event, FloatArray, Truth
from p2gd_fgo.user_paths import user_path

_COLUMNS = 30
_EARTH_RADIUS = 6_378_137.0
_ROLL, _NORTH, _EAST, _UP, _ACCEL, _GYRO = 3, 6, 7, 10, 11, 17
_CAMERAS = {f"cam{k}": f"0{k}" for k in range(4)} | {f"image_0{k}": f"0{k}" for k in range(4)}


class KittiRawSequence(FolderSequence):
    """A drive of KITTI raw."""

    __slots__ = ()


def is_kitti_raw(folder: Path) -> bool:
    """Whether the folder looks like one of KITTI raw's drives."""
    return (folder / "oxts").is_dir() and any(folder.glob("image_0?"))


def open_kitti_raw(folder: Path, config: DatasetConfig, max_gap_s: float) -> KittiRawSequence:
    """Read everything but the images.

    Raises
    ------
    DataError
        Files are missing or malformed, sensors that don't overlap in time, no image, or a first
        one that is of neither size of the calibration.
    """
    number = _CAMERAS.get(config.camera)
    if number is None:
        raise DataError(
            f"dataset.camera is {config.camera!r}, but KITTI raw has {', '.join(_CAMERAS)}"
        )
    images = folder / f"image_{number}"
    stamps, rows = read_clock_times(images / "timestamps.txt")
    order, image_events = increasing_order(stamps, "image")
    stamps = stamps[order]
    paths = [images / "data" / f"{rows[k]:010d}.png" for k in order.tolist()]
    calibration = with_offset(_calibration(folder, number, paths, config), config.time_offset_s)
    check_first_image(KittiRawSequence, paths, calibration)
    table = _oxts(folder / "oxts")
    imu, imu_events = imu_from_table(table, _GYRO, _ACCEL)
    truth, truth_events = _truth(table)
    return KittiRawSequence.of_part(
        folder, calibration, stamps, paths, imu, truth, config, max_gap_s,
        (*image_events, *imu_events, *truth_events),
    )  # fmt: skip


def _calibration(
    folder: Path, number: str, paths: list[Path], config: DatasetConfig
) -> Calibration:
    given = (
        None if config.calibration is None else user_path(config.calibration, "dataset.calibration")
    )
    if given is not None and not (given / FILES[0]).is_file():
        return load_calibration(given, config.camera)
    homes = [given] if given is not None else [folder, folder.parent]
    home = next((h for h in homes if (h / FILES[0]).is_file()), homes[-1])
    return load_kitti_calibration(home, number, _image_size(paths))


def _image_size(paths: list[Path]) -> tuple[int, int]:
    """Width and height of the first image that can be decoded."""
    fault = DataError(f"{paths[0].parent}: no image, the first would be {paths[0].name}")
    for path in (path for path in paths if path.is_file()):
        try:
            height, width = decode_grey(path).shape
        except ImageError as error:
            fault = error
            continue
        return width, height
    raise fault


def _oxts(folder: Path) -> Table:
    """All packets (N, 30) whose file is there; stamps by the packets' own clock."""
    stamps, rows = read_clock_times(folder / "timestamps.txt")
    kept, values = [], []
    for k, row in enumerate(rows):
        path = folder / "data" / f"{row:010d}.txt"
        try:
            words = path.read_text(encoding="ascii").split()
            numbers = [float(word) for word in words[:_COLUMNS]]
        except FileNotFoundError:  # some drives miss a few packets
            continue
        except (OSError, ValueError) as error:
            raise DataError(f"{path}: not readable as numbers: {error}") from None
        if len(numbers) < _COLUMNS:
            raise DataError(f"{path}: {len(numbers)} numbers found, {_COLUMNS} needed")
        kept.append(k)
        values.append(numbers)
    if not kept:
        raise DataError(f"{folder / 'data'}: no packet, the first would be {0:010d}.txt")
    index = np.array(kept)
    return Table(folder / "data", index, stamps[index], np.array(values))


def _truth(table: Table) -> tuple[Truth, list[Event]]:
    """Poses of the inertial unit in a world east, north, up, from the first position on."""
    check_finite(table)
    lat, lon, alt = table.values[:, 0:3].T
    if np.abs(lat).max() > 89.0:
        raise DataError(
            f"{table.path}: a latitude of {np.abs(lat).max():g}° is no place of a drive"
        )
    scale = _EARTH_RADIUS * np.cos(np.radians(lat[0]))  # Mercator, as in the data set's devkit
    east = scale * np.radians(lon)
    north = scale * np.log(np.tan(np.radians(90.0 + lat) / 2.0))
    p = np.stack([east, north, alt], axis=1)
    R = _from_euler(*table.values[:, _ROLL : _ROLL + 3].T)
    trajectory, order, events = ordered_trajectory(
        table.stamps_ns, pose.from_rotation_translation(R, p - p[0]), np.eye(4)
    )
    velocity = table.values[order][:, [_EAST, _NORTH, _UP]]
    return Truth(trajectory, velocity=velocity), events


def _from_euler(roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """R (N, 3, 3) = Rz(yaw) Ry(pitch) Rx(roll), angles (N,) in rad; yaw 0 is east."""
    x, y, z = np.eye(3)
    return so3.exp(yaw[:, None] * z) @ so3.exp(pitch[:, None] * y) @ so3.exp(roll[:, None] * x)
