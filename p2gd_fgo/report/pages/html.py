"""The report as one HTML page that holds all it shows, and its figures as files."""

from __future__ import annotations

import base64
import io
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from p2gd_fgo import __version__
from p2gd_fgo.atomic_files import atomic_path, write_text
from p2gd_fgo.report.pages.build import Report, Section
from p2gd_fgo.report.pages.figures import ReportFigure
from p2gd_fgo.report.pages.links import file_name, relative_url
from p2gd_fgo.report.pages.table_model import Cell, Column, ReportTable

_DOTS = 2  # image pixels per CSS pixel
_INTERVAL = re.compile(r"\[[^\]]*\]")
_UNIT = re.compile(r" (°|%|m|ms|s|\d+)$")


@dataclass(frozen=True, slots=True)
class _Figure:
    anchor: str
    title: str
    caption: str
    data_uri: str
    width: int
    height: int
    links: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class _Table:
    """A table with an anchor that is its own on the page."""

    anchor: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    summary: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...]
    split: bool


@dataclass(frozen=True, slots=True)
class _Section:
    anchor: str
    title: str
    claims: tuple[str, ...]
    tables: tuple[_Table, ...]
    figures: tuple[_Figure, ...]


def write_html(report: Report, page: Path, figures: Path | None) -> None:
    """Write the page, whole or not at all.

    Parameters
    ----------
    page
        The file; its folder exists.
    figures
        Folder for every figure as PNG and PDF, made if need be, or None.
    """
    environment = Environment(
        loader=PackageLoader("p2gd_fgo.report.pages"),
        autoescape=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {"with_unit": _with_unit, "unbroken": _unbroken}
    if figures is not None:
        figures.mkdir(parents=True, exist_ok=True)
    sections = [_section(section, page, figures) for section in report.sections]
    template = environment.get_template("report.html.j2")
    write_text(page, template.render(report=report, sections=sections, version=__version__))


def _with_unit(name: str) -> str:
    """A heading whose unit stays on the line of what it is of."""
    return _UNIT.sub("\N{NO-BREAK SPACE}\\1", name)


def _unbroken(sentence: str) -> str:
    """A sentence whose intervals and percentages stay on one line."""
    kept = _INTERVAL.sub(lambda found: found[0].replace(" ", "\N{NO-BREAK SPACE}"), sentence)
    return kept.replace(" %", "\N{NO-BREAK SPACE}%")


def _section(section: Section, page: Path, figures: Path | None) -> _Section:
    return _Section(
        section.key,
        section.title,
        section.claims,
        tuple(_table(table, section.key) for table in section.tables),
        tuple(
            _figure(figure, f"{section.key}_{k:02d}", page, figures)
            for k, figure in enumerate(section.figures, 1)
        ),
    )


def _table(table: ReportTable, section: str) -> _Table:
    return _Table(
        f"{section}-{table.key}",
        table.title,
        table.caption,
        table.columns,
        table.rows,
        table.summary,
        table.notes,
        table.split,
    )


def _figure(figure: ReportFigure, prefix: str, page: Path, folder: Path | None) -> _Figure:
    png = _rendered(figure, "png")
    links: Sequence[tuple[str, str]] = ()
    stem = file_name(prefix, figure.key)
    if folder is not None:
        files = {"PNG": folder / f"{stem}.png", "PDF": folder / f"{stem}.pdf"}
        for path, content in zip(files.values(), (png, _rendered(figure, "pdf")), strict=True):
            with atomic_path(path) as temporary:
                temporary.write_bytes(content)
        links = [(name, relative_url(path, page)) for name, path in files.items()]
    width, height = struct.unpack(">II", png[16:24])
    uri = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    return _Figure(
        stem, figure.title, figure.caption, uri, width // _DOTS, height // _DOTS, tuple(links)
    )


def _rendered(figure: ReportFigure, kind: str) -> bytes:
    """The picture's bytes, the same for the same figure: no date in it."""
    buffer = io.BytesIO()
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}}[kind]
    figure.figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()
