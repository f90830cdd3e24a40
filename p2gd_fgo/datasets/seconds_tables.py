"""Tables with a time in seconds in front, separated by blanks or commas, as TUM's data sets'.

Times go through decimal arithmetic: a float64 of seconds since 1970 resolves only 0.2 µs.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.csv_tables import MAX_STAMP, Table, check_file_name
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS, IntArray


def read_seconds_table(path: Path, width: int) -> Table:
    """Read times and numbers of rows with ``width`` columns, the time included.

    Raises
    ------
    DataError
        The file is missing, unreadable, without rows, or a row is malformed.
    """
    rows = _rows(path)
    values = []
    for line, words in rows:
        where = f"{path}, line {line}"
        if len(words) != width:
            raise DataError(f"{where}: {len(words)} columns found, {width} needed")
        try:
            values.append([float(word) for word in words[1:]])
        except ValueError as error:
            raise DataError(f"{where}: {error}") from None
    stamps = [seconds_to_ns(words[0], f"{path}, line {line}") for line, words in rows]
    lines = [line for line, _ in rows]
    return Table(path, np.array(lines, np.int64), np.array(stamps, np.int64), np.array(values))


def read_seconds_list(path: Path) -> tuple[IntArray, list[str]]:
    """Stamps (N,) in ns and file names (N,), in the file's order.

    Raises
    ------
    DataError
        As :func:`read_seconds_table`.
    """
    stamps, names = [], []
    for line, words in _rows(path):
        if len(words) != 2:
            raise DataError(
                f"{path}, line {line}: a time in seconds and a file name expected, but "
                f"{len(words)} columns found"
            )
        check_file_name(words[1], f"{path}, line {line}")
        stamps.append(seconds_to_ns(words[0], f"{path}, line {line}"))
        names.append(words[1])
    return np.array(stamps, np.int64), names


def seconds_to_ns(text: str, where: str) -> int:
    """Nanoseconds of a decimal number of seconds.

    Raises
    ------
    DataError
        No number, or so large that it must be nanoseconds.
    """
    try:
        seconds = Decimal(text)
        if not abs(seconds) * NANOSECONDS <= MAX_STAMP:
            raise DataError(
                f"{where}: the time {text[:60]} is no number of seconds (nanoseconds are not "
                "taken here)"
            )
    except ArithmeticError:
        raise DataError(f"{where}: {text[:60]!r} is no time in seconds") from None
    return int((seconds * NANOSECONDS).to_integral_value())


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not readable as text: {error}") from None
    rows = [
        (number, line.replace(",", " ").split())
        for number, line in enumerate(text.splitlines(), start=1)
        if not line.lstrip().startswith("#")
    ]
    rows = [(number, words) for number, words in rows if words]
    if not rows:
        raise DataError(f"{path}: {'no data rows' if text.strip() else 'the file is empty'}")
    return rows
