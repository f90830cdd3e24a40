"""Calibration of KITTI raw: three text files beside the drives of a day."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.calibration_fields import exact_transform
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.types import FloatArray

FILES = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt")


@dataclass(frozen=True, slots=True)
class _Fields:
    """Lines ``key: numbers`` of a file."""

    path: Path
    lines: dict[str, str]

    def array(self, key: str, count: int) -> FloatArray:
        text = self.lines.get(key)
        if text is None:
            raise DataError(f"{self.path}: {key} is missing")
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            raise DataError(f"{self.path}: {key} is {text[:60]!r}, not numbers") from None
        if len(values) != count or not np.isfinite(values).all():
            raise DataError(
                f"{self.path}: {key} holds {len(values)} numbers, needed are {count}, all finite"
            )
        return values

    def transform(self, R: str = "R", T: str = "T") -> FloatArray:
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = self.array(R, 9).reshape(3, 3), self.array(T, 3)
        return exact_transform(out, f"{self.path}: {R}, {T}")


def load_kitti_calibration(folder: Path, camera: str, size: tuple[int, int]) -> Calibration:
    """Calibration of one camera, by the size of its images.

    The data set holds every drive twice: ``extract`` has the images as recorded (K, D with k3, S),
    ``sync`` those that were rectified (P_rect, S_rect), which are pinhole images of a camera that
    is turned by R_rect and shifted along the baseline (Geiger et al., IJRR 2013, eq. 4-8).

    Parameters
    ----------
    folder
        Holds the three files.
    camera
        Two digits: ``00`` left grey, ``01`` right grey, ``02`` and ``03`` colour.
    size
        Width and height of its images, px.

    Raises
    ------
    DataError
        A file or field is missing or malformed, or the images are of neither size.
    """
    cameras, velo, imu = (_read(folder / name) for name in FILES)
    T_cam0_imu = velo.transform() @ imu.transform()
    as_recorded = cameras.array(f"S_{camera}", 2)
    rectified = cameras.array(f"S_rect_{camera}", 2)
    where = f"{cameras.path}: camera {camera}"
    if (rectified == size).all():
        P = cameras.array(f"P_rect_{camera}", 12).reshape(3, 4)
        R_rect = np.eye(4)
        R_rect[:3, :3] = cameras.array("R_rect_00", 9).reshape(3, 3)
        shift = np.eye(4)
        shift[:3, 3] = np.linalg.solve(P[:, :3], P[:, 3]) if np.linalg.det(P[:, :3]) else 0.0
        T_cam_imu = shift @ exact_transform(R_rect, f"{cameras.path}: R_rect_00") @ T_cam0_imu
        K, D = P[:, :3], np.zeros(5)
    elif (as_recorded == size).all():
        T_cam_imu = cameras.transform(f"R_{camera}", f"T_{camera}") @ T_cam0_imu
        K = cameras.array(f"K_{camera}", 9).reshape(3, 3)
        D = cameras.array(f"D_{camera}", 5)
    else:
        raise DataError(
            f"{where} has images of {as_recorded[0]:.0f}x{as_recorded[1]:.0f} px as recorded and "
            f"{rectified[0]:.0f}x{rectified[1]:.0f} rectified, but those here are "
            f"{size[0]}x{size[1]}: take the calibration of the same day"
        )
    try:
        lens = RadTanCamera(*size, *K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *D.tolist())
    except DataError as error:
        raise DataError(f"{where}: {error}") from None
    return Calibration(camera=lens, T_imu_cam=pose.inverse(T_cam_imu), imu_noise=None)


def _read(path: Path) -> _Fields:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DataError(
            f"{path}: no such file; put the calibration of the day ({', '.join(FILES)}) into the "
            "drive's folder or the one above, or name its folder by dataset.calibration"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not readable as text: {error}") from None
    pairs = (line.partition(":") for line in text.splitlines())
    return _Fields(path, {re.sub(r"\s", "", key): value for key, _, value in pairs})
