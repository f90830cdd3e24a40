"""Methods against the baseline, on pairs of runs of one route and seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from p2gd_fgo.evaluation.bootstrap import MIN_ROUTES, Effect
from p2gd_fgo.evaluation.claims import span
from p2gd_fgo.evaluation.measures import Measure, counts, measure
from p2gd_fgo.evaluation.paired import ASKED_CHANGE, ASKED_POWER, Comparison, Needed
from p2gd_fgo.evaluation.record_pairs import (
    Choice,
    RecordPairs,
    compare_records,
    pair_records,
    select,
)
from p2gd_fgo.report.layout import NONE, decimals
from p2gd_fgo.report.pages.collection import Baseline, Collection, Method, counterparts
from p2gd_fgo.report.pages.measures import rte_lengths
from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    Part,
    ReportTable,
    count,
    measured,
    number,
    words,
)
from p2gd_fgo.report.pairing import across_seeds
from p2gd_fgo.report.statements import Statement, sentences
from p2gd_fgo.run_record import RunRecord

_EXPLAINING = ("mean_length", "total_parallax", "features", "frame_ms")
_SEEDS_ASKED = 3
_METHODS_IN_WORDS = 3
_NEEDED = (
    f"Routes needed: to show a change of {100 * ASKED_CHANGE:+.0f} % with "
    f"{100 * ASKED_POWER:.0f} % power and {{}} each."
).replace("-", "−")
_MANY = "Many intervals stand here: of twenty without any effect one excludes zero by chance."


@dataclass(frozen=True, slots=True)
class Compared:
    """One measure of a method against its counterpart; ``alone``: keys of runs without a pair."""

    base: Method
    method: Method
    measure: Measure
    found: Comparison
    alone: frozenset[str]


def compare_group(
    collection: Collection, group: str, baseline: Baseline, alignment: str
) -> list[Compared]:
    """Every method of a group against its counterpart, measure by measure."""
    records = [e.record for e in collection.entries if e.record.group == group]
    lengths = rte_lengths(records)
    keys = (
        f"ate_{alignment}", f"are_{alignment}", *(f"rte_{n:g}" for n in lengths), *_EXPLAINING
    )  # fmt: skip
    methods = collection.methods_of(group)
    sides_of = [(base, m) for m in methods for base in counterparts(collection, m, baseline)]
    out = []
    for base, method in sides_of:
        if base not in methods:
            continue
        sides = collection.choice(base), collection.choice(method)
        across = across_seeds(records, *sides)
        pairs = pair_records(records, *sides, across=across)
        alone = _without_pair(records, sides, pairs)
        for key in keys if pairs.pairs else ():
            chosen = measure(key)
            fitting = _fitting(records, chosen)
            routes = {record.route for record in fitting}
            found_in = [
                any(math.isfinite(chosen.of(r)) for r in side if r.route in routes)
                for side in zip(*pairs.pairs, strict=True)
            ]
            # A trajectory made elsewhere has no tracks and no times, which is no failure.
            if all(found_in) or (any(found_in) and key not in _EXPLAINING):
                found = compare_records(fitting, *sides, chosen, across=across)
                out.append(Compared(base, method, chosen, found.overall, alone))
    return out


def _without_pair(
    records: Sequence[RunRecord], sides: Sequence[Choice], pairs: RecordPairs
) -> frozenset[str]:
    paired = {record.key for pair in pairs.pairs for record in pair}
    return frozenset(r.key for side in sides for r in select(records, side)) - paired


def _fitting(records: Sequence[RunRecord], chosen: Measure) -> list[RunRecord]:
    """Runs of the routes on which the measure can be: a short one has no RTE at 200 m.

    A route where no run counts stays: its runs are failures, not too short.
    """
    counting = {record.route for record in records if counts(record)}
    known = {record.route for record in records if math.isfinite(chosen.of(record))}
    return [record for record in records if record.route not in counting - known]


def claims(collection: Collection, compared: Sequence[Compared]) -> list[str]:
    """What may be said of accuracy; of ATE alone where methods are many."""
    several = len({c.method for c in compared}) > _METHODS_IN_WORDS
    return sentences(
        [
            Statement(
                collection.against(each.method, each.base),
                each.measure.label,
                each.found,
                "rms",
                (collection.name(each.base), collection.name(each.method)),
            )
            for each in compared
            if each.measure.name.startswith("ate" if several else ("ate", "are", "rte"))
        ]
    )


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
        "a difference is shown where it excludes zero, and where runs are missing also with the "
        "worst run in their place. p: Wilcoxon's signed-rank test on the sequences' means."
    )
    alone = len({key for each in compared for key in each.alone})
    notes = [f"{alone} runs have no partner on some other side."] if alone else []
    if any(c.found.routes >= MIN_ROUTES for c in compared):
        asked = {_seeds_asked(c.found.needed) for c in compared if c.found.needed}
        seeds = " or ".join(f"{n} seed{'s' * (n > 1)}" for n in sorted(asked, reverse=True))
        notes += [_NEEDED.format(seeds)] if asked else []
        notes += [_MANY]
    return ReportTable(
        "paired", "Paired comparison", caption, columns, tuple(rows), notes=tuple(notes)
    )


def _row(collection: Collection, each: Compared) -> tuple[Cell, ...]:
    found = each.found
    shown = decimals([found.a.rms, found.b.rms])
    missing = found.pairs - found.whole
    needed = found.needed
    routes = needed.routes[_seeds_asked(needed)] if needed else None
    better = 100.0 * found.better_share if found.better_share is not None else math.nan
    p = found.p_value
    return (
        words(collection.against(each.method, each.base)),
        words(_with_unit(each.measure)),
        Cell(count(found.whole).parts, f"{missing} missing" if missing else ""),
        count(found.routes),
        Cell((measured(found.a.rms, shown),)),
        Cell((measured(found.b.rms, shown),)),
        change_cell(found.effects.get("rms")),
        change_cell(found.effects.get("mean")),
        Cell((Part(f"{p:.3f}" if p >= 0.001 else "< 0.001", p),)) if p is not None else words(NONE),
        Cell((number(better, 0),)),
        Cell((Part(str(routes), float(routes)),)) if routes else words(NONE),
    )


def _seeds_asked(needed: Needed) -> int:
    """One, where no route had more than one pair: what seeds add isn't known then."""
    return _SEEDS_ASKED if _SEEDS_ASKED in needed.routes else 1


def _with_unit(chosen: Measure) -> str:
    return f"{chosen.label} [{chosen.unit}]" if chosen.unit else chosen.label


def change_cell(effect: Effect | None) -> Cell:
    """The change with its interval, which below 3 routes there isn't."""
    if effect is None:
        return words(NONE)
    if not math.isfinite(effect.low):
        text = f"{span(effect).partition('[')[0].strip()}, no interval"
    elif effect.kind == "difference":
        text = _difference(effect)
    else:
        text = span(effect)
    return Cell((Part(text, effect.change),))


def _difference(effect: Effect) -> str:
    """With two digits of the interval's half width, and no end that only looks like zero."""
    ends = [abs(end) for end in (effect.low, effect.high) if end]
    half = 0.5 * (effect.high - effect.low)
    shown = [decimals([size]) - less for size, less in ((half, 1), (min(ends, default=half), 2))]
    change, low, high = (
        number(value, max(*shown, 0), sign=True).text
        for value in (effect.change, effect.low, effect.high)
    )
    return f"{change} [{low}, {high}]"
