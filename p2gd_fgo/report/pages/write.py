"""From folders of runs to the files of a report, and to what the terminal shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.rule import Rule
from rich.text import Text

from p2gd_fgo.atomic_files import write_text
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.alignment import ALIGNMENTS
from p2gd_fgo.report.layout import pairs, title
from p2gd_fgo.report.pages.build import Report, build_report
from p2gd_fgo.report.pages.html import write_html
from p2gd_fgo.report.pages.latex_tables import latex_table
from p2gd_fgo.report.pages.sources import Found, find_runs
from p2gd_fgo.report.pages.text_tables import markdown, markdown_table, terminal_table

PAGE = "report.html"


@dataclass(frozen=True, slots=True)
class Written:
    """What was made: the report, and the files that hold it."""

    report: Report
    files: tuple[Path, ...]

    def terminal(self, width: int) -> RenderableType:
        """All of it but the figures and the list of runs, for so many columns."""
        report = self.report
        parts: list[RenderableType] = [
            Rule("report", align="left", style="dim"),
            pairs(report.facts),
        ]
        for alarm in report.alarms:
            text = Text("\n".join((alarm.title.upper(), *alarm.lines)), style="bold red")
            parts.append(Panel(text, border_style="red", box=box.HEAVY))
        for section in report.sections:
            if section.claims:
                parts += [title(section.title), *(Text(f"• {said}") for said in section.claims)]
            parts += [terminal_table(t, width) for t in section.tables if t.key != "runs"]
        return Group(*parts)


def write_report(
    places: Sequence[Path],
    *,
    html: Path | None = None,
    markdown_file: Path | None = None,
    latex_file: Path | None = None,
    figures: Path | None = None,
    baseline: str | None = None,
    alignment: str | None = None,
    heading: str | None = None,
) -> Written:
    """Write the page with its figures, and Markdown and LaTeX where they are asked for.

    Parameters
    ----------
    places
        At least one, see :func:`find_runs`.
    html
        The page; by default ``report.html`` in the first place.
    markdown_file, latex_file
        Files for the tables.
    figures
        Folder for every figure as PNG and PDF; by default beside the page, named as it.
    baseline, alignment, heading
        See :func:`build_report`; the heading is the study's name by default.

    Raises
    ------
    DataError
        No run in a place, or a file of one can't be read.
    ConfigError
        An unknown alignment or baseline, or a file that can't be written.
    """
    if alignment is not None and alignment not in ALIGNMENTS:
        raise ConfigError(f"--alignment {alignment}: give one of {', '.join(ALIGNMENTS)}")
    found = find_runs(places)
    first = places[0]
    page = html or (first if first.is_dir() else first.parent) / PAGE
    folder = figures or page.with_name(f"{page.stem}_figures")
    report = build_report(
        found,
        title=heading or _heading(found, first),
        page=page,
        baseline=baseline,
        alignment=alignment,
    )
    asked = ((markdown_file, _markdown), (latex_file, _latex))
    texts = [(path, text(report)) for path, text in asked if path is not None]
    written = [page, folder, *(path for path, _ in texts)]
    try:
        for path in written:
            path.parent.mkdir(parents=True, exist_ok=True)
        write_html(report, page, folder)
        for path, content in texts:
            write_text(path, content)
    except OSError as error:
        raise ConfigError(
            f"{error.filename}: can't be written: {error.strerror}; name another place"
        ) from None
    return Written(report, tuple(written))


def _heading(found: Found, place: Path) -> str:
    studies = list(dict.fromkeys(e.record.study for e in found.entries if e.record.study))
    return ", ".join(studies) or place.resolve().name


def _markdown(report: Report) -> str:
    lines = [f"# {markdown(report.title)}", ""]
    lines += [f"- {markdown(name)}: {markdown(value)}" for name, value in report.facts]
    for alarm in report.alarms:
        lines += ["", f"**{markdown(alarm.title)}**", ""]
        lines += [f"- {markdown(line)}" for line in alarm.lines]
    for section in report.sections:
        if section.claims:
            lines += ["", f"## {markdown(section.title)}: what is shown", ""]
            lines += [f"- {markdown(said)}" for said in section.claims]
        for table in section.tables:
            lines += ["", markdown_table(table).rstrip()]
    return "\n".join(lines) + "\n"


def _latex(report: Report) -> str:
    head = "% Needs \\usepackage{booktabs}. Wide tables are table*, for pages of two columns.\n"
    return head + "".join(f"\n{latex_table(t)}" for t in report.tables if t.key != "runs")
