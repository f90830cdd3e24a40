"""Names from configurations and paths stay text in Markdown and in the terminal."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    Part,
    ReportTable,
    number,
    words,
)
from p2gd_fgo.report.pages.text_tables import markdown, markdown_table, terminal_table

NASTY = r"a|b_c & 50 % <script>alert(1)</script> `x` *y* $z$ {w} ~ ^ # \n [red]q[/red]"


def table(name: str = "grid", rows: int = 2) -> ReportTable:
    cell = Cell((number(1.5, 2), number(-2.0, 2)), "2/3")
    return ReportTable(
        "absolute", f"Errors of {name}", f"Aligned by {name}.",
        (Column("sequence", numeric=False), Column(name, ("ARE °", "ATE m")), Column("p")),
        tuple((words(name), cell, Cell((Part("0.01", 0.01),))) for _ in range(rows)),
        ((words("RMS"), cell, words("–")),), (f"A note on {name}.",),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a|b", r"a\|b"), ("<b>", "&lt;b&gt;"), ("a&b", "a&amp;b"), ("x_y_z", r"x\_y\_z"),
        ("50 %", "50 %"), ("a\n\nb", "a b"), ("[x](y)", r"\[x\](y)"),
    ],
)  # fmt: skip
def test_markdown_escapes(text: str, wanted: str) -> None:
    assert markdown(text) == wanted


def test_markdown_rows_keep_their_columns() -> None:
    lines = markdown_table(table(NASTY)).splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) == 5
    assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {4}
    assert "<script" not in "\n".join(lines)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_terminal_shows_every_column_in_any_width(width: int) -> None:
    columns = [Column("sequence", numeric=False), *(Column(f"method {k}") for k in range(12))]
    row = (words("kaist_like-200"), *(Cell((number(100.0 + k, 1),)) for k in range(12)))
    wide = ReportTable("t", "T", "c", tuple(columns), (row,))
    out = io.StringIO()
    Console(file=out, width=width).print(terminal_table(wide, width))
    text = out.getvalue()
    assert max(map(len, text.splitlines())) <= width
    for k in range(12):
        assert f"{100.0 + k:.1f}" in text
    assert text.count("kaist_like-200") >= (2 if width == 60 else 1)


def test_the_terminal_takes_markup_as_text_and_leaves_out_what_is_secondary() -> None:
    shown = ReportTable(
        "t", "T", "c",
        (Column("sequence", numeric=False), Column("x"), Column("unseen", secondary=True)),
        ((words(NASTY), words("1"), words("hidden")),),
    )  # fmt: skip
    out = io.StringIO()
    Console(file=out, width=200).print(terminal_table(shown, 200))
    assert NASTY in out.getvalue()
    assert "unseen" not in out.getvalue() and "hidden" not in out.getvalue()
