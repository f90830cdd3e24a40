"""LaTeX tables: the paper's layout, names as text, a page that pdflatex makes without a word."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from run_records import records, write_records

from p2gd_fgo.report.pages.latex_tables import WIDTHS, latex, latex_table
from p2gd_fgo.report.pages.table_model import Cell, Column, Part, ReportTable, number, words
from p2gd_fgo.report.pages.write import write_report

NASTY = r"a|b_c & 50 % <script>alert(1)</script> `x` *y* $z$ {w} ~ ^ # \n [red]q[/red]"
SPECIAL = r"a|b_c & 50 % <s> `x` *y* $z$ {w} ~ ^ # \n [red]"  # short enough for a page
PAGE = r"""\documentclass{article}
\usepackage[T1]{fontenc}
\usepackage{booktabs}
\begin{document}
\input{%s}
\end{document}
"""


def table(name: str = "grid", rows: int = 2) -> ReportTable:
    cell = Cell((number(1.5, 2), replace(number(-2.0, 2), best=True)), "2/3")
    heads = [f"{name} {k // 2}" for k in range(rows)]
    return ReportTable(
        "absolute", f"Errors of {name}", f"Aligned by {name}.",
        (Column("sequence", numeric=False), Column(name, ("ARE °", "ATE m")), Column("p")),
        tuple((words(head), cell, Cell((Part("0.01", 0.01),))) for head in heads),
        ((words("RMS"), cell, words("–")),), (f"A note on {name}.",),
    )  # fmt: skip


def rows_of(text: str) -> list[str]:
    """The rows of the tables below their heads."""
    bodies = re.findall(r"\\midrule\n(.*?)\\bottomrule", text, re.DOTALL)
    return [line for body in bodies for line in body.splitlines() if line.endswith(r" \\")]


def test_has_the_papers_layout() -> None:
    lines = latex_table(table()).splitlines()
    start = lines.index(r"\begin{tabular}{lrr}")
    empty, meaning = r"\multicolumn{1}{c}{}", r"\multicolumn{1}{c}{ARE $^\circ$ / ATE m}"
    assert lines[start + 1 : start + 4] == [
        r"\toprule",
        rf"{empty} & {meaning} & {empty} \\",
        r"\cmidrule(lr){2-2}",
    ]
    assert r"grid 0 & 1.50 / \textbf{$-$2.00} (2/3) & 0.01 \\" in lines
    assert lines[-4].startswith("RMS & 1.50") and lines[-5] == r"\midrule"
    assert lines[-3:] == [r"\bottomrule", r"\end{tabular}", r"\end{table}"]


def test_a_name_stands_once_for_its_rows() -> None:
    lines = latex_table(table(rows=4)).splitlines()
    start = lines.index(r"\midrule")
    assert [line.partition(" &")[0] for line in lines[start + 1 : start + 6]] == [
        "grid 0", "", r"\addlinespace", "grid 1", "",
    ]  # fmt: skip


def test_nasty_names_are_balanced_and_keep_their_columns() -> None:
    text = latex_table(table(NASTY))
    bare = re.sub(r"\\[\\{}$&%#_]", "", text)
    assert bare.count("{") == bare.count("}")
    assert not re.search(r"[#_~^]", bare.replace(r"$^\circ$", ""))
    assert "%" not in bare
    rows = rows_of(text)
    assert len(rows) >= 3
    specs = re.findall(r"\\begin\{tabular\}\{(\w+)\}", text)
    assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {len(s) - 1 for s in specs}
    for row in rows:
        assert not row.startswith("[")


def test_wide_and_long_tables_continue() -> None:
    columns = [Column("sequence", numeric=False), *(Column(f"method {k}") for k in range(20))]
    row = (words("kaist_like-200"), *(Cell((number(100.0 + k, 1),)) for k in range(20)))
    tall = ReportTable("t", "T", "c", tuple(columns), (row,) * 100)
    text = latex_table(tall)
    bodies = re.findall(r"\\begin\{tabular\}\{(l r*|lr*)\}", text)
    assert len(bodies) > 2 and "(continued)" in text and r"\begin{table*}" in text
    for k in range(20):
        assert text.count(f"{100.0 + k:.1f}") == 100
    assert max(len(row) for row in rows_of(text)) <= max(WIDTHS.values()) + 30
    assert text.count(r"\label{tab:t}") == 1


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a_b", r"a\_b"), ("50 %", r"50 \%"), ("a&b", r"a\&b"), ("\\x", r"\textbackslash{}x"),
        ("−1 ≥ 2°", r"$-$1 $\geq$ 2$^\circ$"), ("[x]", "{[}x{]}"), ("a\nb", "a b"),
    ],
)  # fmt: skip
def test_escapes(text: str, wanted: str) -> None:
    assert latex(text) == wanted


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex on the PATH")
def test_compiles_and_nothing_runs_over_the_page(tmp_path: Path) -> None:
    made = records(routes=12, seeds=2)
    made[0] = replace(made[0], status="failed", reason="<b>diverged</b>")
    made = [
        replace(r, sequence=f"a_b & 50 % {r.route}", route=f"a_b & 50 % {r.route}") for r in made
    ]
    write_records(tmp_path / "study" / "results.jsonl", made)
    tables = tmp_path / "tables.tex"
    write_report([tmp_path / "study"], latex_file=tables, figures=tmp_path / "figures")
    tables.write_text(f"{tables.read_text()}\n{latex_table(table(SPECIAL))}", encoding="utf-8")
    (tmp_path / "page.tex").write_text(PAGE % tables.name)
    ran = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "page.tex"],
        cwd=tmp_path, capture_output=True, text=True, errors="replace", check=False, timeout=120,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout[-2000:]
    complaints = re.findall(
        r"^(?:Overfull \\hbox|LaTeX Warning: Float too large).*", ran.stdout, re.M
    )
    assert complaints == []
