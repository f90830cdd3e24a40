"""The tables of a study in a terminal: what every label gave, and what may be said of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Console, Group, RenderableType
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.claims import span
from p2gd_fgo.evaluation.measures import Measure, counts, measure
from p2gd_fgo.evaluation.record_pairs import Contrast, compare_records, select
from p2gd_fgo.report.layout import NONE, decimals, fitting, fixed, natural, places
from p2gd_fgo.report.pairing import across_seeds
from p2gd_fgo.report.statements import Statement, sentences
from p2gd_fgo.run_record import Label, RunRecord

TABLE_MEASURES = ("ate", "ate_origin", "are", "rte_10")
_DISPENSABLE = ("rte_10", "ate_origin", "are")  # where they don't fit, in this order

FULL_WIDTH = 100
_CLAIMED = ("ate", "are")
_MOST_COLUMNS = 6


@dataclass(frozen=True, slots=True)
class _Block:
    """Runs of one group that differ in the compared axis, route and seed alone.

    Trajectories made elsewhere have no label on the other axes: they are in every block.
    """

    group: str
    rest: dict[str, Label]
    records: list[RunRecord]

    @property
    def title(self) -> str:
        return " · ".join([self.group, *(f"{name} {label}" for name, label in self.rest.items())])


_Contrasts = dict[tuple[Label, str], Contrast | None]
"""By label and measure; None: no run of one of the two yet."""


def study_table(
    records: Sequence[RunRecord], axis: str, baseline: Label, width: int = FULL_WIDTH
) -> RenderableType:
    """One block for each group and each label on the axes that are not compared.

    Parameters
    ----------
    records
        Of one study.
    axis, baseline
        What is compared, and with what.
    width
        Of the terminal; where it is too small for all measures, the last ones are left out.
    """
    measures = [measure(name) for name in TABLE_MEASURES]
    compared = [_compared(block, axis, baseline, measures) for block in _blocks(records, axis)]
    wide = Console(width=10 * FULL_WIDTH)
    for count in range(len(_DISPENSABLE) + 1):
        shown = [m for m in measures if m.name not in _DISPENSABLE[:count]]
        tables = [_table(each, axis, shown) for each in compared]
        if all(wide.measure(table).maximum <= width for table in tables):
            break
    parts: list[RenderableType] = []
    statements: list[Statement] = []
    for (block, _, contrasts), table in zip(compared, tables, strict=True):
        parts += ["", Text(block.title, style="italic"), table]
        for (label, name), found in contrasts.items():
            if found is not None and name in _CLAIMED:
                about = f"{block.title}, {label} against {baseline}"
                sides = (str(baseline), str(label))
                statements.append(
                    Statement(about, found.measure.label, found.overall, "mean", sides)
                )
    by_route = _route_table(records, measures[0])
    if by_route is not None:
        heading = f"{measures[0].label} {measures[0].unit} by route, mean over seeds"
        parts = ["", Text(heading, style="italic"), by_route, *parts]
    return Group(
        Rule(Text(f"{axis}, compared with {baseline}"), align="left", style="dim"),
        Text(_legend(records), style="dim"),
        *parts,
        *(Text(f"• {line}") for line in sentences(statements)),
    )


def _blocks(records: Sequence[RunRecord], axis: str) -> Iterator[_Block]:
    others = sorted({name for r in records for name in r.axes} - {axis, "seed"})
    for group in dict.fromkeys(record.group for record in records):
        held = [record for record in records if record.group == group]
        seen = [
            list(dict.fromkeys(r.axes[name] for r in held if name in r.axes)) for name in others
        ]
        for labels in itertools.product(*seen):
            rest = dict(zip(others, labels, strict=True))
            if select(held, rest):
                fits = {name: {None, label} for name, label in rest.items()}
                chosen = [r for r in held if all(r.axes.get(n) in fits[n] for n in others)]
                yield _Block(group, rest, chosen)


def _labels(records: Sequence[RunRecord], axis: str, baseline: Label) -> list[Label]:
    """Labels on the axis, the baseline first."""
    return list(dict.fromkeys([baseline, *(record.axes[axis] for record in records)]))


def _contrast(
    block: _Block, axis: str, baseline: Label, label: Label, chosen: Measure
) -> Contrast | None:
    """The label against the baseline; a trajectory made elsewhere against all of its seeds."""
    a, b = {axis: baseline, **block.rest}, {axis: label}
    across = across_seeds(block.records, a, b)
    try:
        return compare_records(block.records, a, b, chosen, across=across)
    except ConfigError:  # no run of one of the two yet
        return None


def _compared(
    block: _Block, axis: str, baseline: Label, measures: Sequence[Measure]
) -> tuple[_Block, list[Label], _Contrasts]:
    labels = _labels(block.records, axis, baseline)
    return (
        block,
        labels,
        {
            (label, m.name): _contrast(block, axis, baseline, label, m)
            for label in labels[1:]
            for m in measures
        },
    )


def _table(
    compared: tuple[_Block, list[Label], _Contrasts], axis: str, measures: Sequence[Measure]
) -> Table:
    block, labels, contrasts = compared
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(Text(axis), min_width=max(len(axis), *(len(str(label)) for label in labels)))
    table.add_column("runs", justify="right", no_wrap=True)
    for m in measures:
        table.add_column(f"{m.label} {m.unit}", justify="right", no_wrap=True)
    chosen = {label: select(block.records, {axis: label}) for label in labels}
    values = {m.name: fitting([_mean(chosen[label], m) for label in labels]) for m in measures}
    for k, label in enumerate(labels):
        runs = chosen[label]
        cells: list[Text | str] = [Text(str(label)), f"{sum(map(counts, runs))}/{len(runs)}"]
        for m in measures:
            found = contrasts.get((label, m.name))
            effect = found.overall.effects.get("mean") if found else None
            said = span(effect).removesuffix(" [?, ?]") if effect else ""
            change = Text(f"\n{said}" if said else "", style="dim")
            cells.append(Text.assemble(values[m.name][k], change))
        table.add_row(*cells)
    return table


def _route_table(records: Sequence[RunRecord], chosen: Measure) -> Table | None:
    """One row for each route, one column for each way of running; None where these are too many."""
    names = sorted({name for record in records for name in record.axes} - {"seed"})
    ways = list(dict.fromkeys(tuple(r.axes.get(name, NONE) for name in names) for r in records))
    if len(ways) > _MOST_COLUMNS:
        return None
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("route", min_width=max(len(record.route) for record in records))
    for way in ways:
        table.add_column(Text("\n".join(map(str, way))), justify="right")
    for group in dict.fromkeys(record.group for record in records):
        held = [record for record in records if record.group == group]
        means = {
            route: [
                _mean(_of([r for r in held if r.route == route], names, way), chosen)
                for way in ways
            ]
            for route in sorted({record.route for record in held}, key=natural)
        }
        shown = decimals(value for row in means.values() for value in row)
        for route, row in means.items():
            table.add_row(Text(route), *(fixed(v, places(v, shown)) for v in row))
        table.add_section()
    return table


def _of(
    records: Sequence[RunRecord], names: Sequence[str], way: Sequence[Label]
) -> list[RunRecord]:
    return [r for r in records if tuple(r.axes.get(name, NONE) for name in names) == tuple(way)]


def _mean(runs: Sequence[RunRecord], chosen: Measure) -> float:
    """Mean over the routes of the means over their seeds."""
    means = []
    for route in dict.fromkeys(run.route for run in runs):
        values = [chosen.of(run) for run in runs if run.route == route]
        known = [value for value in values if math.isfinite(value)]
        means += [sum(known) / len(known)] if known else []
    return sum(means) / len(means) if means else math.nan


def _legend(records: Sequence[RunRecord]) -> str:
    alignments = sorted({str(r.metrics["alignment"]) for r in records if "alignment" in r.metrics})
    return (
        f"RMSE of each run, main alignment {', '.join(alignments) or NONE}; means over routes of "
        "their seeds, below them the change with its 95 % interval (from 3 routes on); a run that "
        "failed, or that saw less than 90 % of the images, counts in 'runs' alone"
    )
