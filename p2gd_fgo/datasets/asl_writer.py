"""Write a recording as an ASL folder, as EuRoC's: images, IMU and truth under ``mav0``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np
import yaml

from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.geometry.camera import Camera, RadTanCamera
from p2gd_fgo.geometry.so3 import to_quaternion
from p2gd_fgo.types import NANOSECONDS, FloatArray, Image, ImuBatch, IntArray, Truth

_PNG_COMPRESSION = 2  # more costs time and saves little: the sensor's noise doesn't compress
_STORED = [cv2.IMWRITE_PNG_COMPRESSION, 0, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
_CAMERA_HEADER = "#timestamp [ns],filename"
_IMU_HEADER = "#timestamp [ns]," + ",".join(
    [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"a_RS_S_{a} [m s^-2]" for a in "xyz"]
)
_TRUTH_COLUMNS = [
    "#timestamp [ns]",
    *(f"p_RS_R_{a} [m]" for a in "xyz"),
    *(f"q_RS_{a} []" for a in "wxyz"),
    *(f"v_RS_R_{a} [m s^-1]" for a in "xyz"),
    *(f"b_w_RS_S_{a} [rad s^-1]" for a in "xyz"),
    *(f"b_a_RS_S_{a} [m s^-2]" for a in "xyz"),
]


def write_asl(
    folder: Path,
    calibration: Calibration,
    image_stamps_ns: IntArray,
    images: Iterable[Image],
    imu: ImuBatch,
    truth: Truth | None,
) -> None:
    """Write ``folder``/mav0, image by image; other arguments as :func:`write_sensors`.

    Parameters
    ----------
    image_stamps_ns, images
        (N,) and N grey images, drawn from the iterable one at a time.

    Raises
    ------
    ValueError
        Fewer or more images than stamps.
    """
    data = folder / "mav0" / "cam0" / "data"
    data.mkdir(parents=True)
    for stamp, image in zip(image_stamps_ns, images, strict=True):
        write_png(data / f"{stamp}.png", image)
    write_sensors(folder, calibration, image_stamps_ns, imu, truth)


def write_png(path: Path, image: Image, *, compress: bool = True) -> None:
    """Write one grey image.

    Parameters
    ----------
    compress
        False: 1.6 times the bytes of a noisy image, which are written and read in a tenth of the
        time. For images that are read many times.
    """
    how = [cv2.IMWRITE_PNG_COMPRESSION, _PNG_COMPRESSION] if compress else _STORED
    _, encoded = cv2.imencode(".png", image, how)
    path.write_bytes(encoded.tobytes())


def write_sensors(
    folder: Path,
    calibration: Calibration,
    image_stamps_ns: IntArray,
    imu: ImuBatch,
    truth: Truth | None,
    *,
    suffixes: Sequence[str] | None = None,
) -> None:
    """Write all of ``folder``/mav0 but the images; numbers of the csv files with 12 digits.

    Parameters
    ----------
    truth
        Of the IMU; its velocity and biases are written as far as the columns of the format let:
        velocity, then both biases. None: no file.
    suffixes
        (N,) endings of the image files, ``.png`` unless given.
    """
    camera, inertial, reference = (
        folder / "mav0" / name for name in ("cam0", "imu0", "state_groundtruth_estimate0")
    )
    for path in (camera, inertial):
        path.mkdir(parents=True, exist_ok=True)
    endings = suffixes or [".png"] * len(image_stamps_ns)
    names = zip(image_stamps_ns.tolist(), endings, strict=True)
    rows = [_CAMERA_HEADER, *(f"{stamp},{stamp}{suffix}" for stamp, suffix in names)]
    (camera / "data.csv").write_text("\n".join(rows) + "\n", encoding="ascii")
    _write_yaml(camera / "sensor.yaml", _camera_sensor(calibration, image_stamps_ns))
    _write_csv(inertial / "data.csv", _IMU_HEADER, imu.stamps_ns, np.hstack([imu.gyro, imu.accel]))
    _write_yaml(inertial / "sensor.yaml", _imu_sensor(calibration, imu))
    if truth is None:
        return
    reference.mkdir(exist_ok=True)
    columns = _truth_columns(truth)
    header = ",".join(_TRUTH_COLUMNS[: columns.shape[1] + 1])
    _write_csv(reference / "data.csv", header, truth.trajectory.stamps_ns, columns)
    _write_yaml(
        reference / "sensor.yaml",
        {"sensor_type": "visual-inertial", "T_BS": _matrix(np.eye(4))},
    )


def _truth_columns(truth: Truth) -> FloatArray:
    T = truth.trajectory.T_world_imu
    columns = [T[:, :3, 3], np.roll(to_quaternion(T[:, :3, :3]), 1, axis=-1)]
    if truth.velocity is not None:
        columns.append(truth.velocity)
        if truth.gyro_bias is not None and truth.accel_bias is not None:
            columns += [truth.gyro_bias, truth.accel_bias]
    return np.hstack(columns)


def _camera_sensor(calibration: Calibration, stamps_ns: IntArray) -> dict[str, object]:
    camera: Camera = calibration.camera
    offset = calibration.time_offset_s
    return {
        "sensor_type": "camera",
        "T_BS": _matrix(calibration.T_imu_cam),
        "rate_hz": _rate_hz(stamps_ns),
        "resolution": [camera.width, camera.height],
        "camera_model": "pinhole",
        "intrinsics": [camera.fx, camera.fy, camera.cx, camera.cy],
        **_distortion(camera),
        **({"time_offset_s": offset} if offset else {}),
    }


def _distortion(camera: Camera) -> dict[str, object]:
    if isinstance(camera, RadTanCamera):
        coefficients = [camera.k1, camera.k2, camera.p1, camera.p2]
        return {
            "distortion_model": "radial-tangential",
            "distortion_coefficients": coefficients + ([camera.k3] if camera.k3 else []),
        }
    coefficients = [getattr(camera, f"k{i}") for i in range(1, 5)]
    return {"distortion_model": "equidistant", "distortion_coefficients": coefficients}


def _imu_sensor(calibration: Calibration, imu: ImuBatch) -> dict[str, object]:
    sensor: dict[str, object] = {
        "sensor_type": "imu",
        "T_BS": _matrix(np.eye(4)),
        "rate_hz": _rate_hz(imu.stamps_ns),
    }
    noise = calibration.imu_noise
    if noise is not None:
        sensor |= {
            "gyroscope_noise_density": noise.gyro_noise_density,
            "gyroscope_random_walk": noise.gyro_random_walk,
            "accelerometer_noise_density": noise.accel_noise_density,
            "accelerometer_random_walk": noise.accel_random_walk,
        }
    return sensor


def _rate_hz(stamps_ns: IntArray) -> int:
    steps = np.diff(stamps_ns)
    return round(NANOSECONDS / float(np.median(steps))) if len(steps) else 0


def _matrix(T: FloatArray) -> dict[str, object]:
    return {"cols": 4, "rows": 4, "data": [float(x) for x in T.ravel()]}


def _write_yaml(path: Path, content: dict[str, object]) -> None:
    path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None), "ascii")


def _write_csv(path: Path, header: str, stamps_ns: IntArray, values: FloatArray) -> None:
    rows = [
        f"{stamp}," + ",".join(f"{x:.12g}" for x in row)
        for stamp, row in zip(stamps_ns.tolist(), values.tolist(), strict=True)
    ]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="ascii")
