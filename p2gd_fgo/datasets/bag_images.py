"""Images of a bag: indexed once, read one at a time, never held."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from rosbags.interfaces import Connection

from p2gd_fgo.datasets.bag_reading import Bag
from p2gd_fgo.datasets.base import EncodedImage
from p2gd_fgo.datasets.images import decode_grey_bytes
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Image, IntArray

_CHANNELS = {
    **dict.fromkeys(("mono8", "8UC1"), (1, None)),
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    **dict.fromkeys(("bgr8", "8UC3"), (3, cv2.COLOR_BGR2GRAY)),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
    **dict.fromkeys(("bgra8", "8UC4"), (4, cv2.COLOR_BGRA2GRAY)),
    "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2GRAY),
    "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2GRAY),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2GRAY),
    "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2GRAY),
}
_WIDE = ("mono16", "16UC1")
_BAYER_FORMAT = re.compile(r"\s*(bayer_\w+)\s*;\s*\w*\s*compressed\s*(?:bayer_\w+)?\s*$")
_SUFFIXES = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg"}
_MAX_SIDE = 1 << 16


class BagImages:
    """The messages of an image topic, by number in the order of recording.

    A message is found again by the time of its recording; reading forwards goes on from where the
    last one was.

    Parameters
    ----------
    connections
        Of one topic, as :func:`p2gd_fgo.datasets.bag_topics.find_topic` gives them.

    Attributes
    ----------
    stamps_ns
        (N,) of the headers.
    """

    def __init__(self, bag: Bag, connections: list[Connection]) -> None:
        self._bag = bag
        self._connections = connections
        self.topic = connections[0].topic
        recorded, stamps = [], []
        for time, data, _ in bag.raw(connections):
            recorded.append(time)
            stamps.append(bag.header_stamp_ns(data, self.topic))
        self.stamps_ns: IntArray = np.array(stamps, dtype=np.int64)
        self._recorded = recorded
        self._cursor: Iterator[tuple[int, bytes, str]] = iter(())
        self._next = -1

    def decode(self, number: int) -> Image:
        """Image ``number`` as (H, W) grey; of 16-bit values the upper 8 bits.

        Raises
        ------
        DataError
            The bag is damaged, or the image is of an encoding that isn't known.
        """
        message, where = self._message(number), self._where(number)
        if message.__msgtype__.endswith("CompressedImage"):
            _check_format(message.format, where)
            image = decode_grey_bytes(message.data.tobytes(), where)
            mosaic = _mosaic(message.format, where)
            return image if mosaic is None else _converted(image, _CHANNELS[mosaic][1], where)
        return decode_message(message, where)

    def encoded(self, number: int) -> EncodedImage | None:
        """Image ``number`` as the PNG or JPEG that it was recorded as, or None.

        None, too, where that is the raw mosaic of a colour sensor, which isn't a picture.

        Raises
        ------
        DataError
            The bag is damaged.
        """
        message = self._message(number)
        if not message.__msgtype__.endswith("CompressedImage"):
            return None
        if _mosaic(message.format, self._where(number)) is not None:
            return None
        data = message.data.tobytes()
        suffix = next((s for head, s in _SUFFIXES.items() if data.startswith(head)), None)
        return None if suffix is None else EncodedImage(data, suffix)

    def _where(self, number: int) -> str:
        return f"{self._bag.path}: {self.topic}, image {number}"

    def _message(self, number: int) -> Any:
        if number != self._next:
            first = self._recorded.index(self._recorded[number], 0, number + 1)
            self._cursor = self._bag.raw(self._connections, self._recorded[number])
            for _ in range(number - first):  # recorded in the same nanosecond
                next(self._cursor, None)
        found = next(self._cursor, None)
        self._next = number + 1
        if found is None:
            self._next = -1
            raise DataError(f"{self._where(number)}: no longer there")
        return self._bag.message(found[1], found[2], self.topic)


def decode_message(message: Any, where: str) -> Image:
    """Grey values (H, W) of a ``sensor_msgs/Image``; of 16-bit values the upper 8 bits.

    Raises
    ------
    DataError
        An encoding that isn't known; a size that doesn't fit the data.
    """
    wide = message.encoding in _WIDE
    if not wide and message.encoding not in _CHANNELS:
        raise DataError(
            f"{where}: the encoding is {message.encoding[:40]!r}, known are "
            f"{', '.join((*_CHANNELS, *_WIDE))}"
        )
    channels, conversion = (2, None) if wide else _CHANNELS[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, dtype=np.uint8)
    fits = 0 < width < _MAX_SIDE and 0 < height < _MAX_SIDE and step >= width * channels
    if not fits or len(data) < height * step:
        raise DataError(
            f"{where}: {len(data)} bytes don't make an image of {width}x{height} px "
            f"{message.encoding} with rows of {step} bytes"
        )
    rows = data[: height * step].reshape(height, step)[:, : width * channels]
    if wide:
        return np.ascontiguousarray(rows[:, 0 if message.is_bigendian else 1 :: 2])
    if conversion is None:
        return np.ascontiguousarray(rows)
    pixels = rows.reshape(height, width, channels) if channels > 1 else rows
    return _converted(np.ascontiguousarray(pixels), conversion, f"{where}, {message.encoding}")


def _converted(pixels: Image, conversion: int | None, where: str) -> Image:
    try:
        return np.asarray(cv2.cvtColor(pixels, conversion or 0), dtype=np.uint8)
    except cv2.error:
        height, width = pixels.shape[:2]
        raise DataError(f"{where}: {width}x{height} px can't be converted to grey") from None


def _mosaic(text: str, where: str) -> str | None:
    """The encoding of a compressed Bayer mosaic, which image_transport packs as it is.

    The format is ``bayer_rggb8; png compressed``; a colour behind ``compressed`` says that the
    publisher converted it before.

    Raises
    ------
    DataError
        A mosaic of a kind that isn't known.
    """
    found = _BAYER_FORMAT.match(text)
    if found is None:
        return None
    if found[1] not in _CHANNELS:
        raise DataError(f"{where}: the format is {text[:60]!r}, known are 8-bit Bayer mosaics")
    return found[1]


def _check_format(text: str, where: str) -> None:
    if re.search("compressedDepth", text):
        raise DataError(
            f"{where}: the format is {text[:60]!r}, a depth image: take the camera's topic"
        )
