"""The head of a report: what was run, what went wrong; and the table of all runs."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from p2gd_fgo.evaluation.measures import WHOLE_RUN, counts, measure
from p2gd_fgo.report.layout import decimals
from p2gd_fgo.report.pages.collection import Baseline, Collection
from p2gd_fgo.report.pages.links import relative_url
from p2gd_fgo.report.pages.measures import FRAME, completeness, cpu
from p2gd_fgo.report.pages.sources import Entry
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
from p2gd_fgo.report.tables import ALIGNMENT_MEANING
from p2gd_fgo.run_record import RunRecord

_NAMES_SHOWN = 12
_LINES_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Alarm:
    """What a reader must see before any number."""

    title: str
    lines: tuple[str, ...]


def facts(
    collection: Collection, baseline: Baseline | None, alignment: str
) -> list[tuple[str, str]]:
    """What was run: name and value."""
    records = [entry.record for entry in collection.entries]
    states = Counter(sorted((r.status for r in records), key=lambda s: (s != "done", s)))
    share = [v for r in records if math.isfinite(v := completeness(r))]
    found = [
        ("runs", _states(states)),
        ("methods", _listed([collection.name(m) for m in collection.methods])),
        ("sequences", _listed([route.name for route in collection.routes])),
        ("seeds", _listed(sorted({record.seed for record in records}))),
        ("same in all runs", ", ".join(f"{k} {v}" for k, v in _shared(collection))),
        ("alignment", f"{alignment} ({ALIGNMENT_MEANING[alignment]}); RTE needs none"),
        ("compared with", f"{baseline.axis} {baseline.label}" if baseline else "nothing"),
        ("completeness", _completeness(share)),
        ("versions", _versions(records)),
    ]
    return [(name, value) for name, value in found if value]


def _states(states: Mapping[Any, int]) -> str:
    text = ", ".join(f"{n} {state}" for state, n in states.items())
    return text if len(states) == 1 else f"{sum(states.values())}: {text}"


def alarms(collection: Collection, remarks: Sequence[str]) -> list[Alarm]:
    """Runs that did not end well, that stopped early, that can't be compared."""
    records = [entry.record for entry in collection.entries]
    ended = [r for r in records if r.status != "done"]
    done = [record for record in records if record.status == "done"]
    short = [record for record in done if not counts(record)]
    blind = [record for record in done if not record.metrics.get("ate_m")]
    codes = {r.code for r in records if r.code}
    versions = {tuple(sorted(r.versions.items())) for r in records if r.versions}
    found = [
        _alarm(
            f"{len(ended)} of {len(records)} runs are not done",
            (f"{_who(collection, r)}: {r.status}: {r.reason}" for r in ended),
        ),
        _alarm(
            f"{len(short)} of {len(records)} runs have an estimate for fewer than "
            f"{100 * WHOLE_RUN:.0f} % of the images and don't count",
            (f"{_who(collection, r)}: {100 * completeness(r):.1f} %" for r in short),
        ),
        _alarm(
            f"{len(blind)} of {len(records)} runs have no truth to compare with",
            (_who(collection, record) for record in blind),
        ),
        _alarm("Runs that are not counted", remarks),
    ]
    if len(codes) > 1 or len(versions) > 1:
        what = "versions of the program or its libraries" if len(versions) > 1 else "code"
        found.append(Alarm(f"The runs were made with different {what}", (_versions(records),)))
    return [alarm for alarm in found if alarm is not None]


def runs_table(collection: Collection, alignment: str, page: Path) -> ReportTable:
    """One row for each run, with a link to its folder from ``page``."""
    entries = sorted(
        collection.entries,
        key=lambda e: (
            [(r.group, r.name) for r in collection.routes].index((e.record.group, e.record.route)),
            collection.methods.index(collection.method(e.record)),
            e.record.seed,
        ),
    )
    records = [entry.record for entry in entries]
    ate = [measure(f"ate_{alignment}").read(r) for r in records]
    are = [measure(f"are_{alignment}").read(r) for r in records]
    frame = [cpu(FRAME).read(r) for r in records]
    shown = decimals(ate), decimals(are), decimals(frame)
    several = len(collection.groups) > 1
    reasons = any(record.reason for record in records)
    rows = []
    for entry, record, *numbers in zip(entries, records, ate, are, frame, strict=True):
        cells = [Cell((measured(v, d),)) for v, d in zip(numbers, shown, strict=True)]
        share = number(100.0 * completeness(record), 1)
        rows.append(
            (
                words(record.sequence),
                *([words(record.group)] if several else []),
                words(collection.name(collection.method(record))),
                count(record.seed),
                *cells[:2],
                Cell((share,)),
                cells[2],
                words(record.status if record.status == "done" else record.status.upper()),
                _link(entry, page),
                *([words(record.reason or "")] if reasons else []),
            )
        )
    columns = (
        Column("sequence", numeric=False),
        *([Column("group", numeric=False)] if several else []),
        Column("method", numeric=False),
        Column("seed"),
        Column("ATE m"),
        Column("ARE °"),
        Column("images %"),
        Column("frame ms"),
        Column("status", numeric=False),
        Column("folder", numeric=False),
        *([Column("reason", numeric=False)] if reasons else []),
    )
    caption = (
        f"ATE and ARE: RMSE, aligned by {alignment} ({ALIGNMENT_MEANING[alignment]}); images: "
        "share with an estimate; frame: median CPU."
    )
    return ReportTable("runs", "All runs", caption, columns, tuple(rows))


def _link(entry: Entry, page: Path) -> Cell:
    if entry.folder is None:
        return words("not kept")
    name = os.path.relpath(entry.folder.resolve(), page.resolve().parent)
    return Cell((Part(name, name, relative_url(entry.folder, page)),))


def _who(collection: Collection, record: RunRecord) -> str:
    method = collection.name(collection.method(record))
    return f"{record.sequence}, {method}, seed {record.seed}"


def _alarm(title: str, lines: Iterable[str]) -> Alarm | None:
    known = list(lines)
    if not known:
        return None
    shown = known[:_LINES_SHOWN]
    if len(known) > len(shown):
        shown.append(f"and {len(known) - len(shown)} more")
    return Alarm(title, tuple(shown))


def _listed(names: Sequence[object]) -> str:
    known = list(dict.fromkeys(map(str, names)))
    text = ", ".join(known[:_NAMES_SHOWN])
    more = len(known) - _NAMES_SHOWN
    text += f" and {more} more" if more > 0 else ""
    return f"{len(known)}: {text}"


def _shared(collection: Collection) -> list[tuple[str, object]]:
    fixed = [
        (collection.axes[k], collection.methods[0][k])
        for k in range(len(collection.axes))
        if k not in collection.varying and len(collection.methods) > 1
    ]
    return [*fixed, *collection.shared.items()]


def _completeness(shares: Sequence[float]) -> str:
    if not shares:
        return ""
    low, middle = 100.0 * min(shares), 100.0 * sorted(shares)[len(shares) // 2]
    if f"{low:.1f}" == "100.0":
        return "an estimate for every image in every run"
    return f"median {middle:.1f} %, lowest {low:.1f} % of the images have an estimate"


def _versions(records: Sequence[RunRecord]) -> str:
    names = dict.fromkeys(name for record in records for name in record.versions)
    known = {
        name: list(dict.fromkeys(r.versions[name] for r in records if name in r.versions))
        for name in names
    }
    text = ", ".join(f"{name} {' and '.join(found)}" for name, found in known.items())
    codes = list(dict.fromkeys(record.code for record in records if record.code))
    return text + (f"; code {' and '.join(code[:10] for code in codes)}" if codes else "")
