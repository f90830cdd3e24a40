"""Which topics of a bag are the camera, the IMU and the truth."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from rosbags.interfaces import Connection

from p2gd_fgo.datasets.bag_reading import Bag
from p2gd_fgo.errors import DataError

Role = Literal["image_topic", "imu_topic", "truth_topic"]
NO_TRUTH = "none"

TYPES: dict[Role, tuple[str, ...]] = {
    "image_topic": ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"),
    "imu_topic": ("sensor_msgs/msg/Imu",),
    "truth_topic": (
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "geometry_msgs/msg/TransformStamped",
    ),
}
_MEANING: dict[Role, str] = {
    "image_topic": "images",
    "imu_topic": "IMU samples",
    "truth_topic": "odometry or poses",
}


def find_topic(bag: Bag, role: Role, wanted: str | None) -> list[Connection]:
    """Connections of the topic for a role; empty only for ``truth_topic``.

    Parameters
    ----------
    wanted
        Its name, or None: the only one with messages of a fitting type.

    Raises
    ------
    DataError
        No such topic or one of another type; none or several that would fit.
    """
    if role == "truth_topic" and wanted == NO_TRUTH:
        return []
    filled = [c for c in bag.connections if c.msgcount > 0]
    fitting = [c for c in filled if c.msgtype in TYPES[role]]
    if wanted is not None:
        chosen = [c for c in fitting if c.topic == wanted]
        if not chosen:
            others = [c for c in filled if c.topic == wanted]
            said = f"holds {others[0].msgtype}" if others else "is not in the bag or empty"
            raise DataError(
                f"{bag.path}: dataset.{role} is {wanted!r}, which {said}; with "
                f"{_MEANING[role]} there are: {_names(fitting) or 'none'}"
            )
        return chosen
    topics = {c.topic for c in fitting}
    if len(topics) > 1:
        rest = f", or '{NO_TRUTH}'" if role == "truth_topic" else ""
        raise DataError(
            f"{bag.path}: {len(topics)} topics hold {_MEANING[role]} ({_names(fitting)}): name "
            f"one by dataset.{role}{rest}"
        )
    if not topics and role != "truth_topic":
        raise DataError(
            f"{bag.path}: no topic holds {_MEANING[role]} ({' or '.join(TYPES[role])}); the bag "
            f"has {_names(filled) or 'no messages'}"
        )
    return fitting


def _names(connections: Iterable[Connection]) -> str:
    names = sorted({c.topic for c in connections})
    return ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
