"""The pieces that the terminal's tables are laid out with."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.console import RenderableType
from rich.padding import Padding
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

NONE = "–"


def title(text: str) -> RenderableType:
    """A line across, with an empty one before it."""
    return Padding(Rule(text, align="left", style="dim"), (1, 0, 0, 0))


def pairs(items: Sequence[tuple[str, str]]) -> Table:
    """Names and values, one line each."""
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in items:
        table.add_row(name, Text(value))
    return table


def grid(first: str, *others: str) -> Table:
    """An empty table: the first column to the left, numbers to the right."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def column(values: Sequence[float]) -> list[str]:
    """Numbers with the same decimals, so many that the largest shows four digits or more."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    decimals = next((d for limit, d in ((0.1, 5), (1.0, 4), (100.0, 3)) if largest < limit), 2)
    return [fixed(value, decimals) for value in values]


def fixed(value: float, decimals: int) -> str:
    """A number with these decimals; a dash for NaN and infinity."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else NONE
