"""IMU samples of any format, in order and whole."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.datasets.csv_tables import Table
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Event, ImuBatch


def imu_from_table(table: Table, gyro: int, accel: int) -> tuple[ImuBatch, list[Event]]:
    """Sort samples and drop repeated stamps, with events.

    Parameters
    ----------
    table
        Rows of the IMU's file.
    gyro, accel
        First of the three columns of each, counted behind the stamp from 0; rad/s and m/s².

    Raises
    ------
    DataError
        A value that isn't finite; fewer than two samples.
    """
    columns = [*range(gyro, gyro + 3), *range(accel, accel + 3)]
    values = table.values[:, columns]
    bad = ~np.isfinite(values)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise DataError(
            f"{table.where(int(row))}: column {columns[column] + 2} is {values[row, column]}: "
            "every IMU value must be finite"
        )
    order, events = increasing_order(table.stamps_ns, "imu")
    if len(order) < 2:
        raise DataError(f"{table.path}: only {len(order)} IMU sample, at least 2 needed")
    values = values[order]
    return ImuBatch(table.stamps_ns[order], values[:, :3].copy(), values[:, 3:].copy()), events
