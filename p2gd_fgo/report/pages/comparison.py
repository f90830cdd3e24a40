"""Methods against the baseline, on pairs of runs of one route and seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.evaluation.bootstrap import Effect
from p2gd_fgo.evaluation.claims import claim, span
from p2gd_fgo.evaluation.paired import ASKED_CHANGE, ASKED_POWER, Comparison, compare_pairs
from p2gd_fgo.report.layout import NONE
from p2gd_fgo.report.pages.collection import Baseline, Collection, Method, Value, counterpart
from p2gd_fgo.report.pages.measures import FRAME, cpu, metric, relative, rte_lengths, tracking
from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    Part,
    ReportTable,
    count,
    decimals,
    number,
    words,
)

_SEEDS_ASKED = 3
_METHODS_IN_WORDS = 3


@dataclass(frozen=True, slots=True)
class Measure:
    """Something that two runs are compared by; ``lower_is_better`` None where neither way is."""

    name: str
    value: Value
    lower_is_better: bool | None = True


@dataclass(frozen=True, slots=True)
class Compared:
    """One measure of a method against its counterpart."""

    base: Method
    method: Method
    measure: Measure
    found: Comparison


def measures(collection: Collection, group: str, alignment: str) -> list[Measure]:
    """Accuracy first, then what explains it, then its cost."""
    runs = [e.record for e in collection.entries if e.record.group == group]
    return [
        Measure("ATE m", lambda r: metric(r, "ate_m", alignment, "rmse")),
        Measure("ARE °", lambda r: metric(r, "are_deg", alignment, "rmse")),
        *(
            Measure(f"RTE {n:g} m %", lambda r, n=n: relative(r, n, "percent"))  # type: ignore[misc]
            for n in rte_lengths(runs)
        ),
        Measure("track length", lambda r: tracking(r, "mean_length"), None),
        Measure("total parallax °", lambda r: tracking(r, "total_parallax_deg"), None),
        Measure("features per image", lambda r: tracking(r, "features_per_frame"), None),
        Measure("CPU per image ms", cpu(FRAME)),
    ]


def compare_group(
    collection: Collection, group: str, baseline: Baseline, alignment: str
) -> list[Compared]:
    """Every method of a group against its counterpart, measure by measure."""
    out = []
    for method in collection.methods_of(group):
        base = counterpart(collection, method, baseline)
        if base is None:
            continue
        for measure in measures(collection, group, alignment):
            a, b, routes = _pairs(collection, group, base, method, measure.value)
            if any(map(math.isfinite, (*a, *b))):
                found = compare_pairs(
                    np.array(a), np.array(b), routes, lower_is_better=measure.lower_is_better
                )
                out.append(Compared(base, method, measure, found))
    return out


def claims(collection: Collection, compared: Sequence[Compared]) -> list[str]:
    """What may be said of accuracy, a sentence each; of ATE alone where methods are many."""
    several = len({c.method for c in compared}) > _METHODS_IN_WORDS
    said = []
    for each in compared:
        name = each.measure.name
        if name.startswith("ATE" if several else ("ATE", "ARE", "RTE")):
            sides = collection.name(each.base), collection.name(each.method)
            name = f"{collection.against(each.method, each.base)}, {name.rpartition(' ')[0]}"
            text = claim(name, each.found, "rms", sides=sides)
            said.append(f"{text}.")
    return said


def comparison_table(
    collection: Collection, compared: Sequence[Compared], alignment: str
) -> ReportTable | None:
    """One row for each method and measure; None without a pair."""
    rows = [_row(collection, each) for each in compared]
    if not rows:
        return None
    columns = (
        Column("compared", numeric=False),
        Column("measure", numeric=False),
        Column("pairs"),
        Column("routes"),
        Column("RMS before"),
        Column("RMS after"),
        Column("change of the RMS"),
        Column("change of the mean", secondary=True),
        Column("p"),
        Column("better %", secondary=True),
        Column("routes needed", secondary=True),
    )
    level = next((e.level for c in compared for e in c.found.effects.values()), 0.95)
    caption = (
        f"Runs of the same sequence and seed in pairs; ATE and ARE aligned by {alignment}. In "
        f"brackets: {100 * level:.0f} % interval, by resampling sequences, then seeds within them; "
        "a difference is shown where it excludes zero. p: Wilcoxon's signed-rank test on the "
        "sequences' means."
    )
    notes = (
        f"Routes needed: to show a change of {100 * ASKED_CHANGE:+.0f} % with "
        f"{100 * ASKED_POWER:.0f} % power and {_SEEDS_ASKED} seeds each.".replace("-", "−"),
        "Many intervals stand here: of twenty without any effect one excludes zero by chance.",
    )
    return ReportTable("paired", "Paired comparison", caption, columns, tuple(rows), notes=notes)


def _row(collection: Collection, each: Compared) -> tuple[Cell, ...]:
    found = each.found
    places = decimals([found.a.rms, found.b.rms])
    missing = found.pairs - found.whole
    needed = found.needed
    routes = needed.routes.get(_SEEDS_ASKED, needed.routes.get(1)) if needed else None
    better = 100.0 * found.better_share if found.better_share is not None else math.nan
    p = found.p_value
    return (
        words(collection.against(each.method, each.base)),
        words(each.measure.name),
        Cell(count(found.whole).parts, f"{missing} missing" if missing else ""),
        count(found.routes),
        Cell((number(found.a.rms, places),)),
        Cell((number(found.b.rms, places),)),
        _change(found.effects.get("rms"), found.routes),
        _change(found.effects.get("mean"), found.routes),
        Cell((Part(f"{p:.3f}" if p >= 0.001 else "< 0.001", p),)) if p is not None else words(NONE),
        Cell((number(better, 0),)),
        Cell((Part(str(routes), float(routes)),)) if routes else words(NONE),
    )


def _change(effect: Effect | None, routes: int) -> Cell:
    if effect is None:
        return words(NONE)
    if not math.isfinite(effect.low):
        return Cell(
            (Part(f"{100 * effect.change:+.0f} %, no interval".replace("-", "−"), effect.change),)
        )
    return Cell((Part(span(effect), effect.change),))


def _pairs(
    collection: Collection, group: str, base: Method, method: Method, value: Value
) -> tuple[list[float], list[float], list[str]]:
    """Values of both sides, NaN where a run doesn't count, of every seed that either side has."""
    a, b, routes = [], [], []
    for route in collection.of(group):
        sides = []
        for which in (base, method):
            records = [entry.record for entry in collection.runs(route, which)]
            counts = collection.counts
            sides.append({r.seed: value(r) if counts(r) else math.nan for r in records})
        for seed in sorted(set(sides[0]) & set(sides[1])):
            a.append(sides[0][seed])
            b.append(sides[1][seed])
            routes.append(route.name)
    return a, b, routes
