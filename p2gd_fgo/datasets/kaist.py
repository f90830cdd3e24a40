"""KAIST Urban (Jeong et al., IJRR 2019): left camera and MTi IMU.

::

    calibration/{left.yaml, Vehicle2IMU.txt, Vehicle2Stereo.txt}
    image/stereo_left/<stamp ns>.png                   unrectified, 8-bit Bayer RGGB
    sensor_data/stereo_stamp.csv                       stamps of the images
    sensor_data/xsens_imu.csv                          17 columns, see _GYRO and _ACCEL
    global_pose.csv                                    stamp, 3x4 matrix of the vehicle's pose
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.datasets.calibration_fields import (
    exact_transform,
    known_model,
    make_camera,
    numbers,
    read_yaml,
)
from p2gd_fgo.datasets.calibration_files import named_calibration, with_offset
from p2gd_fgo.datasets.csv_tables import Table, read_stamps, read_table, whole_stamp
from p2gd_fgo.datasets.folder_sequence import FolderSequence, check_first_image
from p2gd_fgo.datasets.images import decode_raw
from p2gd_fgo.datasets.imu_samples import imu_from_table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.datasets.poses import ordered_trajectory, poses_from_matrices
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.types import Event, FloatArray, Image, IntArray, Truth

_IMU_WIDTH, _GYRO, _ACCEL = 17, 7, 10  # stamp; quaternion 4, Euler 3, gyro 3, accel 3, magnetic 3
_POSE_WIDTH = 13
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NOISE = ImuNoise(1.7453e-4, 1e-5, 5.886e-3, 1e-4)
"""Of the MTi-300, as OpenVINS uses it for this data set; the recordings don't say."""


class KaistSequence(FolderSequence):
    """A drive of KAIST Urban."""

    __slots__ = ()

    @staticmethod
    def decode(path: Path) -> Image:
        """Read a Bayer image as grey (H, W).

        Raises
        ------
        DataError
            The file is missing, truncated or no image.
        """
        raw = decode_raw(path)
        if raw.ndim == 3:  # some copies of the data set hold colour images
            return np.asarray(cv2.cvtColor(raw, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return np.asarray(cv2.cvtColor(raw, cv2.COLOR_BayerRGGB2GRAY), dtype=np.uint8)

    def encoded_image(self, index: int) -> None:
        """None: the files are Bayer mosaics."""
        return


def is_kaist(folder: Path) -> bool:
    """Whether the folder looks like one of KAIST Urban's."""
    return (folder / "image" / "stereo_left").is_dir() or (
        folder / "sensor_data" / "xsens_imu.csv"
    ).is_file()


def open_kaist(folder: Path, config: DatasetConfig, max_gap_s: float) -> KaistSequence:
    """Read everything but the images.

    The truth is the vehicle's; it is moved to the IMU by ``Vehicle2IMU.txt``, and the world's
    origin to its first position (the data set's, UTM, has seven digits before the point). Where it
    has holes they stay.

    Raises
    ------
    DataError
        Files are missing or malformed; an IMU file without the raw measurements; sensors that
        don't overlap in time; no image, or a first one of another size.
    """
    T_vehicle_imu = _vehicle_from(folder / "calibration" / "Vehicle2IMU.txt")
    calibration = with_offset(_calibration(folder, T_vehicle_imu, config), config.time_offset_s)
    stamps, image_events = _image_stamps(folder)
    paths = [folder / "image" / "stereo_left" / f"{stamp}.png" for stamp in stamps.tolist()]
    check_first_image(KaistSequence, paths, calibration)
    imu, imu_events = imu_from_table(_imu_table(folder), _GYRO, _ACCEL)
    truth, truth_events = _truth(folder / "global_pose.csv", T_vehicle_imu)
    return KaistSequence.of_part(
        folder, calibration, stamps, paths, imu, truth, config, max_gap_s,
        (*image_events, *imu_events, *truth_events),
    )  # fmt: skip


def _calibration(folder: Path, T_vehicle_imu: FloatArray, config: DatasetConfig) -> Calibration:
    if config.calibration is not None:
        given = named_calibration(config)
        return given if given.imu_noise is not None else replace(given, imu_noise=_NOISE)
    if config.camera != "cam0":
        raise DataError(
            f"dataset.camera is {config.camera!r}, but of KAIST Urban only the left camera is "
            "read: leave it at 'cam0'"
        )
    path = folder / "calibration" / "left.yaml"
    data, where = read_yaml(path), str(path)
    fx, skew, cx, _, fy, cy, *_ = numbers(data, "camera_matrix", (9,), where)
    if skew != 0.0:
        raise DataError(f"{where}: camera_matrix has a skew of {skew}, known are cameras without")
    model = data.get("distortion_model", "plumb_bob")
    counts = known_model(model, where)
    k = [] if counts == (0,) else numbers(data, "distortion_coefficients", counts, where)
    size = [numbers(data, f"image_{side}", (1,), where)[0] for side in ("width", "height")]
    T_vehicle_cam = _vehicle_from(folder / "calibration" / "Vehicle2Stereo.txt")
    return Calibration(
        camera=make_camera(model, size, [fx, fy, cx, cy], k, where),
        T_imu_cam=pose.inverse(T_vehicle_imu) @ T_vehicle_cam,
        imu_noise=_NOISE,
    )


def _vehicle_from(path: Path) -> FloatArray:
    """``T_vehicle_sensor`` (4, 4): lines that begin with ``R:`` (nine numbers) and ``T:``."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise DataError(
            f"{path}: no such file; put the calibration folder of the data set beside image and "
            "sensor_data"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not readable as text: {error}") from None
    found = {}
    for name, count in (("R:", 9), ("T:", 3)):
        line = next((line for line in lines if line.strip().startswith(name)), "")
        values = [float(text) for text in _NUMBER.findall(line)]
        if len(values) != count:
            raise DataError(
                f"{path}: {len(values)} numbers found in the line that begins with '{name}', "
                f"needed are {count}"
            )
        found[name] = np.array(values)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = found["R:"].reshape(3, 3), found["T:"]
    return exact_transform(T, f"{path}: R, T")


def _image_stamps(folder: Path) -> tuple[IntArray, list[Event]]:
    """Stamps by the list, or, without it, by the files' names."""
    listed = folder / "sensor_data" / "stereo_stamp.csv"
    if listed.is_file():
        stamps = read_stamps(listed)
    else:
        images = folder / "image" / "stereo_left"
        names = [path.stem for path in images.glob("*.png") if path.stem.isdecimal()]
        if not names:
            raise DataError(
                f"{images}: no image named by its stamp, such as 1544590798000000000.png"
            )
        stamps = np.array(sorted(whole_stamp(n, str(images)) for n in names), dtype=np.int64)
    order, events = increasing_order(stamps, "image")
    return stamps[order], events


def _imu_table(folder: Path) -> Table:
    path = folder / "sensor_data" / "xsens_imu.csv"
    table = read_table(path, (8, _IMU_WIDTH))
    if table.values.shape[1] + 1 < _IMU_WIDTH:
        raise DataError(
            f"{path}: the rows have no raw gyro and accelerometer, which takes {_IMU_WIDTH} "
            "columns: take the newer release of the recording"
        )
    return table


def _truth(path: Path, T_vehicle_imu: FloatArray) -> tuple[Truth | None, list[Event]]:
    if not path.is_file():
        return None, []
    table = read_table(path, (_POSE_WIDTH,))
    T_world_vehicle = poses_from_matrices(table)
    T_world_vehicle[:, :3, 3] -= T_world_vehicle[0, :3, 3].copy()
    trajectory, _, events = ordered_trajectory(table.stamps_ns, T_world_vehicle, T_vehicle_imu)
    return Truth(trajectory), events
