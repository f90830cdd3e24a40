"""The grid of image cells that quotas are given for."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class CellGrid:
    """An image divided into equal cells (paper eq. 7).

    Attributes
    ----------
    columns, rows
        Numbers of cells.
    width, height
        Size of the image, px.
    """

    columns: int
    rows: int
    width: int
    height: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), the shape of quotas and counts."""
        return self.rows, self.columns

    def cell_of(self, pixels: FloatArray) -> IntArray:
        """Flat index row * columns + column (N,) of pixels (N, 2); the nearest cell outside."""
        u, v = np.asarray(pixels, dtype=np.float64).reshape(-1, 2).T
        return np.asarray(self._row_of(v) * self.columns + self._column_of(u))

    def count(self, pixels: FloatArray) -> IntArray:
        """Features per cell (rows, columns) of pixels (N, 2)."""
        cells = np.bincount(self.cell_of(pixels), minlength=self.rows * self.columns)
        return cells.astype(np.int64).reshape(self.shape)

    def capacity(self, min_distance_px: float) -> int:
        """Features that a cell holds at a minimum distance: floor(area / distance²), at least 1."""
        area = (self.width / self.columns) * (self.height / self.rows)
        return max(1, int(area / min_distance_px**2))

    def capacities(self, min_distance_px: float, allowed: BoolArray | None = None) -> IntArray:
        """:meth:`capacity` (rows, columns) of the part of each cell that ``allowed`` leaves.

        ``allowed`` (height, width) is false under a mask; a cell quite under it holds nothing.
        """
        full = np.full(self.shape, self.capacity(min_distance_px), dtype=np.int64)
        if allowed is None:
            return full
        rows = np.searchsorted(self._row_of(np.arange(self.height)), np.arange(self.rows + 1))
        columns = np.searchsorted(
            self._column_of(np.arange(self.width)), np.arange(self.columns + 1)
        )
        sums = cv2.integral(allowed.view(np.uint8))[np.ix_(rows, columns)]
        left = np.diff(np.diff(sums, axis=0), axis=1)
        size = np.outer(np.diff(rows), np.diff(columns))
        return np.asarray(np.ceil(full * (left / np.maximum(size, 1))), dtype=np.int64)

    def _column_of(self, u: FloatArray | IntArray) -> IntArray:
        column = np.floor(u * (self.columns / self.width)).astype(np.int64)
        return np.clip(column, 0, self.columns - 1)

    def _row_of(self, v: FloatArray | IntArray) -> IntArray:
        row = np.floor(v * (self.rows / self.height)).astype(np.int64)
        return np.clip(row, 0, self.rows - 1)
