"""The paper's tables of any runs: a row for each route, a column for each method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from p2gd_fgo.evaluation.tracking_quality import LENGTHS
from p2gd_fgo.report.pages.collection import (
    Baseline,
    Collection,
    Method,
    Route,
    Value,
    counterpart,
)
from p2gd_fgo.report.pages.measures import (
    FRAME,
    STAGES,
    cpu,
    metric,
    relative,
    rte_lengths,
    tracking,
)
from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    ReportTable,
    decimals,
    mean,
    number,
    rms,
    words,
)
from p2gd_fgo.report.tables import ALIGNMENT_MEANING

_PAIRS_SHOWN = 3
_SHORTEST_M = 10.0
_Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Measures:
    """What the cells of a table hold: ``ARE °``, ``ATE m`` and where they come from."""

    names: tuple[str, ...]
    values: tuple[Value, ...]


class _Grid:
    """Means over the seeds by route and method, and their RMS over the routes."""

    def __init__(self, collection: Collection, group: str, measures: Measures) -> None:
        self.routes, self.methods = collection.of(group), collection.methods_of(group)
        self.collection, self.measures = collection, measures
        self.means: dict[tuple[Route, Method], _Numbers] = {
            (route, method): tuple(
                mean(collection.values(route, method, value)) for value in measures.values
            )
            for route in self.routes
            for method in self.methods
        }
        self.whole = [
            route
            for route in self.routes
            if all(math.isfinite(v) for m in self.methods for v in self.means[route, m])
        ]
        count = len(measures.names)
        self.rms: dict[Method, _Numbers] = {
            method: tuple(rms([self.means[r, method][k] for r in self.whole]) for k in range(count))
            for method in self.methods
        }
        self.decimals = [
            decimals(numbers[k] for numbers in self.means.values()) for k in range(count)
        ]

    @property
    def empty(self) -> bool:
        return not any(math.isfinite(v) for numbers in self.means.values() for v in numbers)

    def cell(self, numbers: _Numbers, mark: str = "") -> Cell:
        parts = zip(numbers, self.decimals, strict=True)
        return Cell(tuple(number(v, d) for v, d in parts), mark)

    def mean_cell(self, route: Route, method: Method) -> Cell:
        return self.cell(self.means[route, method], mark(self.collection, route, method))

    def difference(self, a: _Numbers, b: _Numbers) -> Cell:
        parts = zip(a, b, self.decimals, strict=True)
        return Cell(tuple(number(x - y, d, sign=True) for x, y, d in parts))

    @property
    def rms_name(self) -> str:
        some = len(self.whole) < len(self.routes)
        return f"RMS ({len(self.whole)} of {len(self.routes)})" if some else "RMS"


def mark(collection: Collection, route: Route, method: Method) -> str:
    """``2/3`` where only so many of the runs count."""
    records = [entry.record for entry in collection.runs(route, method)]
    counting = sum(map(collection.counts, records))
    return f"{counting}/{len(records)}" if counting < len(records) else ""


def absolute_table(
    collection: Collection, group: str, baseline: Baseline | None, alignment: str
) -> ReportTable | None:
    """ARE and ATE (paper Tables III and VI); None where no run has truth."""
    measures = Measures(
        ("ARE °", "ATE m"),
        (
            lambda record: metric(record, "are_deg", alignment, "rmse"),
            lambda record: metric(record, "ate_m", alignment, "rmse"),
        ),
    )
    grid = _Grid(collection, group, measures)
    title = "Absolute pose error"
    aligned = f"RMSE, aligned by {alignment} ({ALIGNMENT_MEANING[alignment]})"
    return _by_method("absolute", title, aligned, grid, baseline, "decrease")


def tracking_table(
    collection: Collection, group: str, baseline: Baseline | None
) -> ReportTable | None:
    """Track length and parallax (paper Tables I and IV)."""
    measures = Measures(
        ("length images", "two-view °", "total °"),
        (
            lambda record: tracking(record, "mean_length"),
            lambda record: tracking(record, "two_view_parallax_deg"),
            lambda record: tracking(record, "total_parallax_deg"),
        ),
    )
    grid = _Grid(collection, group, measures)
    what = "Mean length and parallax of all tracks, rotation taken out"
    return _by_method("tracking", "Tracking quality", what, grid, baseline, "increase")


def per_image_table(collection: Collection, group: str) -> ReportTable | None:
    """Features and parallax per image, which the paper's means by track hide."""
    measures = Measures(
        ("features", "parallax °", "tracks ≥ 10"),
        (
            lambda record: tracking(record, "features_per_frame"),
            lambda record: tracking(record, "total_parallax_per_frame_deg"),
            lambda record: tracking(record, "tracks_10_per_frame"),
        ),
    )
    grid = _Grid(collection, group, measures)
    what = "Features, parallax and tracks that reached 10 images, each over the number of images"
    return _by_method("per_image", "Tracking per image", what, grid, None, "")


def lengths_table(collection: Collection, group: str) -> ReportTable | None:
    """Shares of the tracks with some lengths (paper Tables II and V)."""

    def share(length: int) -> Value:
        return lambda record: 100.0 * tracking(record, "length_shares", str(length))

    grids = [_Grid(collection, group, Measures(("%",), (share(n),))) for n in LENGTHS]
    heads = [Column(f"{n} image{'s' if n > 1 else ''}") for n in LENGTHS]
    what = "Percent of all tracks that were seen in exactly so many images"
    return _by_length("lengths", "Tracks by length", what, grids, heads, None)


def relative_table(
    collection: Collection, group: str, baseline: Baseline | None
) -> ReportTable | None:
    """RRE and RTE by length (paper Table VII)."""

    def of(length: float, what: str) -> Value:
        return lambda record: relative(record, length, what)

    lengths = rte_lengths([e.record for e in collection.entries if e.record.group == group])
    grids = [
        _Grid(
            collection,
            group,
            Measures(("RRE °", "RTE %"), (of(length, "rre_deg"), of(length, "percent"))),
        )
        for length in lengths
    ]
    heads = [Column(f"{length:g} m", ("RRE °", "RTE %")) for length in lengths]
    what = "RMSE over all pairs of poses so far apart on the truth, which needs no alignment"
    return _by_length("relative", "Relative pose error", what, grids, heads, baseline)


def runtime_table(collection: Collection, group: str) -> ReportTable | None:
    """CPU per image and stage (paper Table IX)."""
    stages = [s for s in STAGES if any(s in e.record.cpu_ms for e in collection.entries)]
    grids = [
        _Grid(collection, group, Measures(("ms",), (cpu(stage),))) for stage in (*stages, FRAME)
    ]
    heads = [Column(name) for name in (*stages, "whole frame")]
    what = "Median process CPU in ms, reading the image left out"
    return _by_length("runtime", "Runtime per image", what, grids, heads, None)


def _by_method(
    key: str, title: str, what: str, grid: _Grid, baseline: Baseline | None, change: str
) -> ReportTable | None:
    """Rows are routes, columns methods; beside them the change against the baseline."""
    if grid.empty:
        return None
    collection, names = grid.collection, grid.measures.names
    pairs = _pairs(collection, grid.methods, baseline)
    sign = 1 if change == "decrease" else -1

    def row(head: str, cells: list[Cell], numbers: Mapping[Method, _Numbers]) -> tuple[Cell, ...]:
        changes = [
            grid.difference(*((numbers[base], numbers[other])[::sign])) for base, other in pairs
        ]
        return (words(head), *cells, *changes)

    rows = []
    for route in grid.routes:
        cells = [grid.mean_cell(route, method) for method in grid.methods]
        means = {method: grid.means[route, method] for method in grid.methods}
        rows.append(row(route.name, cells, means))
    overall = row(grid.rms_name, [grid.cell(grid.rms[m]) for m in grid.methods], grid.rms)
    changed = [change if len(pairs) == 1 else f"{change}, {collection.name(m)}" for _, m in pairs]
    columns = (
        Column("sequence", numeric=False),
        *(Column(collection.name(method), names) for method in grid.methods),
        *(Column(name, names) for name in changed),
    )
    return ReportTable(
        key, title, _caption(what, grid), columns, tuple(rows),
        (overall,) if len(grid.routes) > 1 else (), _notes(rows),
    )  # fmt: skip


def _by_length(
    key: str,
    title: str,
    what: str,
    grids: Sequence[_Grid],
    heads: Sequence[Column],
    baseline: Baseline | None,
) -> ReportTable | None:
    """Rows are routes and methods, columns lengths, stages and the like."""
    shown = [(g, h) for g, h in zip(grids, heads, strict=True) if not g.empty]
    if not shown:
        return None
    grid = shown[0][0]
    collection = grid.collection
    rows = [
        (
            words(route.name),
            words(collection.name(method)),
            *(g.mean_cell(route, method) for g, _ in shown),
        )
        for route in grid.routes
        for method in grid.methods
        if collection.runs(route, method)
    ]
    summary = [
        (words("RMS"), words(collection.name(m)), *(g.cell(g.rms[m]) for g, _ in shown))
        for m in grid.methods
    ]
    for base, other in _pairs(collection, grid.methods, baseline):
        cells = [g.difference(g.rms[base], g.rms[other]) for g, _ in shown]
        summary.append((words("decrease"), words(collection.name(other)), *cells))
    several = len(grid.routes) > 1
    columns = (Column("sequence", numeric=False), Column("method", numeric=False))
    return ReportTable(
        key, title, _caption(what, grid), (*columns, *(h for _, h in shown)), tuple(rows),
        tuple(summary) if several else (), _notes(rows),
    )  # fmt: skip


def _pairs(
    collection: Collection, methods: Sequence[Method], baseline: Baseline | None
) -> list[tuple[Method, Method]]:
    """Baseline's method and the other; none where they would be too many to read."""
    if baseline is None:
        return []
    found = [(counterpart(collection, method, baseline), method) for method in methods]
    pairs = [(base, method) for base, method in found if base in methods and base is not None]
    return pairs if len(pairs) <= _PAIRS_SHOWN else []


def _caption(what: str, grid: _Grid) -> str:
    collection = grid.collection
    seeds = [len(collection.runs(r, m)) for r in grid.routes for m in grid.methods]
    runs = [n for n in seeds if n]
    each = f"{min(runs)}" if min(runs) == max(runs) else f"{min(runs)} to {max(runs)}"
    text = f"{what}. {sum(runs)} runs, {each} of each method on each sequence"
    if max(runs) == 1:
        return f"{text}: a difference may be chance."
    return f"{text}; each cell is the mean of those that count."


def _notes(rows: Sequence[Sequence[Cell]]) -> tuple[str, ...]:
    if any(cell.mark for row in rows for cell in row):
        return ("(2/3): so many of the runs count; the number is of these alone.",)
    return ()
