"""Times of day as KITTI writes them, ``2011-09-26 13:02:25.964389445``, one a line."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS, IntArray

_TIME = re.compile(r"(\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d)(?:\.(\d{1,9}))?")


def read_clock_times(path: Path) -> tuple[IntArray, list[int]]:
    """Stamps (N,) in ns since 1970, as if in UTC, and the row of each (N,), from 0.

    An empty line counts as a row without a stamp.

    Raises
    ------
    DataError
        The file is missing, unreadable, without times, or a line is no time.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not readable as text: {error}") from None
    stamps, rows = [], []
    for row, line in enumerate(lines):
        if line.strip():
            stamps.append(_stamp(line.strip(), f"{path}, line {row + 1}"))
            rows.append(row)
    if not rows:
        raise DataError(f"{path}: no times in it")
    return np.array(stamps, dtype=np.int64), rows


def _stamp(text: str, where: str) -> int:
    found = _TIME.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        *whole, fraction = found.groups()
        moment = datetime(*(int(part) for part in whole), tzinfo=UTC)  # type: ignore[misc, arg-type]
        if not 1970 <= moment.year < 2100:
            raise ValueError
    except ValueError:
        raise DataError(
            f"{where}: {text[:60]!r} is no time such as 2011-09-26 13:02:25.964389445"
        ) from None
    return int(moment.timestamp()) * NANOSECONDS + int((fraction or "0").ljust(9, "0"))
