"""Tables of a report as LaTeX, in the paper's layout (booktabs)."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterator, Sequence

from p2gd_fgo.report.pages.table_model import Cell, Column, ReportTable, repeats
from p2gd_fgo.report.pages.text_tables import column_widths, fitting_columns

WIDTHS = {"footnotesize": 75, "scriptsize": 85}  # letters across an article's page
_ONE_COLUMN = 56  # of a page of two columns
_GUTTER = 2  # letters between two columns
_MOST_LINES = 43  # of a page, its caption above them
_HEAD_LINES = 3
_BLOCK_GAP = 0.6
_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "%": r"\%",
    "#": r"\#", "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", '"': "''",
    "[": "{[}", "]": "{]}",
    "°": r"$^\circ$", "−": "$-$", "±": r"$\pm$", "·": r"$\cdot$", "×": r"$\times$",
    "–": "--", "≥": r"$\geq$", "≤": r"$\leq$", "µ": r"$\mu$", "²": "$^2$", "→": r"$\rightarrow$",
}  # fmt: skip


def latex(text: str) -> str:
    """Plain text for a place in a LaTeX document."""
    return "".join(_LATEX.get(character, character) for character in " ".join(text.split()))


def latex_table(table: ReportTable) -> str:
    """One or more ``table`` environments; what is secondary is left out, as in the terminal.

    A table too wide for a page continues below itself, one too long in further environments.
    """
    parts, size = min(
        ((fitting_columns(table, width, _GUTTER), size) for size, width in WIDTHS.items()),
        key=lambda found: len(found[0]),
    )
    lines = _MOST_LINES / len(parts) - _HEAD_LINES
    chunks = list(_chunks(table, max(lines, 1.0)))
    found = []
    for number, rows in enumerate(chunks):
        last = number == len(chunks) - 1
        bodies = [_tabular(table, columns, rows, summary=last) for columns in parts]
        found.append(_environment(table, size, bodies, continued=number > 0))
    return "\n".join(found)


def _chunks(table: ReportTable, room: float) -> Iterator[range]:
    """Rows of each environment; those under one name stay together, the summary with the last."""
    starts = [k for k in range(len(table.rows)) if not repeats(table.rows, k)]
    gap = _BLOCK_GAP if len(starts) < len(table.rows) else 0.0
    start, lines = 0, 0.0
    for first, end in itertools.pairwise([*starts, len(table.rows)]):
        tail = len(table.summary) if end == len(table.rows) else 0
        if lines + gap + end - first + tail > room and first > start:
            yield range(start, first)
            start, lines = first, 0.0
        while end - start + tail > room and start >= first and end - start > 1:
            cut = start + max(min(int(room), end - start - 1), 1)
            yield range(start, cut)
            start = cut
        lines += gap + end - max(first, start)
    yield range(start, len(table.rows))


def _environment(table: ReportTable, size: str, bodies: Sequence[str], *, continued: bool) -> str:
    title, label = latex(table.title), f"tab:{table.key}"
    caption = rf"\caption{{{title}. {latex(' '.join((table.caption, *table.notes)))}}}"
    marks = [caption, rf"\label{{{label}}}"]
    if continued:
        marks = [r"\addtocounter{table}{-1}", rf"\caption{{{title} (continued).}}"]
    wide = len(fitting_columns(table, _ONE_COLUMN, _GUTTER)) > 1
    name = "table*" if wide else "table"
    lines = [
        rf"\begin{{{name}}}[{'t' if wide else 'tb'}]",
        r"\centering",
        *marks,
        rf"\{size}",
        r"\setlength{\tabcolsep}{4pt}",
        "\n\n\\medskip\n".join(bodies),
        rf"\end{{{name}}}",
    ]
    return "\n".join(lines) + "\n"


def _tabular(
    table: ReportTable, columns: Sequence[int], rows: Sequence[int], *, summary: bool
) -> str:
    heads = [table.columns[k] for k in columns]
    spec = "".join("r" if head.numeric else "l" for head in heads)
    lines = [rf"\begin{{tabular}}{{{spec}}}", r"\toprule", *_meanings(table, columns)]
    widths = column_widths(table)
    names = [_head(table.columns[k], widths[k]) for k in columns]
    lines += [rf"{' & '.join(names)} \\", r"\midrule"]
    lines += _body(table, columns, rows)
    if summary and table.summary:
        lines.append(r"\midrule")
        for at, row in enumerate(table.summary):
            lines.append(_row([row[k] for k in columns], blank=repeats(table.summary, at)))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"])


def _head(column: Column, width: int) -> str:
    """Its name, in several lines where the column is not as wide."""
    lines = [latex(line) for line in textwrap.wrap(column.name, width, break_long_words=False)]
    if len(lines) < 2:
        return "".join(lines)
    side, stacked = "r" if column.numeric else "l", r"\\".join(lines)
    return rf"\shortstack[{side}]{{{stacked}}}"


def _meanings(table: ReportTable, columns: Sequence[int]) -> Iterator[str]:
    """Above the heads: what the values of the cells with several are, over neighbours alike."""
    runs: list[tuple[str, int]] = []
    for k in columns:
        parts = table.columns[k].parts
        text = " / ".join(parts) if len(parts) > 1 else ""
        before = runs[-1] if runs and runs[-1][0] == text else None
        runs[-1:] = [(text, before[1] + 1)] if before else [*runs[-1:], (text, 1)]
    if not any(text for text, _ in runs):
        return
    cells, rules, at = [], [], 1
    for text, count in runs:
        cells.append(rf"\multicolumn{{{count}}}{{c}}{{{latex(text)}}}")
        rules += [rf"\cmidrule(lr){{{at}-{at + count - 1}}}"] if text else []
        at += count
    yield rf"{' & '.join(cells)} \\"
    yield " ".join(rules)


def _body(table: ReportTable, columns: Sequence[int], rows: Sequence[int]) -> Iterator[str]:
    """The rows; a little room before each new name, which stands there once."""
    blocks = any(repeats(table.rows, k) for k in range(len(table.rows)))
    for at, k in enumerate(rows):
        cells = [table.rows[k][column] for column in columns]
        repeated = at > 0 and repeats(table.rows, k)
        if blocks and at > 0 and not repeated:
            yield r"\addlinespace"
        yield _row(cells, blank=repeated)


def _row(cells: Sequence[Cell], *, blank: bool) -> str:
    texts = [_cell(cell) for cell in cells]
    return " & ".join(["", *texts[1:]] if blank else texts) + r" \\"


def _cell(cell: Cell) -> str:
    joined = " / ".join(
        rf"\textbf{{{latex(part.text)}}}" if part.best else latex(part.text) for part in cell.parts
    )
    return f"{joined} ({latex(cell.mark)})" if cell.mark else joined
