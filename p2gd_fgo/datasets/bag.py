"""Bags of ROS 1 and ROS 2 (SQLite, MCAP): images, IMU, and odometry or poses as truth."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Connection

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.bag_images import BagImages
from p2gd_fgo.datasets.bag_reading import Bag
from p2gd_fgo.datasets.bag_topics import find_topic
from p2gd_fgo.datasets.base import Calibration, EncodedImage
from p2gd_fgo.datasets.calibration_files import named_calibration, with_offset
from p2gd_fgo.datasets.csv_tables import Table
from p2gd_fgo.datasets.images import check_size
from p2gd_fgo.datasets.imu_samples import imu_from_table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.datasets.masks import MaskFolder, configured_masks
from p2gd_fgo.datasets.part import choose_part
from p2gd_fgo.datasets.poses import ordered_trajectory, poses_from_quaternions, truth_frame
from p2gd_fgo.errors import DataError, ImageError
from p2gd_fgo.types import Event, Image, ImuBatch, IntArray, Trajectory, Truth


@dataclass(frozen=True, slots=True, eq=False)
class BagSequence:
    """A recording in a bag; see :class:`p2gd_fgo.datasets.base.Sequence`.

    Attributes
    ----------
    images
        All images of the topic.
    numbers
        (N,) which of them are those of ``image_stamps_ns``.
    """

    name: str
    calibration: Calibration
    image_stamps_ns: IntArray
    images: BagImages
    numbers: IntArray
    imu: ImuBatch
    truth: Truth | None
    events: tuple[Event, ...]
    masks: MaskFolder | None = None

    def image(self, index: int) -> Image:
        """Decode image ``index`` as (H, W) grey, 16-bit values by their upper 8 bits.

        Raises
        ------
        DataError
            The bag is damaged, the image can't be decoded or is of another size than the
            calibration's.
        """
        number = int(self.numbers[index])
        image = self.images.decode(number)
        check_size(image, self.calibration.camera, f"{self.images.topic}, image {number}")
        return image

    def mask(self, index: int) -> Image | None:
        """Decode the mask ``<stamp>.png`` of image ``index`` as (H, W), or None.

        Raises
        ------
        DataError
            The file can't be decoded or is of another size than the calibration's.
        """
        name = _image_name(int(self.image_stamps_ns[index]))
        return None if self.masks is None else self.masks.mask(name)

    def encoded_image(self, index: int) -> EncodedImage | None:
        """Image ``index`` as the PNG or JPEG that it was recorded as, or None.

        Raises
        ------
        DataError
            The bag is damaged.
        """
        return self.images.encoded(int(self.numbers[index]))


def open_bag(path: Path, config: DatasetConfig, max_gap_s: float) -> BagSequence:
    """Read everything but the images, of which only the stamps are kept.

    Stamps are the headers', not the times of recording. A topic that isn't named is the only one
    of its kind; a truth chosen so is told by an event.

    Raises
    ------
    DataError
        A bag that can't be read, topics missing or ambiguous, no calibration, values that aren't
        finite, sensors that don't overlap in time, or a first image of another size.
    """
    if config.calibration is None:
        raise DataError(
            f"{path}: a bag holds no calibration of camera and IMU: name a Kalibr or OpenVINS "
            "camera chain, or an ASL sensor.yaml, by dataset.calibration"
        )
    calibration = with_offset(named_calibration(config), config.time_offset_s)
    bag = Bag(path)
    camera = find_topic(bag, "image_topic", config.image_topic)
    inertial = find_topic(bag, "imu_topic", config.imu_topic)
    reference = find_topic(bag, "truth_topic", config.truth_topic)
    imu, imu_events = imu_from_table(_table(bag, inertial, _imu_values), 0, 3)
    truth, truth_events = _truth(bag, reference, config)
    images = BagImages(bag, camera)
    order, image_events = increasing_order(images.stamps_ns, "image")
    stamps = images.stamps_ns[order]
    part = choose_part(stamps, imu, truth, calibration.time_offset_s, config, max_gap_s)
    chosen = stamps[part.chosen]
    sequence = BagSequence(
        name=path.resolve().stem,
        calibration=calibration,
        image_stamps_ns=chosen,
        images=images,
        numbers=order[part.chosen],
        masks=configured_masks(
            config, [_image_name(s) for s in chosen.tolist()], calibration.camera
        ),
        imu=part.imu,
        truth=part.truth,
        events=(*image_events, *imu_events, *truth_events, *part.events),
    )
    with suppress(ImageError):  # one bad image is survived; it is said when it is asked for
        sequence.image(0)
    return sequence


def read_bag_trajectory(path: Path, config: DatasetConfig) -> Trajectory:
    """Poses of ``dataset.truth_topic`` alone, such as a planner's; no calibration is needed.

    Raises
    ------
    DataError
        A bag that can't be read, no such topic, or poses that can't be used.
    """
    bag = Bag(path)
    truth, _ = _truth(bag, find_topic(bag, "truth_topic", config.truth_topic), config)
    if truth is None:
        raise DataError(f"{path}: no topic holds odometry or poses")
    return truth.trajectory


def _image_name(stamp_ns: int) -> Path:
    return Path(f"{stamp_ns}.png")


def _truth(
    bag: Bag, connections: list[Connection], config: DatasetConfig
) -> tuple[Truth | None, list[Event]]:
    if not connections:
        return None, []
    table = _table(bag, connections, _pose_values)
    poses = poses_from_quaternions(table, w_first=False)
    trajectory, _, events = ordered_trajectory(table.stamps_ns, poses, truth_frame(config))
    if config.truth_topic is None:
        topic = connections[0].topic
        message = (
            f"{topic} is taken as the truth, as the only topic with poses; dataset.truth_topic "
            "names another or 'none'"
        )
        events.append(
            Event(int(trajectory.stamps_ns[0]), "truth_topic_guessed", message, {"topic": topic})
        )
    return Truth(trajectory), events


def _table(bag: Bag, connections: list[Connection], values: Any) -> Table:
    topic = connections[0].topic
    stamps, rows = [], []
    for _, data, kind in bag.raw(connections):
        message = bag.message(data, kind, topic)
        with bag.faults(topic):
            rows.append(values(message))
        stamps.append(bag.header_stamp_ns(data, topic))
    return Table(
        bag.path / topic.lstrip("/"),
        np.arange(1, len(rows) + 1),
        np.array(stamps, dtype=np.int64),
        np.array(rows),
    )


def _imu_values(message: Any) -> list[float]:
    rate, force = message.angular_velocity, message.linear_acceleration
    return [rate.x, rate.y, rate.z, force.x, force.y, force.z]


def _pose_values(message: Any) -> list[float]:
    """Position and quaternion, w last, of a message of one of the four kinds."""
    inner = getattr(message, "pose", None) or message.transform
    inner = getattr(inner, "pose", inner)  # those with covariance hold it one deeper
    p = getattr(inner, "position", None) or inner.translation
    q = getattr(inner, "orientation", None) or inner.rotation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
