"""The grid of image cells that quotas are given for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.types import FloatArray, IntArray


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
        column = np.floor(u * (self.columns / self.width)).astype(np.int64)
        row = np.floor(v * (self.rows / self.height)).astype(np.int64)
        inside_column = np.clip(column, 0, self.columns - 1)
        return np.asarray(np.clip(row, 0, self.rows - 1) * self.columns + inside_column)

    def count(self, pixels: FloatArray) -> IntArray:
        """Features per cell (rows, columns) of pixels (N, 2)."""
        cells = np.bincount(self.cell_of(pixels), minlength=self.rows * self.columns)
        return cells.astype(np.int64).reshape(self.shape)

    def capacity(self, min_distance_px: float) -> int:
        """Features that a cell holds at a minimum distance: floor(area / distance²), at least 1."""
        area = (self.width / self.columns) * (self.height / self.rows)
        return max(1, int(area / min_distance_px**2))
