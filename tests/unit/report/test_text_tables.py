"""Names from configurations and paths stay text in Markdown, in LaTeX and in the terminal."""

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
from p2gd_fgo.report.pages.text_tables import (
    latex,
    latex_table,
    markdown,
    markdown_table,
    terminal_table,
)

NASTY = r"a|b_c & 50 % <script>alert(1)</script> `x` *y* $z$ {w} ~ ^ # \n [red]q[/red]"


def table(name: str = "grid", rows: int = 2) -> ReportTable:
    cell = Cell((number(1.5, 2), number(-2.0, 2)), "2/3")
    return ReportTable(
        "absolute", f"Errors of {name}", f"Aligned by {name}.",
        (Column("sequence", numeric=False), Column(name, ("ARE °", "ATE m")), Column("p")),
        tuple((words(name), cell, Cell((Part("0.01", 0.01),))) for _ in range(rows)),
        ((words("RMS"), cell, words("–")),), (f"A note on {name}.",),
    )  # fmt: skip


def test_latex_has_the_papers_layout() -> None:
    lines = latex_table(table()).splitlines()
    assert lines[4:8] == [
        r"\begin{tabular}{lrr}",
        r"\toprule",
        r"& \multicolumn{1}{c}{ARE $^\circ$ / ATE m} & \\",
        r"\cmidrule(lr){2-2}",
    ]
    assert r"grid & 1.50 / $-$2.00 (2/3) & 0.01 \\" in lines
    assert lines[-4].startswith("RMS & 1.50") and lines[-5] == r"\midrule"
    assert lines[-3:] == [r"\bottomrule", r"\end{tabular}", r"\end{table}"]


def test_latex_of_nasty_names_is_balanced_and_keeps_its_columns() -> None:
    text = latex_table(table(NASTY))
    bare = re.sub(r"\\[\\{}$&%#_]", "", text)
    assert bare.count("{") == bare.count("}")
    assert not re.search(r"[#_~^]", bare.replace(r"$^\circ$", ""))
    assert "%" not in bare
    rows = [line for line in text.splitlines() if line.endswith(r" \\")]
    assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {2}
    for row in rows:
        assert not row.startswith("[")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a_b", r"a\_b"), ("50 %", r"50 \%"), ("a&b", r"a\&b"), ("\\x", r"\textbackslash{}x"),
        ("−1 ≥ 2°", r"$-$1 $\geq$ 2$^\circ$"), ("[x]", "{[}x{]}"), ("a\nb", "a b"),
    ],
)  # fmt: skip
def test_latex_escapes(text: str, wanted: str) -> None:
    assert latex(text) == wanted


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
