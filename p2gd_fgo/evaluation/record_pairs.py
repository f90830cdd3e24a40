"""From the records of a study to paired comparisons."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.episodes import SegmentPair, pair_segments
from p2gd_fgo.evaluation.measures import Measure
from p2gd_fgo.evaluation.paired import Comparison, compare_pairs
from p2gd_fgo.evaluation.segments import Segment
from p2gd_fgo.run_record import Label, RunRecord

Choice = Mapping[str, Label]
"""Labels on some axes: what one side of a comparison is."""

Key = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class RecordPairs:
    """Runs that differ only in what is compared.

    Attributes
    ----------
    pairs
        Run of a and run of b.
    alone_a, alone_b
        Runs of one side without a partner: not yet run, or left out of the study.
    """

    pairs: tuple[tuple[RunRecord, RunRecord], ...]
    alone_a: int
    alone_b: int


@dataclass(frozen=True, slots=True)
class Contrast:
    """A measure of b against a, by group and over all.

    Attributes
    ----------
    measure
        What was compared.
    a, b
        The sides.
    groups
        By group of routes, such as a preset.
    overall
        Over all groups. Groups differ in what an error of 1 m means, so of this the geometric
        effect is the one to read; it is the group's own where there is one group.
    alone_a, alone_b
        As in :class:`RecordPairs`.
    """

    measure: Measure
    a: Choice
    b: Choice
    groups: Mapping[str, Comparison]
    overall: Comparison
    alone_a: int
    alone_b: int


def select(records: Iterable[RunRecord], choice: Choice) -> list[RunRecord]:
    """The records with these labels on these axes."""
    return [r for r in records if all(r.axes.get(axis) == v for axis, v in choice.items())]


def pair_records(
    records: Sequence[RunRecord], a: Choice, b: Choice, *, across: Collection[str] = ()
) -> RecordPairs:
    """Pair the runs of a with those of b.

    Two runs are a pair if route, group, seed and the labels on all axes that neither side names
    are the same.

    Parameters
    ----------
    records
        Of one study.
    a, b
        Labels that make the sides, such as ``{"distribution": "grid"}``.
    across
        Axes that one side doesn't vary along, such as ``seed`` for an estimator whose trajectory
        was made elsewhere: its one run is paired with every run of the other side.

    Raises
    ------
    ConfigError
        A label that no record has, sides that share runs, or more than one run for the same place.
    """
    for side in (a, b):
        for axis, label in side.items():
            known = sorted({str(r.axes[axis]) for r in records if axis in r.axes})
            if str(label) not in known:
                raise ConfigError(
                    f"no run has {axis} '{label}': the records have "
                    f"{', '.join(known) or f'no axis {axis}'}"
                )
    named = {*a, *b, *across}
    sides = tuple(_by_key(select(records, side), named, across) for side in (a, b))
    pairs: list[tuple[RunRecord, RunRecord]] = []
    for key in sorted(sides[0].keys() & sides[1].keys(), key=str):
        left, right = sides[0][key], sides[1][key]
        if len(left) > 1 and len(right) > 1:
            raise ConfigError(
                f"{len(left)} and {len(right)} runs of route {left[0].route}, seed {left[0].seed} "
                f"fit {dict(a)} and {dict(b)}: name more axes, so that each side has one"
            )
        _check_distinct(left)
        _check_distinct(right)
        pairs += [(x, y) for x in left for y in right]
    if any(x is y for x, y in pairs):
        raise ConfigError(f"{dict(a)} and {dict(b)} share runs: name what they differ in")
    alone = [sum(len(side[key]) for key in side.keys() - other.keys()) for side, other in
             (sides, sides[::-1])]  # fmt: skip
    return RecordPairs(tuple(pairs), *alone)


def compare_records(
    records: Sequence[RunRecord],
    a: Choice,
    b: Choice,
    measure: Measure,
    *,
    across: Collection[str] = (),
    **options: Any,
) -> Contrast:
    """Compare b with a on one measure.

    A run that is not done, or whose completeness is below 0.9, has no value: its pair is counted
    and left out of the effects, and the worst value of its group stands for it in ``penalised``.

    Parameters
    ----------
    records, a, b, across
        As in :func:`pair_records`.
    measure
        See :func:`p2gd_fgo.evaluation.measures.measure`.
    options
        Of :func:`compare_pairs`.

    Raises
    ------
    ConfigError
        As :func:`pair_records`, or no pair at all.
    """
    found = pair_records(records, a, b, across=across)
    if not found.pairs:
        raise ConfigError(
            f"{dict(a)} and {dict(b)} have no pair of runs that differ in nothing else: "
            f"{found.alone_a} and {found.alone_b} runs stand alone"
        )
    by_group: dict[str, list[tuple[RunRecord, RunRecord]]] = defaultdict(list)
    for pair in found.pairs:
        by_group[pair[0].group].append(pair)
    groups = {name: _compare(pairs, measure, options) for name, pairs in sorted(by_group.items())}
    overall = (
        next(iter(groups.values())) if len(groups) == 1 else _compare(found.pairs, measure, options)
    )
    return Contrast(measure, a, b, groups, overall, found.alone_a, found.alone_b)


def segment_pairs(found: RecordPairs) -> tuple[SegmentPair, ...]:
    """The pieces of the way of all pairs whose two records hold them, for :func:`compare_episodes`.

    Raises
    ------
    DataError
        As :func:`pair_segments`, or a row of segments that can't be read.
    """
    out: list[SegmentPair] = []
    for x, y in found.pairs:
        if x.segments is not None and y.segments is not None:
            a, b = ([Segment.from_json(row) for row in rows] for rows in (x.segments, y.segments))
            out += pair_segments(a, b, f"{x.group}/{x.route}")
    return tuple(out)


def _compare(
    pairs: Sequence[tuple[RunRecord, RunRecord]], measure: Measure, options: Mapping[str, Any]
) -> Comparison:
    groups = [x.group for x, _ in pairs]
    several = len(set(groups)) > 1
    return compare_pairs(
        np.array([measure.of(x) for x, _ in pairs]),
        np.array([measure.of(y) for _, y in pairs]),
        [f"{x.group}/{x.route}" if several else x.route for x, _ in pairs],
        group=groups,
        lower_is_better=measure.lower_is_better,
        **options,
    )


def _check_distinct(records: Sequence[RunRecord]) -> None:
    """Refuse two runs that nothing tells apart: a pair of each would count one run twice."""
    seen = {(r.seed, *sorted((n, str(v)) for n, v in r.axes.items())) for r in records}
    if len(seen) < len(records):
        first = records[0]
        raise ConfigError(
            f"two runs of route {first.route}, seed {first.seed} have the labels "
            f"{dict(first.axes)}, but other settings: give one study at a time"
        )


def _by_key(
    records: Iterable[RunRecord], named: Collection[str], across: Collection[str]
) -> dict[Key, list[RunRecord]]:
    out: dict[Key, list[RunRecord]] = defaultdict(list)
    for record in records:
        axes = sorted((n, str(v)) for n, v in record.axes.items() if n not in named)
        seed = None if "seed" in across else record.seed
        out[record.group, record.route, seed, *axes].append(record)
    return out
