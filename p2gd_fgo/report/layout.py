"""The pieces that the terminal's tables are laid out with."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np
from rich import box
from rich.console import RenderableType
from rich.padding import Padding
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

NONE = "–"
_SIGNIFICANT = 3
_FEWEST = 2
_MOST_DECIMALS = 6


def title(text: str) -> RenderableType:
    """A line across, with an empty one before it."""
    return Padding(Rule(Text(text), align="left", style="dim"), (1, 0, 0, 0))


def pairs(items: Sequence[tuple[str, str]]) -> Table:
    """Names and values, one line each."""
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in items:
        table.add_row(Text(name), Text(value))
    return table


def grid(first: str, *others: str) -> Table:
    """An empty table: the first column to the left, numbers to the right."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column(Text(first), no_wrap=True)
    for name in others:
        table.add_column(Text(name), justify="right", no_wrap=True)
    return table


def column(values: Sequence[float]) -> list[str]:
    """Numbers with the same decimals, so many that the largest shows four digits or more."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    decimals = next((d for limit, d in ((0.1, 5), (1.0, 4), (100.0, 3)) if largest < limit), 2)
    return [fixed(value, decimals) for value in values]


def decimals(values: Iterable[float]) -> int:
    """Decimals that show three digits of the middle one of a column's values; 2 without any."""
    known = [abs(v) for v in values if math.isfinite(v) and v != 0.0]
    return _decimals_of(float(np.median(known))) if known else 2


def places(value: float, column_decimals: int) -> int:
    """The column's decimals; three digits of the value's own where these show it less than two.

    Of recordings worlds apart (0.006 m and 3 m) in one column each keeps its digits.
    """
    if not math.isfinite(value) or value == 0.0:
        return column_decimals
    shown = math.floor(math.log10(abs(value))) + 1 + column_decimals
    return column_decimals if shown >= _FEWEST else _decimals_of(abs(value))


def _decimals_of(value: float) -> int:
    return min(max(_SIGNIFICANT - 1 - math.floor(math.log10(value)), 0), _MOST_DECIMALS)


def fitting(values: Sequence[float], most: int = _MOST_DECIMALS) -> list[str]:
    """The numbers of a column, see :func:`decimals` and :func:`places`; ``most`` decimals."""
    shown = decimals(values)
    return [fixed(value, min(places(value, shown), most)) for value in values]


def natural(name: str) -> tuple[tuple[bool, int, str], ...]:
    """A key to sort names by, the numbers in them by their value."""
    pieces = re.split(r"(\d+)", name)
    return tuple((not p.isdigit(), int(p) if p.isdigit() else 0, p) for p in pieces)


def fixed(value: float, decimals: int) -> str:
    """A number with these decimals; a dash for NaN and infinity."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else NONE
