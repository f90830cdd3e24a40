"""Comma-separated tables with an int64 stamp in front, as ASL folders hold them.

Stamps are never read as floating-point numbers: 19 digits don't fit. Blank lines, ``#`` comments,
a header without ``#``, trailing commas, Windows line ends and a byte-order mark are accepted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import FloatArray, IntArray

_INT64 = np.iinfo(np.int64)
_MAX_NAME = 255  # bytes
MAX_STAMP = 1 << 62
"""Largest size of a stamp, ns: the difference of two must fit into 64 bits, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The rows of a file in its order.

    Attributes
    ----------
    path
        The file.
    lines
        (N,) line numbers, from 1.
    stamps_ns
        (N,) the first column.
    values
        (N, C) the columns behind it.
    """

    path: Path
    lines: IntArray
    stamps_ns: IntArray
    values: FloatArray

    def where(self, row: int) -> str:
        """Name the file and line of a row, for messages."""
        return f"{self.path}, line {self.lines[row]}"


def read_table(path: Path, widths: tuple[int, ...]) -> Table:
    """Read stamps and numbers.

    ``widths`` are the numbers of columns that the file may have, stamp included, in ascending
    order: the first row decides, columns beyond the widest that fits are left out.

    Raises
    ------
    DataError
        The file is missing, unreadable, without data rows, or a row is malformed.
    """
    rows, lines = _read_rows(path)
    found = rows[0].count(",") + 1
    fitting = [width for width in widths if width <= found]
    if not fitting:
        raise DataError(
            f"{path}, line {lines[0]}: {found} columns found, at least {widths[0]} needed"
        )
    width = fitting[-1]
    try:
        stamps = np.array([int(row.partition(",")[0]) for row in rows], dtype=np.int64)
        values = np.loadtxt(
            rows, delimiter=",", usecols=range(1, width), ndmin=2, comments=None, dtype=np.float64
        )
    except (ValueError, OverflowError) as error:
        for row, line in zip(rows, lines, strict=True):
            _check_row(row, width, f"{path}, line {line}")
        raise DataError(f"{path}: not readable as numbers: {error}") from None
    far = (stamps > MAX_STAMP) | (stamps < -MAX_STAMP)
    if far.any():
        worst = int(np.argmax(far))
        whole_stamp(str(stamps[worst]), f"{path}, line {lines[worst]}")
    return Table(path, np.array(lines, dtype=np.int64), stamps, values)


def read_image_list(path: Path) -> tuple[IntArray, list[str]]:
    """Stamps (N,) and file names (N,) of a camera's ``data.csv``.

    Raises
    ------
    DataError
        As :func:`read_table`; also where the stamps don't increase.
    """
    rows, lines = _read_rows(path)
    stamps: list[int] = []
    names: list[str] = []
    for row, line in zip(rows, lines, strict=True):
        stamp, _, name = (field.strip() for field in row.partition(","))
        where = f"{path}, line {line}"
        if not name:
            raise DataError(f"{where}: a stamp in ns and a file name expected, but found {row!r}")
        check_file_name(name, where)
        value = whole_stamp(stamp, where)
        if stamps and value <= stamps[-1]:
            raise DataError(
                f"{where}: image stamp {value} doesn't come after {stamps[-1]}: "
                "image stamps must increase"
            )
        stamps.append(value)
        names.append(name)
    return np.array(stamps, dtype=np.int64), names


def check_file_name(name: str, where: str) -> None:
    """Refuse what no file system takes for a name.

    Raises
    ------
    DataError
        Too long, or with characters that aren't printable.
    """
    if not name.isprintable() or max(len(part.encode()) for part in name.split("/")) > _MAX_NAME:
        raise DataError(f"{where}: {name[:60]!r} is no file name")


def read_stamps(path: Path) -> IntArray:
    """Stamps (N,) of a file with one in front of every line, in its order.

    Raises
    ------
    DataError
        As :func:`read_table`.
    """
    rows, lines = _read_rows(path)
    return np.array(
        [
            whole_stamp(row.partition(",")[0].strip(), f"{path}, line {line}")
            for row, line in zip(rows, lines, strict=True)
        ],
        dtype=np.int64,
    )


def _read_rows(path: Path) -> tuple[list[str], list[int]]:
    """Read the data rows, trailing commas cut off, and their line numbers; at least one."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not readable as text: {error}") from None
    rows: list[str] = []
    lines: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        row = line.strip().rstrip(", \t")
        if row and not row.startswith("#") and (rows or not _is_header(row)):
            rows.append(row)
            lines.append(number)
    if not rows:
        raise DataError(f"{path}: {'no data rows' if text.strip() else 'the file is empty'}")
    return rows, lines


def _is_header(row: str) -> bool:
    first = row.partition(",")[0].strip()
    return any(c.isalpha() for c in first) and not _is_number(first)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def whole_stamp(text: str, where: str) -> int:
    """A stamp in whole nanoseconds.

    Raises
    ------
    DataError
        No whole number, or one that can't be nanoseconds since 1970.
    """
    try:
        value = int(text)
    except ValueError:
        raise DataError(f"{where}: stamp {text!r} is not a whole number of nanoseconds") from None
    if not _INT64.min <= value <= _INT64.max:
        raise DataError(f"{where}: stamp {value} doesn't fit into 64 bits of nanoseconds")
    if abs(value) > MAX_STAMP:
        raise DataError(
            f"{where}: stamp {value} lies more than 146 years from 1970, stamps are nanoseconds"
        )
    return value


def _check_row(row: str, width: int, where: str) -> None:
    fields = [field.strip() for field in row.split(",")]
    whole_stamp(fields[0], where)
    if len(fields) < width:
        raise DataError(f"{where}: {len(fields)} columns found, {width} needed")
    for column, field in enumerate(fields[1:width], start=2):
        if not _is_number(field):
            raise DataError(f"{where}: column {column} holds {field!r}, not a number")
