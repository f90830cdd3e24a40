"""The runs of a report, ordered: which methods ran on which routes, and what is compared."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.measures import Measure
from p2gd_fgo.report.layout import natural
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.run_record import Label, RunRecord

_ALWAYS_SHOWN = ("backend", "distribution")
_COMPARED = "distribution"
_REFERENCE = "grid"
Method = tuple[Label, ...]
"""Labels on the method axes."""


@dataclass(frozen=True, slots=True)
class Route:
    """What a row of a table is of: the seeds of one route."""

    group: str
    name: str


class Collection:
    """Runs by group, route and method.

    Parameters
    ----------
    entries
        At least one.

    Attributes
    ----------
    entries
        As given.
    axes
        Names of the axes on which methods differ: those on which runs of one route and seed do,
        and back end and distribution in any case.
    shared
        Labels of the other axes on which all runs agree.
    methods
        Back end by back end, the grid before what is compared with it, else in the order of
        their first run.
    routes, groups
        Groups in the order of their first run, routes by name within them.
    """

    def __init__(self, entries: Sequence[Entry]) -> None:
        self.entries = tuple(entries)
        records = [entry.record for entry in entries]
        self.axes = _method_axes(records)
        self.methods = self._ordered(dict.fromkeys(self.method(record) for record in records))
        self.groups = tuple(dict.fromkeys(record.group for record in records))
        self.routes = tuple(
            sorted(
                dict.fromkeys(Route(r.group, r.route) for r in records),
                key=lambda route: (self.groups.index(route.group), natural(route.name)),
            )
        )
        self.shared = _shared(records, self.axes)
        self._runs: dict[tuple[Route, Method], list[Entry]] = {}
        for entry in entries:
            where = (Route(entry.record.group, entry.record.route), self.method(entry.record))
            self._runs.setdefault(where, []).append(entry)

    def method(self, record: RunRecord) -> Method:
        """Which method a run is of."""
        return tuple(record.axes.get(axis, "") for axis in self.axes)

    def runs(self, route: Route, method: Method) -> Sequence[Entry]:
        """Runs of a method on a route; none is possible."""
        return self._runs.get((route, method), [])

    def of(self, group: str) -> tuple[Route, ...]:
        """Routes of a group."""
        return tuple(route for route in self.routes if route.group == group)

    def methods_of(self, group: str) -> tuple[Method, ...]:
        """Methods with any run in a group."""
        routes = self.of(group)
        return tuple(m for m in self.methods if any(self.runs(route, m) for route in routes))

    def _ordered(self, methods: Iterable[Method]) -> tuple[Method, ...]:
        def rank(method: Method) -> tuple[int, bool]:
            labels = dict(zip(self.axes, method, strict=True))
            return backends.index(labels.get("backend", "")), _REFERENCE not in labels.values()

        methods = list(methods)
        backends = [dict(zip(self.axes, m, strict=True)).get("backend", "") for m in methods]
        return tuple(sorted(methods, key=rank))

    @cached_property
    def varying(self) -> tuple[int, ...]:
        """Which of ``axes`` have more than one label."""
        return tuple(k for k in range(len(self.axes)) if len({m[k] for m in self.methods}) > 1)

    def name(self, method: Method) -> str:
        """Its labels, those on which all agree left out; numbers with the name of their axis."""
        kept = self.varying or range(len(self.axes))
        return self._labels(method, kept) or "run"

    def against(self, method: Method, base: Method) -> str:
        """Two methods in a few words: ``smoother: p2gd against grid``."""
        common = [k for k in self.varying if method[k] == base[k]]
        other = [k for k in self.varying if method[k] != base[k]]
        prefix = self._labels(method, common)
        text = f"{self._labels(method, other)} against {self._labels(base, other)}"
        return f"{prefix}: {text}" if prefix else text

    def choice(self, method: Method) -> dict[str, Label]:
        """Its labels by axis, for picking records."""
        return {axis: label for axis, label in zip(self.axes, method, strict=True) if label != ""}

    def _labels(self, method: Method, which: Iterable[int]) -> str:
        named = (_named(self.axes[k], method[k]) for k in which)
        return " · ".join(name for name in named if name)

    def values(self, route: Route, method: Method, measure: Measure) -> list[float]:
        """Of the runs that count and have the value."""
        values = (measure.of(entry.record) for entry in self.runs(route, method))
        return [value for value in values if math.isfinite(value)]


@dataclass(frozen=True, slots=True)
class Baseline:
    """What methods are compared with: those with ``label`` on ``axis``."""

    axis: str
    label: Label


def choose_baseline(collection: Collection, wanted: str | None) -> Baseline | None:
    """The baseline asked for as ``axis=label``, or the grid; None where nothing is to compare.

    The grid may be a label of another axis than ``distribution``, such as the prior poses of a
    study. Without it the baseline is the first label of the first axis with several.

    Raises
    ------
    ConfigError
        No such axis or label.
    """
    axes = {name: k for k, name in enumerate(collection.axes)}
    labels = {
        name: list(dict.fromkeys(method[k] for method in collection.methods))
        for name, k in axes.items()
    }
    if wanted is not None:
        axis, _, text = wanted.partition("=")
        found = [label for label in labels.get(axis, []) if str(label) == text]
        if not found:
            known = ", ".join(f"{a}={label}" for a in labels for label in labels[a])
            raise ConfigError(
                f"--baseline {wanted}: no run is of it; give one of {known or 'no axis at all'}"
            )
        return Baseline(axis, found[0])
    for axis in dict.fromkeys((_COMPARED, *labels)):
        if _REFERENCE in labels.get(axis, []) and len(labels[axis]) > 1:
            return Baseline(axis, _REFERENCE)
    return next((Baseline(a, known[0]) for a, known in labels.items() if len(known) > 1), None)


def counterpart(collection: Collection, method: Method, baseline: Baseline) -> Method | None:
    """The one of :func:`counterparts`; None where there is none, or more than one."""
    found = counterparts(collection, method, baseline)
    return found[0] if len(found) == 1 else None


def counterparts(collection: Collection, method: Method, baseline: Baseline) -> tuple[Method, ...]:
    """The baseline's methods that a method is compared with; none for the baseline's own.

    The one with the same labels on the most other axes, and the same back end in any case:
    options of P2GD have no counterpart of their own. A method that names no back end, such as a
    trajectory made elsewhere, is compared with one of each.
    """
    axis = collection.axes.index(baseline.axis)
    if method[axis] == baseline.label:
        return ()
    by_backend: dict[Label, list[Method]] = {}
    backend = collection.axes.index("backend") if "backend" in collection.axes else axis
    for each in collection.methods:
        if each[axis] == baseline.label and (
            backend == axis or method[backend] in ("", each[backend])
        ):
            by_backend.setdefault(each[backend], []).append(each)

    def alike(other: Method) -> int:
        return sum(a == b for a, b in zip(other, method, strict=True))

    return tuple(max(candidates, key=alike) for candidates in by_backend.values())


def _method_axes(records: Sequence[RunRecord]) -> tuple[str, ...]:
    names = dict.fromkeys(name for record in records for name in record.axes if name != "seed")
    seen: dict[tuple[str, str, int, str], set[Label | None]] = {}
    for record in records:
        for name in names:
            where = (record.group, record.route, record.seed, name)
            seen.setdefault(where, set()).add(record.axes.get(name))
    differing = {where[-1] for where, labels in seen.items() if len(labels) > 1}
    return tuple(n for n in names if n in differing or n in _ALWAYS_SHOWN)


def _shared(records: Sequence[RunRecord], axes: Sequence[str]) -> dict[str, Label]:
    first = records[0].axes
    return {
        name: label
        for name, label in first.items()
        if name not in axes and name not in ("seed", "sequence")
        if all(record.axes.get(name) == label for record in records)
    }


def _named(axis: str, label: Label) -> str:
    return label if isinstance(label, str) else f"{axis} {label}"
