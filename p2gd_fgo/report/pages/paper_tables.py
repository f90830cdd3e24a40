"""The paper's tables of any runs: a row for each route, a column for each method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from p2gd_fgo.evaluation.measures import Measure, counts, measure
from p2gd_fgo.evaluation.tracking_quality import LENGTHS
from p2gd_fgo.report.layout import decimals, places
from p2gd_fgo.report.pages.collection import Baseline, Collection, Method, Route, counterpart
from p2gd_fgo.report.pages.measures import FRAME, STAGES, cpu, length_share, rte_lengths
from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    ReportTable,
    best_of,
    mean,
    measured,
    number,
    rms,
    words,
)
from p2gd_fgo.report.tables import ALIGNMENT_MEANING

_PAIRS_SHOWN = 3
_Numbers = tuple[float, ...]
_Row = tuple[Cell, ...]


class _Grid:
    """Means over the seeds by route and method, and their RMS over the routes."""

    def __init__(self, collection: Collection, group: str, measures: Sequence[Measure]) -> None:
        self.routes, self.methods = collection.of(group), collection.methods_of(group)
        self.collection = collection
        self.means: dict[tuple[Route, Method], _Numbers] = {
            (route, method): tuple(
                mean(collection.values(route, method, measure)) for measure in measures
            )
            for route in self.routes
            for method in self.methods
        }
        known = [m for m in self.methods if any(self._known(route, m) for route in self.routes)]
        self.whole = [r for r in self.routes if all(self._known(r, m) for m in known)]
        self.lower_is_better = [each.lower_is_better for each in measures]
        count = len(measures)
        self.rms: dict[Method, _Numbers] = {
            method: tuple(rms([self.means[r, method][k] for r in self.whole]) for k in range(count))
            for method in self.methods
        }
        self.decimals = [
            decimals(numbers[k] for numbers in self.means.values()) for k in range(count)
        ]

    def _known(self, route: Route, method: Method) -> bool:
        return all(map(math.isfinite, self.means[route, method]))

    @property
    def empty(self) -> bool:
        return not any(math.isfinite(v) for numbers in self.means.values() for v in numbers)

    def cell(self, numbers: _Numbers, mark: str = "") -> Cell:
        parts = zip(numbers, self.decimals, strict=True)
        return Cell(tuple(measured(v, d) for v, d in parts), mark)

    def mean_cell(self, route: Route, method: Method) -> Cell:
        return self.cell(self.means[route, method], mark(self.collection, route, method))

    def difference(self, a: _Numbers, b: _Numbers) -> Cell:
        """With the decimals of the finer of the two, as they are shown."""
        shown = [
            max(places(x, d), places(y, d)) for x, y, d in zip(a, b, self.decimals, strict=True)
        ]
        return Cell(tuple(number(x - y, d, sign=True) for x, y, d in zip(a, b, shown, strict=True)))

    def best(self, cells: Sequence[Cell]) -> list[Cell]:
        return best_of(cells, self.lower_is_better)

    @property
    def rms_name(self) -> str:
        some = len(self.whole) < len(self.routes)
        return f"RMS ({len(self.whole)} of {len(self.routes)})" if some else "RMS"


def mark(collection: Collection, route: Route, method: Method) -> str:
    """``2/3`` where only so many of the runs count."""
    records = [entry.record for entry in collection.runs(route, method)]
    counting = sum(map(counts, records))
    return f"{counting}/{len(records)}" if counting < len(records) else ""


def absolute_table(
    collection: Collection, group: str, baseline: Baseline | None, alignment: str
) -> ReportTable | None:
    """ARE and ATE (paper Tables III and VI); None where no run has truth."""
    grid = _Grid(collection, group, [measure(f"are_{alignment}"), measure(f"ate_{alignment}")])
    what = f"RMSE, aligned by {alignment} ({ALIGNMENT_MEANING[alignment]})"
    names = ("ARE °", "ATE m")
    return _by_method("absolute", "Absolute pose error", what, names, grid, baseline, "decrease")


def tracking_table(
    collection: Collection, group: str, baseline: Baseline | None
) -> ReportTable | None:
    """Track length and parallax (paper Tables I and IV)."""
    keys = ("mean_length", "two_view_parallax", "total_parallax")
    grid = _Grid(collection, group, list(map(measure, keys)))
    what = "Mean length and parallax of all tracks, rotation taken out"
    names = ("images", "two-view °", "total °")
    return _by_method("tracking", "Tracking quality", what, names, grid, baseline, "increase")


def per_image_table(collection: Collection, group: str) -> ReportTable | None:
    """Features and parallax per image, which the paper's means by track hide."""
    keys = ("features", "parallax_per_image", "tracks_10")
    grid = _Grid(collection, group, list(map(measure, keys)))
    what = "Features, parallax and tracks that reached 10 images, each over the number of images"
    names = ("features", "parallax °", "tracks ≥ 10")
    return _by_method("per_image", "Tracking per image", what, names, grid, None, "")


def lengths_table(
    collection: Collection, group: str, baseline: Baseline | None
) -> ReportTable | None:
    """Shares of the tracks with some lengths (paper Tables II and V)."""
    grids = [_Grid(collection, group, [length_share(n)]) for n in LENGTHS]
    heads = [Column(f"{n} image{'s' if n > 1 else ''}") for n in LENGTHS]
    what = "Percent of all tracks that were seen in exactly so many images"
    return _by_length(
        "lengths", "Tracks by length", what, grids, heads, baseline, change="increase"
    )


def relative_table(
    collection: Collection, group: str, baseline: Baseline | None
) -> ReportTable | None:
    """RRE and RTE by length (paper Table VII)."""
    lengths = rte_lengths([e.record for e in collection.entries if e.record.group == group])
    grids = [
        _Grid(collection, group, [measure(f"rre_{n:g}"), measure(f"rte_{n:g}")]) for n in lengths
    ]
    heads = [Column(f"{length:g} m", ("RRE °", "RTE %")) for length in lengths]
    what = "RMSE over all pairs of poses so far apart on the truth, which needs no alignment"
    return _by_length("relative", "Relative pose error", what, grids, heads, baseline)


def runtime_table(collection: Collection, group: str) -> ReportTable | None:
    """CPU per image and stage (paper Table IX)."""
    stages = [s for s in STAGES if any(s in e.record.cpu_ms for e in collection.entries)]
    grids = [_Grid(collection, group, [cpu(stage)]) for stage in (*stages, FRAME)]
    heads = [Column(name) for name in (*stages, "whole frame")]
    what = "Median process CPU in ms, reading the image left out"
    return _by_length("runtime", "Runtime per image", what, grids, heads, None, marked=False)


def _by_method(
    key: str,
    title: str,
    what: str,
    names: tuple[str, ...],
    grid: _Grid,
    baseline: Baseline | None,
    change: str,
) -> ReportTable | None:
    """Rows are routes, columns methods; beside them the change against the baseline."""
    if grid.empty:
        return None
    collection = grid.collection
    pairs = _pairs(collection, grid.methods, baseline)
    sign = 1 if change == "decrease" else -1

    def row(head: str, cells: list[Cell], numbers: Mapping[Method, _Numbers]) -> tuple[Cell, ...]:
        changes = [
            grid.difference(*((numbers[base], numbers[other])[::sign])) for base, other in pairs
        ]
        return (words(head), *grid.best(cells), *changes)

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
        key, title, _caption(what, grid, rows), columns, tuple(rows),
        (overall,) if len(grid.routes) > 1 else (), _notes(rows),
    )  # fmt: skip


def _by_length(
    key: str,
    title: str,
    what: str,
    grids: Sequence[_Grid],
    heads: Sequence[Column],
    baseline: Baseline | None,
    *,
    change: str = "decrease",
    marked: bool = True,
) -> ReportTable | None:
    """Rows are routes and methods, columns lengths, stages and the like; the best is marked."""
    shown = [(g, h) for g, h in zip(grids, heads, strict=True) if not g.empty]
    if not shown:
        return None
    grid = shown[0][0]
    collection = grid.collection

    def block(head: str, methods: Sequence[Method], of: Sequence[Sequence[Cell]]) -> list[_Row]:
        best = [g.best(c) if marked else c for (g, _), c in zip(shown, of, strict=True)]
        named = zip(methods, *best, strict=True)
        return [(words(head), words(collection.name(method)), *cells) for method, *cells in named]

    rows: list[_Row] = []
    for route in grid.routes:
        ran = [method for method in grid.methods if collection.runs(route, method)]
        of_route = [[g.mean_cell(route, method) for method in ran] for g, _ in shown]
        rows += block(route.name, ran, of_route)
    overall = [[g.cell(g.rms[m]) for m in grid.methods] for g, _ in shown]
    summary = block("RMS", grid.methods, overall)
    for base, other in _pairs(collection, grid.methods, baseline):
        a, b = (base, other) if change == "decrease" else (other, base)
        cells = [g.difference(g.rms[a], g.rms[b]) for g, _ in shown]
        summary.append((words(change), words(collection.name(other)), *cells))
    several = len(grid.routes) > 1
    columns = (Column("sequence", numeric=False), Column("method", numeric=False))
    return ReportTable(
        key, title, _caption(what, grid, rows), (*columns, *(h for _, h in shown)), tuple(rows),
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


def _caption(what: str, grid: _Grid, rows: Sequence[_Row]) -> str:
    collection = grid.collection
    seeds = [len(collection.runs(r, m)) for r in grid.routes for m in grid.methods]
    runs = [n for n in seeds if n]
    each = f"{min(runs)}" if min(runs) == max(runs) else f"{min(runs)} to {max(runs)}"
    text = f"{what}. {sum(runs)} runs, {each} of each method on each sequence"
    over = " RMS: over the sequences that every method got through." * (len(grid.routes) > 1)
    if any(part.best for row in rows for cell in row for part in cell.parts):
        over += " Bold: the best of a sequence."
    if max(runs) == 1:
        return f"{text}: a difference may be chance.{over}"
    return f"{text}; each cell is the mean of those that count.{over}"


def _notes(rows: Sequence[_Row]) -> tuple[str, ...]:
    if any(cell.mark for row in rows for cell in row):
        return ("(2/3): so many of the runs count; the number is of these alone.",)
    return ()
