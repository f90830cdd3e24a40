"""A table before it is written: the same content for terminal, Markdown, LaTeX and HTML."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.report.layout import NONE, fixed, places

MINUS = "−"


@dataclass(frozen=True, slots=True)
class Part:
    """One value of a cell.

    Attributes
    ----------
    text
        As shown.
    order
        What the page sorts by: numbers before texts, None last.
    href
        Where it leads, a relative URL, or nothing.
    best
        Whether it is the best of those that it is compared with, and stands out.
    """

    text: str
    order: float | str | None = None
    href: str = ""
    best: bool = False


@dataclass(frozen=True, slots=True)
class Cell:
    """Values that belong together (``ARE / ATE``), and a remark such as ``2/3`` runs."""

    parts: tuple[Part, ...]
    mark: str = ""

    @property
    def text(self) -> str:
        """All values in one line, as the paper prints them."""
        joined = " / ".join(part.text for part in self.parts)
        return f"{joined} ({self.mark})" if self.mark else joined


@dataclass(frozen=True, slots=True)
class Column:
    """How a column is headed.

    Attributes
    ----------
    name, parts
        Its name, and the name of each value of its cells (one nameless value by default).
    numeric
        Whether it holds numbers.
    secondary
        Whether it is left out where room is short: in the terminal.
    """

    name: str
    parts: tuple[str, ...] = ("",)
    numeric: bool = True
    secondary: bool = False


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table with all that its reader must know.

    Attributes
    ----------
    key
        Short name: anchor on the page, label in LaTeX.
    title, caption
        Heading, and how the numbers were made: alignment, averages, runs.
    columns
        C of them.
    rows, summary
        Rows of C cells; the summary (RMS over the sequences) stays below when rows are sorted.
    notes
        Sentences below the table.
    """

    key: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    summary: tuple[tuple[Cell, ...], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def split(self) -> bool:
        """Whether any cell holds several values."""
        return any(len(column.parts) > 1 for column in self.columns)

    @property
    def meaning(self) -> str:
        """What the values of the cells with several are, such as ``ARE ° / ATE m``."""
        return next((" / ".join(c.parts) for c in self.columns if len(c.parts) > 1), "")


def repeats(rows: Sequence[tuple[Cell, ...]], row: int) -> bool:
    """Whether the first cell of a row says what the one above it does, and need not again."""
    return row > 0 and rows[row][0] == rows[row - 1][0]


def words(text: str, href: str = "") -> Cell:
    """A cell of text."""
    return Cell((Part(text, text, href),))


def number(value: float, decimals: int, *, sign: bool = False) -> Part:
    """A number with these decimals, a dash where it is unknown; ``sign`` writes the plus too."""
    if not math.isfinite(value):
        return Part(NONE)
    text = fixed(abs(value), decimals)
    zero = float(text) == 0.0
    if value < 0 and not zero:
        text = MINUS + text
    elif sign and not zero:
        text = "+" + text
    return Part(text, value)


def best_of(cells: Sequence[Cell], lower_is_better: Sequence[bool | None]) -> list[Cell]:
    """The cells with the best of each of their values marked; as shown, so that ties all are.

    Parameters
    ----------
    cells
        Of P values each, which are compared with one another.
    lower_is_better
        P, None where neither way is.
    """
    marked = [list(cell.parts) for cell in cells]
    for k, lower in enumerate(lower_is_better):
        known = [p[k] for p in marked if isinstance(p[k].order, float)]
        if lower is None or len({part.text for part in known}) < 2:
            continue
        pick = min if lower else max
        top = pick(known, key=lambda part: float(part.order or 0.0)).text
        for parts in marked:
            parts[k] = replace(parts[k], best=parts[k].text == top)
    return [replace(cell, parts=tuple(parts)) for cell, parts in zip(cells, marked, strict=True)]


def count(value: int) -> Cell:
    """A whole number."""
    return Cell((Part(str(value), float(value)),))


def measured(value: float, column_decimals: int) -> Part:
    """A number of a column with these decimals, more where the value is much smaller."""
    return number(value, places(value, column_decimals))


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean; NaN of nothing."""
    return float(np.mean(values)) if len(values) else math.nan


def rms(values: Sequence[float]) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan
