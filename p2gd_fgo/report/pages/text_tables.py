"""Tables of a report as Markdown, as LaTeX and for the terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from p2gd_fgo.report.layout import title
from p2gd_fgo.report.pages.table_model import Cell, ReportTable

_GUTTER = 3  # a blank on each side of a column, and one between two
_MARKDOWN = re.compile(r"([\\`*_{}\[\]|~#])")
_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "%": r"\%",
    "#": r"\#", "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", '"': "''",
    "[": "{[}", "]": "{]}",
    "°": r"$^\circ$", "−": "$-$", "±": r"$\pm$", "·": r"$\cdot$", "×": r"$\times$",
    "–": "--", "≥": r"$\geq$", "≤": r"$\leq$", "µ": r"$\mu$", "²": "$^2$", "→": r"$\rightarrow$",
}  # fmt: skip


def markdown(text: str) -> str:
    """Plain text for a place in a Markdown document, a table's cell included."""
    flat = " ".join(text.split()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _MARKDOWN.sub(r"\\\1", flat)


def latex(text: str) -> str:
    """Plain text for a place in a LaTeX document."""
    return "".join(_LATEX.get(character, character) for character in " ".join(text.split()))


def markdown_table(table: ReportTable) -> str:
    """A heading, the caption, the table and its notes."""
    names = [_head(column.name, column.parts) for column in table.columns]
    rule = ["---:" if column.numeric else ":---" for column in table.columns]
    lines = [names, rule]
    lines += [[_markdown_cell(cell) for cell in row] for row in table.rows]
    lines += [[f"**{_markdown_cell(cell)}**" for cell in row] for row in table.summary]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    notes = "".join(f"\n\n{markdown(note)}" for note in table.notes)
    return f"## {markdown(table.title)}\n\n{markdown(table.caption)}\n\n{body}{notes}\n"


def latex_table(table: ReportTable) -> str:
    """A ``table`` environment; needs the package booktabs."""
    spec = "".join("r" if column.numeric else "l" for column in table.columns)
    head = " & ".join(latex(column.name) for column in table.columns)
    lines = [
        r"\begin{table}[tb]",
        r"\centering",
        rf"\caption{{{latex(table.title)}. {latex(' '.join((table.caption, *table.notes)))}}}",
        rf"\label{{tab:{table.key}}}",
        rf"\begin{{tabular}}{{{spec}}}",
        r"\toprule",
    ]
    if table.split:
        first = next(k for k, c in enumerate(table.columns) if len(c.parts) > 1)
        several = sum(len(column.parts) > 1 for column in table.columns)
        lines.append(
            rf"{'& ' * first}\multicolumn{{{several}}}{{c}}{{{latex(table.meaning)}}}"
            rf"{' &' * (len(table.columns) - first - several)} \\"
        )
        lines.append(rf"\cmidrule(lr){{{first + 1}-{first + several}}}")
    lines += [rf"{head} \\", r"\midrule"]
    lines += [_latex_row(row) for row in table.rows]
    if table.summary:
        lines += [r"\midrule", *(_latex_row(row) for row in table.summary)]
    lines += [r"\bottomrule", r"\end{tabular}", r"\end{table}"]
    return "\n".join(lines) + "\n"


def terminal_table(table: ReportTable, width: int) -> RenderableType:
    """The table under its title; columns that don't fit the width follow in tables below it."""
    caption = table.caption + (f" Cells: {table.meaning}." if table.split else "")
    notes = [Text(note, style="dim") for note in table.notes]
    parts = (_part(table, columns) for columns in _fitting(table, width))
    return Group(title(table.title), Text(caption, style="dim"), *parts, *notes)


def _part(table: ReportTable, columns: Sequence[int]) -> Table:
    shown = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for k in columns:
        column = table.columns[k]
        side: Literal["left", "right"] = "right" if column.numeric else "left"
        shown.add_column(Text(column.name), justify=side, overflow="fold")
    for row in table.rows:
        shown.add_row(*(Text(row[k].text) for k in columns))
    if table.summary:
        shown.add_section()
    for row in table.summary:
        shown.add_row(*(Text(row[k].text, style="bold") for k in columns))
    return shown


def _fitting(table: ReportTable, width: int) -> list[list[int]]:
    """Columns of each part: those of text in all of them, the numbers spread over the parts."""
    widths = [
        max(
            max((len(word) for word in column.name.split()), default=0),
            *(len(row[k].text) for row in (*table.rows, *table.summary)),
        )
        for k, column in enumerate(table.columns)
    ]
    shown = [k for k, column in enumerate(table.columns) if not column.secondary]
    heads = [k for k in shown if not table.columns[k].numeric]
    room = width - sum(widths[k] + _GUTTER for k in heads)
    parts: list[list[int]] = []
    left = -1
    for k in (k for k in shown if table.columns[k].numeric):
        if left < widths[k] + _GUTTER:
            parts.append(list(heads))
            left = room
        parts[-1].append(k)
        left -= widths[k] + _GUTTER
    return parts or [heads]


def _head(name: str, parts: tuple[str, ...]) -> str:
    unit = " / ".join(parts) if len(parts) > 1 else parts[0]
    return markdown(name) + (f"<br>{markdown(unit)}" if unit else "")


def _markdown_cell(cell: Cell) -> str:
    return markdown(cell.text)


def _latex_row(row: tuple[Cell, ...]) -> str:
    return " & ".join(latex(cell.text) for cell in row) + r" \\"
