"""Where the error is made: pieces of the way beside what happened there, method by method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.episodes import (
    EpisodeRow,
    SegmentPair,
    compare_episodes,
    largest,
    pair_segments,
)
from p2gd_fgo.evaluation.measures import counts
from p2gd_fgo.evaluation.record_pairs import pair_records
from p2gd_fgo.evaluation.run_segments import run_segments
from p2gd_fgo.evaluation.segments import Segment
from p2gd_fgo.report.layout import decimals
from p2gd_fgo.report.pages.collection import Baseline, Collection, Method, counterpart
from p2gd_fgo.report.pages.comparison import change_cell
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

_BESIDE = {"features": "features", "tracks_10": "tracks ≥ 10", "far": "far", "gated": "gated"}
_LARGEST = 5
_SIDES = ("before", "after")


@dataclass(frozen=True, slots=True)
class ComparedPieces:
    """The pieces of the way that a method and its counterpart both cover."""

    name: str
    pairs: tuple[SegmentPair, ...]


def compare_pieces(collection: Collection, group: str, baseline: Baseline) -> list[ComparedPieces]:
    """Pair the pieces of every method with its counterpart's, of the runs that count.

    Pieces are those of the record, or taken from the run directory where it was kept.
    """
    entries = [entry for entry in collection.entries if entry.record.group == group]
    methods = collection.methods_of(group)
    known: dict[str, tuple[Segment, ...]] = {}
    by_key = {entry.record.key: entry for entry in entries}
    out = []
    for method in methods:
        base = counterpart(collection, method, baseline)
        if base is None or base not in methods:
            continue
        found: list[SegmentPair] = []
        for a, b in _runs(collection, entries, base, method):
            for key in (a, b):
                if key not in known:
                    known[key] = _pieces(by_key[key])
            found += pair_segments(known[a], known[b], by_key[a].record.route)
        if found:
            out.append(ComparedPieces(collection.against(method, base), tuple(found)))
    return out


def episode_table(compared: Sequence[ComparedPieces]) -> ReportTable | None:
    """One row for each kind of piece; None without any."""
    measures = [m for m in _BESIDE if any(m in p.a.measures for c in compared for p in c.pairs)]
    rows = [_row(c.name, row, measures) for c in compared for row in compare_episodes(c.pairs)]
    if not rows:
        return None
    columns = (
        Column("compared", numeric=False),
        Column("what happens", numeric=False),
        Column("pieces"),
        Column("routes"),
        Column("difference %"),
        Column("rotation °", secondary=True),
        Column("part"),
        Column("error %", _SIDES),
        *(Column(_BESIDE[name], _SIDES, secondary=True) for name in measures),
    )
    caption = (
        "The way in pieces of 10 m, by what happens in them: standing still for a tenth of the "
        "time, turning by 2° a metre, moving objects over 2 % of the image, or none of it. Error: "
        "of the motion over a piece, in percent of its length; no alignment."
    )
    notes = (
        "Difference: of the mean errors, with its 95 % interval. Part: share of these pieces in "
        "the change of the mean square error; the parts add up to that of all.",
        "Below 3 routes an interval resamples the pieces and speaks of these recordings alone.",
        "Features, tracks seen in 10 images or more, those of them beyond 60 m, and observations "
        "that the gates rejected: means per image.",
    )
    return ReportTable("episodes", "By what happens", caption, columns, tuple(rows), notes=notes)


def largest_table(compared: Sequence[ComparedPieces]) -> ReportTable | None:
    """The pieces whose errors differ most; None without any."""
    found = [(each.name, pair) for each in compared for pair in largest(each.pairs, _LARGEST)]
    if not found:
        return None
    shown = decimals([v for _, p in found for v in (p.a.translation_m, p.b.translation_m)])
    rows = [
        (
            words(name),
            words(pair.route),
            Cell((number(pair.a.start_m, 0),)),
            Cell((number(pair.a.start_s, 0),)),
            words(pair.kind),
            Cell((number(pair.a.turn_deg, 0),)),
            Cell((measured(pair.a.translation_m, shown),)),
            Cell((measured(pair.b.translation_m, shown),)),
        )
        for name, pair in found
    ]
    columns = (
        Column("compared", numeric=False),
        Column("sequence", numeric=False),
        Column("from m"),
        Column("at s"),
        Column("what happens", numeric=False),
        Column("turn °"),
        Column("error before m"),
        Column("error after m"),
    )
    caption = f"The {_LARGEST} pieces of each comparison whose squared errors differ most."
    return ReportTable("pieces", "Pieces that differ most", caption, columns, tuple(rows))


def _row(name: str, row: EpisodeRow, measures: Sequence[str]) -> tuple[Cell, ...]:
    def both(key: str) -> Cell:
        sides = [side.get(key, float("nan")) for side in (row.a, row.b)]
        shown = decimals(sides)
        return Cell(tuple(measured(value, shown) for value in sides))

    return (
        words(name),
        words(row.kind),
        count(row.pieces),
        count(row.routes),
        change_cell(row.translation),
        change_cell(row.rotation),
        Cell((Part(f"{number(100 * row.part, 0, sign=True).text} %", row.part),)),
        both("translation_percent"),
        *map(both, measures),
    )


def _runs(
    collection: Collection, entries: Sequence[Entry], base: Method, method: Method
) -> list[tuple[str, str]]:
    records = [entry.record for entry in entries]
    found = pair_records(records, collection.choice(base), collection.choice(method))
    return [(a.key, b.key) for a, b in found.pairs if counts(a) and counts(b)]


def _pieces(entry: Entry) -> tuple[Segment, ...]:
    if entry.record.segments is not None:
        return tuple(map(Segment.from_json, entry.record.segments))
    if entry.folder is None:
        return ()
    try:
        return run_segments(entry.folder)
    except DataError:  # a run from before frames.csv, or without truth: it has no pieces
        return ()
