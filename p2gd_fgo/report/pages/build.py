"""Puts a report together: what stands in it, in which order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from p2gd_fgo.report.pages.collection import Baseline, Collection, choose_baseline
from p2gd_fgo.report.pages.comparison import claims, compare_group, comparison_table
from p2gd_fgo.report.pages.episode_tables import compare_pieces, episode_table, largest_table
from p2gd_fgo.report.pages.figures import (
    ReportFigure,
    rte_figure,
    timing_figure,
    track_lengths_figure,
)
from p2gd_fgo.report.pages.measures import main_alignment
from p2gd_fgo.report.pages.noise_table import noise_table
from p2gd_fgo.report.pages.overview import Alarm, alarms, facts, runs_table
from p2gd_fgo.report.pages.paper_tables import (
    absolute_table,
    lengths_table,
    per_image_table,
    relative_table,
    runtime_table,
    tracking_table,
)
from p2gd_fgo.report.pages.route_figures import error_figure, read_route, trajectory_figure
from p2gd_fgo.report.pages.sources import Found
from p2gd_fgo.report.pages.styles import styles
from p2gd_fgo.report.pages.table_model import ReportTable

_Chapter = tuple[
    str,
    str,
    Sequence[str],
    Sequence[ReportTable | None],
    Callable[[], Sequence[ReportFigure | None]],
]
"""Key, title, what is claimed, tables, and what draws the figures."""

MOST_ROUTES = 24
"""Routes of a group whose trajectories are drawn."""


@dataclass(frozen=True, slots=True)
class Section:
    """A chapter: tables, and figures that are drawn when they are asked for."""

    key: str
    title: str
    claims: tuple[str, ...] = ()
    tables: tuple[ReportTable, ...] = ()
    figures: tuple[ReportFigure, ...] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """All of a report.

    Attributes
    ----------
    title, lead
        Heading, and one sentence.
    facts
        What was run: name and value.
    alarms
        What must be seen before any number.
    sections
        In order.
    """

    title: str
    lead: str
    facts: tuple[tuple[str, str], ...]
    alarms: tuple[Alarm, ...]
    sections: tuple[Section, ...]

    @property
    def tables(self) -> list[ReportTable]:
        """Of all sections."""
        return [table for section in self.sections for table in section.tables]


def build_report(
    found: Found,
    *,
    title: str,
    page: Path,
    baseline: str | None = None,
    alignment: str | None = None,
    figures: bool = True,
) -> Report:
    """Make the tables and figures of runs.

    Parameters
    ----------
    found
        At least one run.
    title
        Heading.
    page
        Where the page will lie, which links start from.
    baseline
        ``axis=label`` that methods are compared with; by default the grid.
    alignment
        Of the absolute errors; by default the one that all runs name, else ``yaw_pos``.
    figures
        Whether any are drawn.

    Raises
    ------
    ConfigError
        No run is of the baseline.
    """
    collection = Collection(found.entries)
    compared = choose_baseline(collection, baseline)
    alignment = alignment or main_alignment(found.entries)
    sections: list[Section] = []
    for number, group in enumerate(collection.groups):
        sections += _sections(collection, group, number, compared, alignment, figures)
    runs = runs_table(collection, alignment, page)
    sections.append(Section("runs", "Runs", tables=(runs,)))
    methods, routes = len(collection.methods), len(collection.routes)
    lead = (
        f"{len(collection.entries)} runs of {methods} method{'s' * (methods > 1)} on {routes} "
        f"sequence{'s' * (routes > 1)}."
    )
    return Report(
        title,
        lead,
        tuple(facts(collection, compared, alignment)),
        tuple(alarms(collection, found.remarks)),
        tuple(sections),
    )


def _sections(
    collection: Collection,
    group: str,
    number: int,
    baseline: Baseline | None,
    alignment: str,
    figures: bool,
) -> Iterator[Section]:
    of = f": {group}" if len(collection.groups) > 1 else ""
    compared = compare_group(collection, group, baseline, alignment) if baseline else []
    looks = styles(collection)
    pieces = compare_pieces(collection, group, baseline) if baseline else []
    chapters: list[_Chapter] = [
        ("paired", "Comparison", claims(collection, compared), [
            comparison_table(collection, compared, alignment),
        ], lambda: []),
        ("accuracy", "Accuracy", [], [
            absolute_table(collection, group, baseline, alignment),
            relative_table(collection, group, baseline),
            noise_table(collection, group, alignment),
        ], lambda: _accuracy_figures(collection, group, alignment)),
        ("episodes", "Where the error is made", [], [
            episode_table(pieces),
            largest_table(pieces),
        ], lambda: []),
        ("tracking", "Tracking", [], [
            tracking_table(collection, group, baseline),
            per_image_table(collection, group),
            lengths_table(collection, group, baseline),
        ], lambda: [track_lengths_figure(collection, group, looks)]),
        ("runtime", "Time", [], [
            runtime_table(collection, group),
        ], lambda: [timing_figure(collection, group, looks)]),
    ]  # fmt: skip
    for key, title, said, tables, draw in chapters:
        drawn = draw() if figures else []
        section = Section(
            f"{key}-{number}" if number else key,
            title + of,
            tuple(said),
            tables=tuple(_of_group(table, of, number) for table in tables if table is not None),
            figures=tuple(figure for figure in drawn if figure is not None),
        )
        if section.tables or section.figures:
            yield section


def _of_group(table: ReportTable, of: str, number: int) -> ReportTable:
    """The table with a key and a title of its own where there are several groups."""
    key = f"{table.key}-{number}" if number else table.key
    return replace(table, key=key, title=table.title + of)


def _accuracy_figures(
    collection: Collection, group: str, alignment: str
) -> Sequence[ReportFigure | None]:
    looks = styles(collection)
    figures: list[ReportFigure | None] = [rte_figure(collection, group, looks)]
    for route in collection.of(group)[:MOST_ROUTES]:
        drawn = read_route(collection, route, alignment)
        if drawn is not None:
            figures.append(trajectory_figure(drawn, looks, alignment))
            figures.append(error_figure(drawn, looks, alignment))
    return figures
