"""One small recording, written on disk in the formats that the readers read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse
from p2gd_fgo.types import NANOSECONDS, FloatArray, Image, ImuBatch, IntArray, Trajectory

WIDTH, HEIGHT = 64, 48
START_NS = 1_317_042_143_012_345_678  # 19 digits: a float would lose the last ones
IMU_TOPIC, TRUTH_TOPIC, IMAGE_TOPIC = "/imu0", "/truth", "/cam0/image_raw"
T_IMU_CAM = from_rotation_translation(
    so3.exp(np.array([1.2, -1.1, 1.3])), np.array([0.3, -0.1, 0.05])
)


@dataclass(frozen=True)
class Content:
    """Six images at 10 Hz, IMU at 200 Hz and truth at 50 Hz around them."""

    image_stamps_ns: IntArray
    images: list[Image]
    imu: ImuBatch
    truth: Trajectory

    def without_truth_between(self, first_s: float, last_s: float) -> Content:
        t = (self.truth.stamps_ns - START_NS) / NANOSECONDS
        kept = (t <= first_s) | (t >= last_s)
        truth = Trajectory(self.truth.stamps_ns[kept], self.truth.T_world_imu[kept])
        return replace(self, truth=truth)

    def between(self, first_ns: int, last_ns: int) -> Content:
        """What was measured from the first time to before the last."""

        def kept(stamps_ns: IntArray) -> slice:
            return slice(*np.searchsorted(stamps_ns, [first_ns, last_ns]).tolist())

        i, k, t = (
            kept(s) for s in (self.image_stamps_ns, self.imu.stamps_ns, self.truth.stamps_ns)
        )
        return Content(
            self.image_stamps_ns[i],
            self.images[i],
            ImuBatch(self.imu.stamps_ns[k], self.imu.gyro[k], self.imu.accel[k]),
            Trajectory(self.truth.stamps_ns[t], self.truth.T_world_imu[t]),
        )


def content(images: int = 6) -> Content:
    rng = np.random.default_rng(3)
    stamps = START_NS + 100_000_000 * np.arange(images, dtype=np.int64)
    duration_ns = 100_000_000 * images
    imu_stamps = np.arange(START_NS - 50_000_000, START_NS + duration_ns, 5_000_000, dtype=np.int64)
    truth_stamps = np.arange(
        START_NS - 40_000_000, START_NS + duration_ns, 20_000_000, dtype=np.int64
    )
    t = (truth_stamps - START_NS) / NANOSECONDS
    turn = np.stack([0.1 * t, -0.2 * t, 0.5 + t], axis=1)
    path = np.stack([5.0 * t, 2.0 * t**2, 0.3 * t], axis=1)
    return Content(
        stamps,
        list(rng.integers(0, 255, (images, HEIGHT, WIDTH)).astype(np.uint8)),
        ImuBatch(imu_stamps, *rng.standard_normal((2, len(imu_stamps), 3))),
        Trajectory(truth_stamps, from_rotation_translation(so3.exp(turn), path)),
    )


def chain(**changes: Any) -> dict[str, Any]:
    """Of OpenVINS; a Kalibr one with ``T_imu_cam=None, T_cam_imu=...``."""
    camera = {
        "T_imu_cam": T_IMU_CAM.tolist(),
        "camera_model": "pinhole",
        "distortion_coeffs": [-0.1, 0.01, 0.0002, 1e-05],
        "distortion_model": "radtan",
        "intrinsics": [40.0, 41.0, 31.5, 23.5],
        "resolution": [WIDTH, HEIGHT],
        "timeshift_cam_imu": 0.003,
    } | changes
    return {"cam0": {key: value for key, value in camera.items() if value is not None}}


NOISE = {
    "accelerometer_noise_density": 2e-3,
    "accelerometer_random_walk": 3e-3,
    "gyroscope_noise_density": 1.7e-4,
    "gyroscope_random_walk": 2e-5,
}


def write_chain(folder: Path, **changes: Any) -> Path:
    """Camera chain and IMU file; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    text = "%YAML:1.0\n\n" + yaml.safe_dump(chain(**changes))
    (folder / "kalibr_imucam_chain.yaml").write_text(text)
    imu = {"imu0": {"T_i_b": np.eye(4).tolist(), "rostopic": IMU_TOPIC} | NOISE}
    (folder / "kalibr_imu_chain.yaml").write_text("%YAML:1.0\n" + yaml.safe_dump(imu))
    return folder


def write_image(path: Path, image: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def quaternions(T: FloatArray) -> FloatArray:
    return so3.to_quaternion(T[:, :3, :3])


# TUM


def seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // NANOSECONDS}.{stamp_ns % NANOSECONDS:09d}"


def write_tum_folder(folder: Path, made: Content) -> Path:
    write_chain(folder)
    rows = []
    for stamp, image in zip(made.image_stamps_ns.tolist(), made.images, strict=True):
        write_image(folder / "rgb" / f"{seconds(stamp)}.png", image)
        rows.append(f"{seconds(stamp)} rgb/{seconds(stamp)}.png")
    (folder / "rgb.txt").write_text("\n".join(["# color images", *rows]) + "\n")
    write_seconds(
        folder / "imu.txt", made.imu.stamps_ns, np.hstack([made.imu.gyro, made.imu.accel])
    )
    poses = np.hstack([made.truth.T_world_imu[:, :3, 3], quaternions(made.truth.T_world_imu)])
    write_seconds(folder / "groundtruth.txt", made.truth.stamps_ns, poses)
    return folder


def write_seconds(path: Path, stamps_ns: IntArray, values: FloatArray) -> None:
    rows = [
        " ".join([seconds(stamp), *map(repr, row)])
        for stamp, row in zip(stamps_ns.tolist(), values.tolist(), strict=True)
    ]
    path.write_text("\n".join(["# time and values", *rows]) + "\n")


# KAIST Urban

T_VEHICLE_IMU = from_rotation_translation(np.eye(3), np.array([-0.07, 0.0, 1.7]))
UTM = np.array([333_333.25, 4_444_444.5, 20.0])


def mosaic(red: int, green: int, blue: int) -> Image:
    raw = np.full((HEIGHT, WIDTH), green, np.uint8)
    raw[0::2, 0::2], raw[1::2, 1::2] = red, blue
    return raw


def write_kaist_folder(folder: Path, made: Content) -> Path:
    calibration = folder / "calibration"
    calibration.mkdir(parents=True)
    left = {
        "image_width": WIDTH, "image_height": HEIGHT, "camera_name": "left",
        "camera_matrix": {"rows": 3, "cols": 3, "data": [40.0, 0, 31.5, 0, 41.0, 23.5, 0, 0, 1]},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.1, 0.01, 2e-4, 1e-5, 0.0]},
    }  # fmt: skip
    (calibration / "left.yaml").write_text(yaml.safe_dump(left))
    for name, T in (("IMU", T_VEHICLE_IMU), ("Stereo", T_VEHICLE_IMU @ T_IMU_CAM)):
        R, p = (" ".join(map(repr, x.ravel().tolist())) for x in (T[:3, :3], T[:3, 3]))
        text = f"RPY(roll/pitch/yaw, degree): 0 0 0\nR: {R}\nT: {p}\n"
        (calibration / f"Vehicle2{name}.txt").write_text(text)
    for k, stamp in enumerate(made.image_stamps_ns.tolist()):
        write_image(folder / "image" / "stereo_left" / f"{stamp}.png", mosaic(200, 100 + k, 50))
    (folder / "sensor_data").mkdir()
    stamps = "".join(f"{stamp}\n" for stamp in made.image_stamps_ns.tolist())
    (folder / "sensor_data" / "stereo_stamp.csv").write_text(stamps)
    count = len(made.imu)
    attitude, magnetic = np.full((count, 7), 7.0), np.full((count, 3), 9.0)
    values = np.hstack([attitude, made.imu.gyro, made.imu.accel, magnetic])
    write_rows(folder / "sensor_data" / "xsens_imu.csv", made.imu.stamps_ns, values)
    T_world_vehicle = made.truth.T_world_imu @ inverse(T_VEHICLE_IMU)
    T_world_vehicle[:, :3, 3] += UTM
    rows = T_world_vehicle[:, :3].reshape(-1, 12)
    write_rows(folder / "global_pose.csv", made.truth.stamps_ns, rows)
    return folder


def write_rows(path: Path, stamps_ns: IntArray, values: FloatArray) -> None:
    rows = [
        ",".join([str(stamp), *map(repr, row)])
        for stamp, row in zip(stamps_ns.tolist(), values.tolist(), strict=True)
    ]
    path.write_text("\n".join(rows) + "\n")


# KITTI raw

K_RECORDED, D_RECORDED = (
    [[40.0, 0, 31.5], [0, 41.0, 23.5], [0, 0, 1]],
    [-0.3, 0.1, 1e-3, 2e-3, -0.02],
)
P_RECT = np.array([[38.0, 0, 30.0, -19.0], [0, 38.0, 22.0, 0.1], [0, 0, 1, 0.002]])
R_RECT = so3.exp(np.array([0.01, -0.02, 0.005]))
T_VELO_IMU = from_rotation_translation(
    so3.exp(np.array([0.0, 0.01, 0.02])), np.array([-0.8, 0.3, -0.8])
)
T_CAM_VELO = from_rotation_translation(
    so3.exp(np.array([-1.2, 1.2, -1.2])), np.array([0.0, -0.08, -0.27])
)
T_CAM1_CAM0 = from_rotation_translation(
    so3.exp(np.array([0.01, 0.0, 0.02])), np.array([-0.5, 0.0, 0.0])
)
LATITUDE, LONGITUDE = 49.0, 8.4


def clock_time(stamp_ns: int) -> str:
    whole = datetime.fromtimestamp(stamp_ns // NANOSECONDS, tz=UTC).strftime("%Y-%m-%d %H:%M:%S")
    return f"{whole}.{stamp_ns % NANOSECONDS:09d}"


def write_kitti_folder(
    folder: Path, made: Content, *, rectified: bool = False, camera: str = "00"
) -> Path:
    """A drive; oxts at the truth's stamps, its IMU values from the IMU's first samples."""
    size = (WIDTH, HEIGHT)
    other = (WIDTH + 8, HEIGHT + 2)

    def numbers(values: Any) -> str:
        return " ".join(f"{x:.9e}" for x in np.ravel(values))

    lines = {
        f"S_{camera}": other if rectified else size, f"K_{camera}": K_RECORDED,
        f"D_{camera}": D_RECORDED,
        f"R_{camera}": np.eye(3) if camera == "00" else T_CAM1_CAM0[:3, :3],
        f"T_{camera}": np.zeros(3) if camera == "00" else T_CAM1_CAM0[:3, 3],
        f"S_rect_{camera}": size if rectified else other, "R_rect_00": R_RECT,
        f"P_rect_{camera}": P_RECT,
    }  # fmt: skip
    day = folder.parent
    drive = folder / f"image_{camera}"
    drive.mkdir(parents=True)
    text = "calib_time: 09-Jan-2012 13:57:47\n"
    text += "".join(f"{key}: {numbers(value)}\n" for key, value in lines.items())
    (day / "calib_cam_to_cam.txt").write_text(text)
    for name, T in (("velo_to_cam", T_CAM_VELO), ("imu_to_velo", T_VELO_IMU)):
        text = f"calib_time: 25-May-2012\nR: {numbers(T[:3, :3])}\nT: {numbers(T[:3, 3])}\n"
        (day / f"calib_{name}.txt").write_text(text)
    for k, image in enumerate(made.images):
        write_image(drive / "data" / f"{k:010d}.png", image)
    times = "".join(clock_time(stamp) + "\n" for stamp in made.image_stamps_ns.tolist())
    (drive / "timestamps.txt").write_text(times)
    (folder / "oxts" / "data").mkdir(parents=True)
    times = "".join(clock_time(stamp) + "\n" for stamp in made.truth.stamps_ns.tolist())
    (folder / "oxts" / "timestamps.txt").write_text(times)
    for k, T in enumerate(made.truth.T_world_imu):
        (folder / "oxts" / "data" / f"{k:010d}.txt").write_text(_packet(made, k, T))
    return folder


def _packet(made: Content, k: int, T: FloatArray) -> str:
    east, north, up = T[:3, 3]
    radius = 6_378_137.0
    latitude = LATITUDE + np.degrees(north / radius)  # of a sphere: a metre is a metre here
    longitude = LONGITUDE + np.degrees(east / (radius * np.cos(np.radians(LATITUDE))))
    R = T[:3, :3]
    roll, pitch = np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0])
    values = np.full(30, 7.0)
    values[:6] = latitude, longitude, up + 112.0, roll, pitch, np.arctan2(R[1, 0], R[0, 0])
    values[6:8], values[10] = (4.0, 3.0), 0.5  # velocity to the north, to the east, up
    values[11:14], values[17:20] = made.imu.accel[k], made.imu.gyro[k]
    return " ".join(f"{x:.14g}" for x in values) + "\n"


# Bags


def write_bag(
    path: Path,
    made: Content,
    *,
    kind: str,
    images: str = "mono8",
    image_topics: tuple[str, ...] = (IMAGE_TOPIC,),
    truth: str | None = "nav_msgs/msg/Odometry",
    truth_topics: tuple[str, ...] = (TRUTH_TOPIC,),
    compression: tuple[str, ...] = (),
    recorded_late_ns: Callable[[int], int] = lambda stamp: 2_000_000,
) -> Path:
    """A bag of a kind: ``ros1``, ``sqlite3`` or ``mcap``.

    Parameters
    ----------
    images
        Encoding of raw images, or the format of compressed ones, in which png or jpeg stands.
    compression
        ROS 1: the format; ROS 2: mode and format.
    recorded_late_ns
        How long after a header's stamp the message was recorded.
    """
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    maker = _Messages(store, kind == "ros1")
    rows = [
        (stamp, IMU_TOPIC, maker.imu(stamp, gyro, accel))
        for stamp, gyro, accel in zip(
            made.imu.stamps_ns.tolist(), made.imu.gyro, made.imu.accel, strict=True
        )
    ]
    for topic in image_topics:
        rows += [
            (stamp, topic, maker.image(stamp, image, images))
            for stamp, image in zip(made.image_stamps_ns.tolist(), made.images, strict=True)
        ]
    for topic in truth_topics if truth else ():
        rows += [
            (stamp, topic, maker.pose(stamp, T, truth or ""))
            for stamp, T in zip(made.truth.stamps_ns.tolist(), made.truth.T_world_imu, strict=True)
        ]
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = (
        Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
    )
    if compression and kind == "ros1":
        writer.set_compression(Writer1.CompressionFormat[compression[0]])
    elif compression:
        mode, name = compression
        writer.set_compression(CompressionMode[mode], CompressionFormat[name])
    with writer:
        connections: dict[str, Any] = {}
        late = ((stamp + recorded_late_ns(stamp), *rest) for stamp, *rest in rows)
        for stamp, topic, message in sorted(late, key=lambda row: row[0]):
            name = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            encode = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connections[topic], stamp, encode(message, name))
    return path


class _Messages:
    def __init__(self, store: Any, ros1: bool) -> None:
        self.types = store.types
        self.ros1 = ros1

    def make(self, name: str, *values: Any) -> Any:
        return self.types[name](*values)

    def header(self, stamp_ns: int) -> Any:
        time = self.make("builtin_interfaces/msg/Time", *divmod(stamp_ns, NANOSECONDS))
        counter = (7,) if self.ros1 else ()
        return self.make("std_msgs/msg/Header", *counter, time, "sensor")

    def imu(self, stamp: int, gyro: FloatArray, accel: FloatArray) -> Any:
        rate, force = (self.make("geometry_msgs/msg/Vector3", *v.tolist()) for v in (gyro, accel))
        turn = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        nine = np.zeros(9)
        return self.make(
            "sensor_msgs/msg/Imu", self.header(stamp), turn, nine, rate, nine, force, nine
        )

    def image(self, stamp: int, image: Image, encoding: str) -> Any:
        if "png" in encoding or "jpeg" in encoding:
            data = np.frombuffer(b"no picture", np.uint8)
            if image.size:
                _, data = cv2.imencode(".png" if "png" in encoding else ".jpeg", image)
            name = "sensor_msgs/msg/CompressedImage"
            return self.make(name, self.header(stamp), encoding, data.ravel())
        data, pixel = encoded(image, encoding)
        step = WIDTH * pixel + 4  # rows may be padded
        padded = np.zeros((HEIGHT, step), np.uint8)
        padded[:, : WIDTH * pixel] = data
        return self.make(
            "sensor_msgs/msg/Image", self.header(stamp), HEIGHT, WIDTH, encoding, 0, step,
            padded.ravel(),
        )  # fmt: skip

    def pose(self, stamp: int, T: FloatArray, name: str) -> Any:
        x, y, z = T[:3, 3].tolist()
        q = so3.to_quaternion(T[None, :3, :3])[0].tolist()
        turn = self.make("geometry_msgs/msg/Quaternion", *q)
        header = self.header(stamp)
        if name.endswith("TransformStamped"):
            place = self.make("geometry_msgs/msg/Vector3", x, y, z)
            return self.make(
                name, header, "imu", self.make("geometry_msgs/msg/Transform", place, turn)
            )
        pose = self.make(
            "geometry_msgs/msg/Pose", self.make("geometry_msgs/msg/Point", x, y, z), turn
        )
        if name.endswith("PoseStamped"):
            return self.make(name, header, pose)
        covered = self.make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))
        if name.endswith("PoseWithCovarianceStamped"):
            return self.make(name, header, covered)
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        moving = self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        return self.make(name, header, "imu", covered, moving)


def encoded(image: Image, encoding: str) -> tuple[Image, int]:
    """Rows of bytes of a grey image in a ROS encoding, and bytes a pixel."""
    if encoding == "mono16":
        low = np.full_like(image, 0x5A)
        return np.stack([low, image], axis=-1).reshape(HEIGHT, -1), 2
    if encoding in ("rgb8", "bgr8"):
        return np.repeat(image, 3, axis=1), 3
    if encoding == "bgra8":
        return np.repeat(image, 4, axis=1), 4
    return image, 1
