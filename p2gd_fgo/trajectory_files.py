"""Trajectory files: TUM (read and write); poses of a EuRoC or KAIST csv (read).

Stamps go through decimal arithmetic in both directions: a float64 of seconds since 1970 resolves
only 0.2 µs, and an image is found by its nanoseconds.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from p2gd_fgo.atomic_files import write_text
from p2gd_fgo.datasets.csv_tables import Table, read_table
from p2gd_fgo.datasets.poses import poses_from_matrices
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import NANOSECONDS, Trajectory

_COLUMNS = 8
_MATRIX_COLUMNS = 13
_ZERO_QUATERNION = 1e-6


def format_tum(trajectory: Trajectory) -> str:
    """Text of a TUM file: ``seconds x y z qx qy qz qw`` a line, the nanoseconds kept exactly."""
    p = trajectory.T_world_imu[:, :3, 3]
    q = so3.to_quaternion(trajectory.T_world_imu[:, :3, :3])
    values = np.concatenate([p, q], axis=1).tolist()
    return "".join(
        f"{_seconds(stamp)} {' '.join(f'{v:.9g}' for v in row)}\n"
        for stamp, row in zip(trajectory.stamps_ns.tolist(), values, strict=True)
    )


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write a TUM file, whole or not at all; the same trajectory gives the same bytes."""
    write_text(path, format_tum(trajectory))


def read_tum(path: Path) -> Trajectory:
    """Read a TUM file: seconds, position, quaternion with w last; ``#`` starts a comment line.

    Raises
    ------
    DataError
        The file is missing or empty, or a row (named by its line) is malformed, holds NaN or a
        zero quaternion, or doesn't come later than the row before it.
    """
    return _trajectory(_tum_table(path, _text(path)), w_first=False)


def read_trajectory(path: Path) -> Trajectory:
    """Read a trajectory: TUM, or with commas between its columns EuRoC csv or KAIST global_pose.

    EuRoC's rows are nanoseconds, position, quaternion with w first; columns behind these are not
    read. KAIST's are nanoseconds and the twelve numbers of a 3x4 matrix.

    Raises
    ------
    DataError
        As :func:`read_tum`.
    """
    text = _text(path)
    first = next((line for line in text.splitlines() if _is_row(line)), "")
    if first.count(",") + 1 == _MATRIX_COLUMNS:
        table = read_table(path, (_MATRIX_COLUMNS,))
        T = poses_from_matrices(table)
        _check_order(table)
        # UTM coordinates would lose millimetres in the nine digits of a TUM file.
        T[:, :3, 3] -= T[0, :3, 3]
        return Trajectory(table.stamps_ns, T)
    if "," in first:
        return _trajectory(read_table(path, (_COLUMNS,)), w_first=True)
    return _trajectory(_tum_table(path, text), w_first=False)


def _seconds(stamp_ns: int) -> str:
    whole, rest = divmod(abs(stamp_ns), NANOSECONDS)
    return f"{'-' if stamp_ns < 0 else ''}{whole}.{rest:09d}"


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DataError(f"{path}: no such trajectory file") from None
    except IsADirectoryError:
        raise DataError(f"{path}: a folder, where a TUM or csv trajectory file is needed") from None
    except UnicodeDecodeError:
        raise DataError(f"{path}: not a text file; give a TUM or EuRoC csv trajectory") from None
    except OSError as error:
        raise DataError(f"{path}: can't be read: {error.strerror}") from None


def _is_row(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _tum_table(path: Path, text: str) -> Table:
    lines, stamps, values = [], [], []
    for number, line in enumerate(text.splitlines(), start=1):
        if _is_row(line):
            stamp, *row = _tum_row(line, f"{path}, line {number}")
            lines.append(number)
            stamps.append(stamp)
            values.append(row)
    if not lines:
        raise DataError(f"{path}: no poses in it; a TUM trajectory has one a line")
    return Table(
        path, np.array(lines, dtype=np.int64), np.array(stamps, dtype=np.int64), np.array(values)
    )


def _tum_row(line: str, where: str) -> tuple[int, *tuple[float, ...]]:
    fields = line.split()
    if len(fields) != _COLUMNS:
        raise DataError(
            f"{where}: {len(fields)} columns found, but a TUM row has {_COLUMNS}, separated by "
            "blanks"
        )
    try:
        stamp = int((Decimal(fields[0]) * NANOSECONDS).to_integral_value())
    except (ArithmeticError, ValueError):
        raise DataError(f"{where}: the stamp '{fields[0]}' is no time in seconds") from None
    if abs(stamp) > np.iinfo(np.int64).max:
        raise DataError(
            f"{where}: the stamp {fields[0]} is too large; TUM files count seconds, not nanoseconds"
        )
    try:
        return stamp, *map(float, fields[1:])
    except ValueError as error:
        raise DataError(f"{where}: {error}") from None


def _trajectory(table: Table, *, w_first: bool) -> Trajectory:
    bad = ~np.isfinite(table.values).all(axis=1)
    if bad.any():
        raise DataError(f"{table.where(int(np.argmax(bad)))}: a value is NaN or infinite")
    zero = np.linalg.norm(table.values[:, 3:], axis=1) < _ZERO_QUATERNION
    if zero.any():
        raise DataError(
            f"{table.where(int(np.argmax(zero)))}: the quaternion is zero, an orientation is needed"
        )
    _check_order(table)
    R = so3.from_quaternion(table.values[:, 3:7], w_first=w_first)
    return Trajectory(table.stamps_ns, from_rotation_translation(R, table.values[:, :3]))


def _check_order(table: Table) -> None:
    late = np.diff(table.stamps_ns) <= 0
    if late.any():
        row = int(np.argmax(late)) + 1
        raise DataError(
            f"{table.where(row)}: the stamp {table.stamps_ns[row]} ns doesn't come after "
            f"{table.stamps_ns[row - 1]} ns; sort the rows and drop duplicates"
        )
