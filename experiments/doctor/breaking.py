"""Copies of an ASL folder, each broken one way; images are linked, not copied."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray

MS = 1_000_000
TRUTH = ("state_groundtruth_estimate0", "mocap0")


@dataclass
class Copy:
    """The tables and files of a recording, in memory: stamps apart from the numbers."""

    camera: dict[str, Any]
    images: list[tuple[int, str]]
    imu_stamps: np.ndarray
    imu: FloatArray
    truth_stamps: np.ndarray
    truth: FloatArray
    truth_folder: str


def read(mav0: Path) -> Copy:
    folder = next(name for name in TRUTH if (mav0 / name / "data.csv").is_file())
    with (mav0 / "cam0" / "data.csv").open() as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    return Copy(
        yaml.safe_load((mav0 / "cam0" / "sensor.yaml").read_text()),
        [(int(row[0]), row[1].strip()) for row in rows],
        *_table(mav0 / "imu0" / "data.csv"),
        *_table(mav0 / folder / "data.csv"),
        folder,
    )


def write(copy: Copy, original: Path, target: Path) -> Path:
    """Write ``target/mav0``; images stay where they are."""
    shutil.rmtree(target, ignore_errors=True)
    mav0 = target / "mav0"
    (mav0 / "cam0").mkdir(parents=True)
    (mav0 / "imu0").mkdir()
    (mav0 / copy.truth_folder).mkdir()
    (mav0 / "cam0" / "data").symlink_to((original / "cam0" / "data").resolve())
    (mav0 / "cam0" / "sensor.yaml").write_text(yaml.safe_dump(copy.camera))
    shutil.copyfile(original / "imu0" / "sensor.yaml", mav0 / "imu0" / "sensor.yaml")
    rows = [f"{stamp},{name}" for stamp, name in copy.images]
    (mav0 / "cam0" / "data.csv").write_text("#timestamp [ns],filename\n" + "\n".join(rows) + "\n")
    _save(mav0 / "imu0" / "data.csv", copy.imu_stamps, copy.imu)
    _save(mav0 / copy.truth_folder / "data.csv", copy.truth_stamps, copy.truth)
    return target


def _table(path: Path) -> tuple[np.ndarray, FloatArray]:
    lines = [line for line in path.read_text().splitlines() if line and line[0].isdigit()]
    stamps = np.array([int(line.partition(",")[0]) for line in lines], np.int64)
    return stamps, np.loadtxt(lines, delimiter=",", ndmin=2)[:, 1:]


def _save(path: Path, stamps: np.ndarray, values: FloatArray) -> None:
    rows = (
        f"{s}," + ",".join(f"{v:.12g}" for v in row) for s, row in zip(stamps, values, strict=True)
    )
    path.write_text("#timestamp [ns]\n" + "\n".join(rows) + "\n")


def late_images(copy: Copy) -> None:
    copy.images = [(stamp - 60 * MS, name) for stamp, name in copy.images]


def inverted_extrinsic(copy: Copy) -> None:
    T = np.array(copy.camera["T_BS"]["data"]).reshape(4, 4)
    copy.camera["T_BS"]["data"] = np.linalg.inv(T).ravel().tolist()


def extrinsic_off(copy: Copy) -> None:
    """By 8° about the camera's x axis."""
    T = np.array(copy.camera["T_BS"]["data"]).reshape(4, 4)
    T[:3, :3] = T[:3, :3] @ so3.exp(np.radians([8.0, 0.0, 0.0]))
    copy.camera["T_BS"]["data"] = T.ravel().tolist()


def degrees(copy: Copy) -> None:
    copy.imu[:, :3] = np.degrees(copy.imu[:, :3])


def swapped_axes(copy: Copy) -> None:
    """Of gyro and accelerometer, x and y."""
    copy.imu = copy.imu[:, [1, 0, 2, 4, 3, 5]]


def flipped_gyro(copy: Copy) -> None:
    copy.imu[:, 2] *= -1.0


def flipped_accel(copy: Copy) -> None:
    copy.imu[:, 5] *= -1.0


def in_g(copy: Copy) -> None:
    copy.imu[:, 3:] /= 9.80665


def saturated_gyro(copy: Copy) -> None:
    """At half of its largest value."""
    limit = 0.5 * np.abs(copy.imu[:, :3]).max()
    copy.imu[:, :3] = np.clip(copy.imu[:, :3], -limit, limit)


def other_model(copy: Copy) -> None:
    copy.camera["distortion_model"] = "equidistant"
    copy.camera["distortion_coefficients"] = copy.camera["distortion_coefficients"][:4]


def no_distortion(copy: Copy) -> None:
    copy.camera["distortion_coefficients"] = [0.0, 0.0, 0.0, 0.0]


def other_focal(copy: Copy) -> None:
    """Intrinsics of the image at 5/4 of its size."""
    copy.camera["intrinsics"] = [1.25 * v for v in copy.camera["intrinsics"][:2]] + list(
        copy.camera["intrinsics"][2:]
    )


def other_size(copy: Copy) -> None:
    copy.camera["resolution"] = [n // 2 for n in copy.camera["resolution"]]


def imu_gap(copy: Copy) -> None:
    middle = (copy.imu_stamps[0] + copy.imu_stamps[-1]) // 2
    kept = np.abs(copy.imu_stamps - middle) > 2500 * MS
    copy.imu_stamps, copy.imu = copy.imu_stamps[kept], copy.imu[kept]


def late_truth(copy: Copy) -> None:
    copy.truth_stamps = copy.truth_stamps + 60 * MS


def late_imu(copy: Copy) -> None:
    copy.imu_stamps = copy.imu_stamps + 60 * MS


def turned_truth(copy: Copy) -> None:
    """The body's axes, by 10° about x."""
    R = so3.from_quaternion(copy.truth[:, 3:7], w_first=True) @ so3.exp(np.radians([10.0, 0, 0]))
    copy.truth[:, 3:7] = np.roll(so3.to_quaternion(R), 1, axis=1)


def tilted_world(copy: Copy) -> None:
    """The world's y axis up, as in many a camera's world."""
    turn = so3.exp(np.radians([90.0, 0.0, 0.0]))
    R = turn @ so3.from_quaternion(copy.truth[:, 3:7], w_first=True)
    copy.truth[:, 3:7] = np.roll(so3.to_quaternion(R), 1, axis=1)
    copy.truth[:, :3] = copy.truth[:, :3] @ turn.T


def inverted_truth(copy: Copy) -> None:
    copy.truth[:, 4:7] *= -1.0


def frozen_images(copy: Copy) -> None:
    """Every third image repeats the one before."""
    for k in range(2, len(copy.images), 3):
        copy.images[k] = (copy.images[k][0], copy.images[k - 1][1])


@dataclass(frozen=True)
class Break:
    """A way to spoil a recording, the names that count as right, and those that come along."""

    spoil: Callable[[Copy], None]
    names: tuple[str, ...]
    along: tuple[str, ...] = ()


BREAKS = {
    "camera stamps 60 ms early": Break(late_images, ("time_offset",)),
    "T_imu_cam inverted": Break(inverted_extrinsic, ("extrinsic_inverted",)),
    "gyro in deg/s": Break(degrees, ("gyro_units",)),
    "IMU axes x, y swapped": Break(swapped_axes, ("gyro_axes",), ("accel_axes",)),
    "distortion of another model": Break(other_model, ("distortion",), ("distortion_model",)),
    "IMU gap of 5 s": Break(imu_gap, ("imu_gap",)),
    "truth 60 ms late": Break(late_truth, ("truth_time",)),
    "truth's body turned by 10°": Break(turned_truth, ("truth_rotation",), ("truth_gravity",)),
    "accelerometer in g": Break(in_g, ("accel_units",)),
    "sign of gyro z": Break(flipped_gyro, ("gyro_axes",)),
    "fx, fy 25 % too large": Break(other_focal, ("focal_length",)),
    "no distortion given": Break(no_distortion, ("distortion",)),
    "T_imu_cam off by 8°": Break(extrinsic_off, ("extrinsic_rotation",)),
    "sign of accelerometer z": Break(flipped_accel, ("accel_axes",)),
    "IMU stamps 60 ms late": Break(late_imu, ("imu_time",)),
    "gyro saturated": Break(saturated_gyro, ("gyro_saturated",)),
    "truth's world with y up": Break(tilted_world, ("truth_gravity",)),
    "truth's quaternions inverted": Break(
        inverted_truth, ("truth_inverted",), ("truth_gravity", "accel_axes")
    ),
    "every third image frozen": Break(frozen_images, ("images_frozen",)),
    "calibration for half the size": Break(other_size, ("refused",)),
}
"""The first ten are those that a doctor must name."""
