"""Errors by the noise on the prior poses, with the grid as reference (paper Table VIII)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from p2gd_fgo.evaluation.measures import Measure, measure
from p2gd_fgo.report.layout import NONE, decimals
from p2gd_fgo.report.pages.collection import Collection, Method, Route
from p2gd_fgo.report.pages.table_model import (
    Cell,
    Column,
    Part,
    ReportTable,
    best_of,
    mean,
    measured,
    number,
    rms,
    words,
)
from p2gd_fgo.report.tables import ALIGNMENT_MEANING
from p2gd_fgo.run_record import Label

_LABEL = re.compile(r"(\d+(?:\.\d+)?) (m|deg)")  # of a study's axis: "0.05 m", "2.5 deg"
_UNITS = {"position_noise": "m", "yaw_noise_deg": "deg"}  # axes of run directories
_FEWEST_LEVELS = 2
_MOST_SEEDS = 5
_NAMES = ("ARE °", "ATE m")


@dataclass(frozen=True, slots=True)
class _Level:
    """The noise of a method's prior poses, m and degrees; 0 of the grid's and of exact ones."""

    position_m: float
    yaw_deg: float

    @property
    def name(self) -> str:
        position = f"position {self.position_m:g} m" if self.position_m else ""
        yaw = f"yaw {self.yaw_deg:g}°" if self.yaw_deg else ""
        return ", ".join(filter(None, (position, yaw)))

    @property
    def rank(self) -> tuple[bool, float, float]:
        """Position noise before yaw noise, each rising; no noise first."""
        return self.yaw_deg > 0.0, self.yaw_deg, self.position_m


def noise_table(collection: Collection, group: str, alignment: str) -> ReportTable | None:
    """ARE and ATE of each repeat and their mean; None where prior poses have no noise levels."""
    found = {method: _level(collection, method) for method in collection.methods_of(group)}
    levels = {method: level for method, level in found.items() if level is not None}
    methods = list(levels)
    if len({level for level in levels.values() if level.name}) < _FEWEST_LEVELS:
        return None
    measures = [measure(f"are_{alignment}"), measure(f"ate_{alignment}")]
    errors = _Errors(collection, group, methods, measures)
    if not errors.routes:
        return None
    seeds = errors.seeds if len(errors.seeds) <= _MOST_SEEDS else ()
    backends = [name for name, _ in _blocks(collection, methods)]
    rows: list[tuple[Cell, ...]] = []
    for backend, held in _blocks(collection, methods):
        ordered = sorted(held, key=lambda m: (levels[m].rank, methods.index(m)))
        reference = next((m for m in ordered if _is_grid(m)), None)
        repeats = [best_of([errors.cell(m, s) for m in ordered], (True, True)) for s in seeds]
        means = best_of([errors.cell(m) for m in ordered], (True, True))
        for k, method in enumerate(ordered):
            name = levels[method].name or _name(collection, method)
            head = [words(backend)] if len(backends) > 1 else []
            against = errors.change(method, reference)
            rows.append((*head, words(name), *(each[k] for each in repeats), means[k], against))
    columns = (
        *([Column("back end", numeric=False)] if len(backends) > 1 else []),
        Column("prior poses", numeric=False),
        *(Column(f"seed {seed}", _NAMES) for seed in seeds),
        Column("mean", _NAMES),
        Column("against the grid", ("ARE %", "ATE %")),
    )
    over = f"{len(errors.routes)} of {errors.asked} sequences, those that every run got through"
    caption = (
        f"RMSE, aligned by {alignment} ({ALIGNMENT_MEANING[alignment]}), RMS over {over}; mean "
        f"over {len(errors.seeds)} repeat{'s' * (len(errors.seeds) > 1)}. Bold: the best of a "
        "column of one back end. The paired comparison has the intervals of the changes."
    )
    title = "Absolute pose error with noise on the prior poses"
    return ReportTable("prior_noise", title, caption, columns, tuple(rows))


class _Errors:
    """RMS of each error over the sequences that every method got through with every seed."""

    def __init__(
        self,
        collection: Collection,
        group: str,
        methods: Sequence[Method],
        measures: Sequence[Measure],
    ) -> None:
        found: dict[tuple[Route, Method, int], tuple[float, ...]] = {
            (route, method, entry.record.seed): tuple(m.of(entry.record) for m in measures)
            for route in collection.of(group)
            for method in methods
            for entry in collection.runs(route, method)
        }
        self.seeds = tuple(sorted({seed for _, _, seed in found}))
        self.asked = len(collection.of(group))
        self.routes = [
            route
            for route in collection.of(group)
            if all(
                all(map(math.isfinite, found.get((route, method, seed), (math.nan,))))
                for method in methods
                for seed in self.seeds
            )
        ]
        count = range(len(measures))
        self._rms = {
            (method, seed): [rms([found[r, method, seed][k] for r in self.routes]) for k in count]
            for method in methods
            for seed in self.seeds
            if self.routes
        }
        self._decimals = [decimals(each[k] for each in self._rms.values()) for k in count]

    def of(self, method: Method, seed: int | None = None) -> list[float]:
        """Of one repeat, or the mean of all."""
        if seed is not None:
            return self._rms[method, seed]
        return [
            mean(each) for each in zip(*(self._rms[method, s] for s in self.seeds), strict=True)
        ]

    def cell(self, method: Method, seed: int | None = None) -> Cell:
        values = zip(self.of(method, seed), self._decimals, strict=True)
        return Cell(tuple(measured(value, shown) for value, shown in values))

    def change(self, method: Method, reference: Method | None) -> Cell:
        """Percent of the reference's mean."""
        if reference is None or method == reference:
            return Cell((Part(NONE), Part(NONE)))
        pairs = zip(self.of(method), self.of(reference), strict=True)
        return Cell(tuple(number(100.0 * (a / b - 1.0), 0, sign=True) for a, b in pairs))


def _blocks(
    collection: Collection, methods: Sequence[Method]
) -> Iterator[tuple[str, list[Method]]]:
    """The methods of each back end."""
    names = {method: str(_labels(collection, method).get("backend", "")) for method in methods}
    for name in dict.fromkeys(names.values()):
        yield name, [method for method in methods if names[method] == name]


def _labels(collection: Collection, method: Method) -> dict[str, Label]:
    return dict(zip(collection.axes, method, strict=True))


def _is_grid(method: Method) -> bool:
    return "grid" in method


def _level(collection: Collection, method: Method) -> _Level | None:
    """None where a label says no number: a name, or a trajectory made elsewhere, which has none."""
    found = {"m": 0.0, "deg": 0.0}
    if not _is_grid(method):
        for axis, label in _labels(collection, method).items():
            name = axis.rpartition(".")[2]
            if name in _UNITS:
                if isinstance(label, str):
                    return None
                found[_UNITS[name]] = float(label)
            elif name == "priors" and (match := _LABEL.fullmatch(str(label))):
                found[match[2]] = float(match[1])
    return _Level(found["m"], found["deg"])


def _name(collection: Collection, method: Method) -> str:
    """What a method without noise is called: its labels but the back end's."""
    kept = [k for k in collection.varying if collection.axes[k] not in ("backend", *_UNITS)]
    return " · ".join(str(method[k]) for k in kept if method[k] != "") or "no noise"
