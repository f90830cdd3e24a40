"""A table before it is written: the same content for terminal, Markdown, LaTeX and HTML."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.report.layout import NONE, fixed

MINUS = "−"
_SIGNIFICANT = 3
_MOST_DECIMALS = 4


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
    """

    text: str
    order: float | str | None = None
    href: str = ""


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


def count(value: int) -> Cell:
    """A whole number."""
    return Cell((Part(str(value), float(value)),))


def decimals(values: Iterable[float]) -> int:
    """Decimals, 4 at most, that show three digits of all but the smallest quarter of values."""
    known = np.array([abs(v) for v in values if math.isfinite(v) and v != 0.0])
    if len(known) == 0:
        return 2
    small = float(np.percentile(known, 25))
    return min(max(_SIGNIFICANT - 1 - math.floor(math.log10(small)), 0), _MOST_DECIMALS)


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean; NaN of nothing."""
    return float(np.mean(values)) if len(values) else math.nan


def rms(values: Sequence[float]) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan
