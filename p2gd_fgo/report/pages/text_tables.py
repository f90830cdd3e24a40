"""Tables of a report as Markdown and for the terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from p2gd_fgo.report.layout import title
from p2gd_fgo.report.pages.table_model import Cell, ReportTable, repeats

_GUTTER = 3  # a blank on each side of a column, and one between two
_MARKDOWN = re.compile(r"([\\`*_{}\[\]|~#])")


def markdown(text: str) -> str:
    """Plain text for a place in a Markdown document, a table's cell included."""
    flat = " ".join(text.split()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _MARKDOWN.sub(r"\\\1", flat)


def markdown_table(table: ReportTable) -> str:
    """A heading, the caption, the table and its notes."""
    names = [_head(column.name, column.parts) for column in table.columns]
    rule = ["---:" if column.numeric else ":---" for column in table.columns]
    lines = [names, rule]
    lines += [[_markdown_cell(cell) for cell in row] for row in table.rows]
    lines += [
        [f"**{markdown(row[0].text)}**", *map(_markdown_cell, row[1:])] for row in table.summary
    ]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    notes = "".join(f"\n\n{markdown(note)}" for note in table.notes)
    return f"## {markdown(table.title)}\n\n{markdown(table.caption)}\n\n{body}{notes}\n"


def terminal_table(table: ReportTable, width: int) -> RenderableType:
    """The table under its title; columns that don't fit the width follow in tables below it."""
    caption = table.caption + (f" Cells: {table.meaning}." if table.split else "")
    notes = [Text(note, style="dim") for note in table.notes]
    parts = (_part(table, columns) for columns in fitting_columns(table, width))
    return Group(title(table.title), Text(caption, style="dim"), *parts, *notes)


def _part(table: ReportTable, columns: Sequence[int]) -> Table:
    shown = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for k in columns:
        column = table.columns[k]
        side: Literal["left", "right"] = "right" if column.numeric else "left"
        shown.add_column(Text(column.name), justify=side, overflow="fold")
    for at, row in enumerate(table.rows):
        cells = [_terminal_cell(row[k]) for k in columns]
        shown.add_row(*([Text(""), *cells[1:]] if repeats(table.rows, at) else cells))
    if table.summary:
        shown.add_section()
    for at, row in enumerate(table.summary):
        head = Text("" if repeats(table.summary, at) else row[0].text, style="bold")
        shown.add_row(head, *(_terminal_cell(row[k]) for k in columns[1:]))
    return shown


def _terminal_cell(cell: Cell) -> Text:
    text = Text(" / ").join(
        Text(part.text, style="bold" if part.best else "") for part in cell.parts
    )
    return text.append(f" ({cell.mark})") if cell.mark else text


def fitting_columns(table: ReportTable, width: int, gutter: int = _GUTTER) -> list[list[int]]:
    """Columns of each part: those of text in all of them, the numbers spread over the parts.

    What is secondary is left out; ``width`` and the ``gutter`` between columns are in letters.
    """
    widths = column_widths(table)
    shown = [k for k, column in enumerate(table.columns) if not column.secondary]
    heads = [k for k in shown if not table.columns[k].numeric]
    room = width - sum(widths[k] + gutter for k in heads)
    parts: list[list[int]] = []
    left = -1
    for k in (k for k in shown if table.columns[k].numeric):
        if left < widths[k] + gutter:
            parts.append(list(heads))
            left = room
        parts[-1].append(k)
        left -= widths[k] + gutter
    return parts or [heads]


def column_widths(table: ReportTable) -> list[int]:
    """Letters of each column, its head broken between words."""
    return [
        max(
            max((len(word) for word in column.name.split()), default=0),
            *(len(row[k].text) for row in (*table.rows, *table.summary)),
        )
        for k, column in enumerate(table.columns)
    ]


def _head(name: str, parts: tuple[str, ...]) -> str:
    unit = " / ".join(parts) if len(parts) > 1 else parts[0]
    return markdown(name) + (f"<br>{markdown(unit)}" if unit else "")


def _markdown_cell(cell: Cell) -> str:
    joined = " / ".join(
        f"**{markdown(part.text)}**" if part.best else markdown(part.text) for part in cell.parts
    )
    return f"{joined} ({markdown(cell.mark)})" if cell.mark else joined
