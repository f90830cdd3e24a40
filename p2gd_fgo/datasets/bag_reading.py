"""The rosbags library behind one door: bags of ROS 1 and ROS 2, MCAP, and their faults.

A bag comes from anywhere, and its parser meets malformed bytes with many kinds of exception
(assertions, struct errors, those of the decompressors and of SQLite): all of them become a
:class:`DataError` here.
"""

from __future__ import annotations

import struct
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from p2gd_fgo.datasets.csv_tables import MAX_STAMP
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS

SUFFIXES = (".bag", ".db3", ".mcap")
_ROS2_METADATA = "metadata.yaml"
_MAX_METADATA_BYTES = 2_000_000
_CDR_BIG_ENDIAN = 0


def bag_files(path: Path) -> list[Path]:
    """What to open of a file or folder: a bag, a ROS 2 folder, or a recording in parts.

    Empty where there is none, or storage of several kinds.
    """
    if path.is_file():
        return [path] if path.suffix in SUFFIXES else []
    if (path / _ROS2_METADATA).is_file() and path.suffix != ".bag":
        return [path]  # one that is named *.bag would be taken for ROS 1's
    found = sorted(file for file in path.glob("*") if file.suffix in SUFFIXES)
    return found if len({file.suffix for file in found}) == 1 else []


class Bag:
    """An open bag; closed when it is no longer used.

    Parameters
    ----------
    path
        File or folder, as :func:`bag_files` takes it.

    Raises
    ------
    DataError
        No bag, or one that can't be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        files = bag_files(path)
        if not files:
            raise DataError(f"{path}: no bag in it ({', '.join(SUFFIXES)}, or {_ROS2_METADATA})")
        ros1 = files[0].suffix == ".bag"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
        metadata = files[0] / _ROS2_METADATA
        if metadata.is_file() and metadata.stat().st_size > _MAX_METADATA_BYTES:
            raise DataError(f"{metadata}: longer than {_MAX_METADATA_BYTES} bytes")
        with self.faults("the bag"):
            self._reader = AnyReader(files, default_typestore=store)
            self._reader.open()
            for c in self._reader.connections:  # as metadata.yaml says, not checked by the library
                if not all(isinstance(text, str) for text in (c.topic, c.msgtype)):
                    raise TypeError(f"a topic is named {c.topic!r} of type {c.msgtype!r}")
                if type(c.msgcount) is not int:
                    raise TypeError(f"{c.topic} has {c.msgcount!r} messages")
        weakref.finalize(self, self._reader.close)

    @property
    def connections(self) -> list[Connection]:
        """All that was recorded: topics with their message types and counts."""
        return self._reader.connections

    def raw(
        self, connections: list[Connection], start_ns: int | None = None
    ) -> Iterator[tuple[int, bytes, str]]:
        """Messages in the order of recording: its time in ns, bytes, and message type.

        Raises
        ------
        DataError
            The bag is damaged, or has none although it says so.
        """
        found = False
        with self.faults(connections[0].topic):
            for connection, stamp, data in self._reader.messages(connections, start=start_ns):
                found = True
                yield stamp, data, connection.msgtype
            if not found:
                raise ValueError("its index promises messages that are not there")

    def message(self, data: bytes, kind: str, topic: str) -> Any:
        """The message that the bytes stand for.

        Raises
        ------
        DataError
            They don't.
        """
        with self.faults(topic):
            return self._reader.deserialize(data, kind)

    def header_stamp_ns(self, data: bytes, topic: str) -> int:
        """Time in the header that the message begins with, without reading the rest.

        Both ROS 1 (after a counter) and ROS 2 (after CDR's four bytes) put seconds and
        nanoseconds at bytes 4 and 8.

        Raises
        ------
        DataError
            Too few bytes, or no time.
        """
        order = ">" if self._reader.is2 and data[1:2] == bytes([_CDR_BIG_ENDIAN]) else "<"
        try:
            seconds, rest = struct.unpack_from(f"{order}iI", data, 4)
        except struct.error:
            raise DataError(f"{self.path}: {topic}: a message of {len(data)} bytes only") from None
        stamp = int(seconds) * NANOSECONDS + int(rest)
        if abs(stamp) > MAX_STAMP:
            raise DataError(f"{self.path}: {topic}: the stamp {seconds} s, {rest} ns is no time")
        return stamp

    @contextmanager
    def faults(self, what: str) -> Iterator[None]:
        """Turn whatever the parser raises into one sentence."""
        try:
            yield
        except (DataError, GeneratorExit):
            raise
        except FileNotFoundError as error:
            raise DataError(f"{self.path}: {error}") from None
        except Exception as error:
            reason = " ".join(str(error).split())[:300] or type(error).__name__
            raise DataError(
                f"{self.path}: {what} can't be read, the file is damaged or incomplete ({reason}); "
                "a bag that was not closed can be repaired with 'rosbag reindex' or 'ros2 bag "
                "reindex'"
            ) from None
