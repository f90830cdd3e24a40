"""Two ways of running, judged on pairs of runs that differ in nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import stats

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.bootstrap import (
    KINDS,
    Effect,
    EffectKind,
    PairsByRoute,
    by_route,
    effect,
)
from p2gd_fgo.evaluation.power import Spread, detectable, routes_needed, spread
from p2gd_fgo.types import BoolArray, FloatArray

ASKED_CHANGE = -0.1
ASKED_POWER = 0.8


@dataclass(frozen=True, slots=True)
class Side:
    """One side of the pairs.

    Attributes
    ----------
    runs, whole
        Runs; those of them with a value that counts.
    mean, rms, median
        Of the values in whole pairs. Mean and RMS give every route the same weight; NaN without.
    """

    runs: int
    whole: int
    mean: float
    rms: float
    median: float


@dataclass(frozen=True, slots=True)
class RouteRow:
    """One route: what its seeds gave. It has no interval, one route says nothing of others.

    Attributes
    ----------
    route
        Its name.
    pairs, whole
        Pairs; those whose two runs have a value that counts.
    mean_a, mean_b, sd_a, sd_b
        Over whole pairs; the standard deviation is NaN below two.
    change
        Mean of b over mean of a, minus 1.
    """

    route: str
    pairs: int
    whole: int
    mean_a: float
    mean_b: float
    sd_a: float
    sd_b: float
    change: float


@dataclass(frozen=True, slots=True)
class Needed:
    """What it takes to show ``change`` with ``power``.

    Attributes
    ----------
    routes
        By pairs a route: fewest routes, None beyond 10,000.
    detectable
        Smallest decrease that the design at hand shows with this power, or None.
    """

    change: float
    power: float
    routes: Mapping[int, int | None]
    detectable: float | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """b against a.

    Attributes
    ----------
    pairs, whole, routes
        All pairs; those that count; routes with at least one of these.
    missing_a, missing_b
        Pairs in which this side has no value that counts; a pair may be in both.
    a, b
        The sides.
    effects
        By kind, over whole pairs; a kind that means nothing is absent.
    penalised
        The same over all pairs, with the worst value of its group for every run without one; equal
        to ``effects`` where none is missing, empty where nothing says which way is worse. A group
        in which no run has a value is not among them.
    p_value
        Of Wilcoxon's signed-rank test on the routes' log ratios of means (of differences where
        there are no ratios), two-sided; None below two routes.
    better_share
        Share of all pairs in which b is better, a run without a value being worse than any other
        and ties counting half; None where nothing says which way is better.
    spread
        Of the log ratio, between and within routes.
    needed
        Routes for the power asked; None without a spread.
    rows
        Route by route.
    """

    pairs: int
    whole: int
    routes: int
    missing_a: int
    missing_b: int
    a: Side
    b: Side
    effects: Mapping[EffectKind, Effect]
    penalised: Mapping[EffectKind, Effect]
    p_value: float | None
    better_share: float | None
    spread: Spread | None
    needed: Needed | None
    rows: tuple[RouteRow, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain data, every attribute."""
        return asdict(self)


def compare_pairs(
    a: FloatArray,
    b: FloatArray,
    route: Sequence[object],
    *,
    group: Sequence[object] | None = None,
    lower_is_better: bool | None = True,
    level: float = 0.95,
    draws: int = 2000,
    seed: int = 0,
    change: float = ASKED_CHANGE,
    power: float = ASKED_POWER,
) -> Comparison:
    """Compare b with a over N pairs.

    Parameters
    ----------
    a, b
        (N,) a measure of the two runs of each pair; NaN where the run failed or doesn't count.
    route
        N labels; runs on one route are not independent.
    group
        N labels; the worst value for a run without one is that of its group. Default: one group.
    lower_is_better
        Of the measure; None where neither way is.
    level, draws, seed
        Of the intervals, see :func:`effect`.
    change, power
        What the numbers of routes needed are given for.

    Raises
    ------
    DataError
        No pairs, or other lengths.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    labels = np.array([str(name) for name in route], dtype=object).astype(str)
    if not len(a) or a.shape != b.shape or a.shape != labels.shape:
        raise DataError(
            f"a comparison needs pairs, as many values on both sides as routes: {len(a)}, "
            f"{len(b)} and {len(labels)} were given"
        )
    known_a, known_b = np.isfinite(a), np.isfinite(b)
    whole = known_a & known_b
    sorted_pairs = by_route(a[whole], b[whole], labels[whole]) if whole.any() else None
    options = {"level": level, "draws": draws, "seed": seed}
    effects = _effects(sorted_pairs, options)
    found = spread(sorted_pairs) if sorted_pairs else None
    return Comparison(
        pairs=len(a),
        whole=int(whole.sum()),
        routes=len(sorted_pairs.counts) if sorted_pairs else 0,
        missing_a=int((~known_a).sum()),
        missing_b=int((~known_b).sum()),
        a=_side(a, known_a, sorted_pairs.a if sorted_pairs else None, sorted_pairs),
        b=_side(b, known_b, sorted_pairs.b if sorted_pairs else None, sorted_pairs),
        effects=effects,
        penalised=effects
        if whole.all()
        else _effects(_penalised(a, b, labels, group, lower_is_better), options),
        p_value=_wilcoxon(sorted_pairs),
        better_share=_better_share(a, b, lower_is_better),
        spread=found,
        needed=_needed(found, sorted_pairs, change, power, level),
        rows=_rows(a, b, labels, whole),
    )


def _effects(pairs: PairsByRoute | None, options: Mapping[str, Any]) -> dict[EffectKind, Effect]:
    if pairs is None:
        return {}
    made = ((kind, effect(pairs, kind, **options)) for kind in KINDS)
    return {kind: value for kind, value in made if value is not None}


def _side(
    values: FloatArray, known: BoolArray, padded: FloatArray | None, pairs: PairsByRoute | None
) -> Side:
    if pairs is None or padded is None:
        return Side(len(values), int(known.sum()), np.nan, np.nan, np.nan)
    present = pairs.present
    mean, square = (
        float(np.mean(np.where(present, padded**p, 0.0).sum(axis=1) / pairs.counts)) for p in (1, 2)
    )
    median = float(np.median(padded[present]))
    return Side(len(values), int(known.sum()), mean, float(np.sqrt(square)), median)


def _penalised(
    a: FloatArray,
    b: FloatArray,
    labels: Any,
    group: Sequence[object] | None,
    lower_is_better: bool | None,
) -> PairsByRoute | None:
    """All pairs, with the worst value of the group where there is none.

    A group in which no run has a value has no worst one: it is left out. None where all are.
    """
    if lower_is_better is None:
        return None
    names = np.array([""] * len(a) if group is None else [str(name) for name in group])
    filled = np.stack([a, b])
    for name in set(names.tolist()):
        here = filled[:, names == name]
        known = here[np.isfinite(here)]
        if not len(known):
            continue
        worst = known.max() if lower_is_better else known.min()
        filled[:, names == name] = np.where(np.isfinite(here), here, worst)
    full = np.isfinite(filled).all(axis=0)
    return by_route(filled[0, full], filled[1, full], labels[full]) if full.any() else None


def _better_share(a: FloatArray, b: FloatArray, lower_is_better: bool | None) -> float | None:
    if lower_is_better is None:
        return None
    cost_a, cost_b = (
        np.where(np.isfinite(side), side if lower_is_better else -side, np.inf) for side in (a, b)
    )
    return float(np.mean((cost_b < cost_a) + 0.5 * (cost_b == cost_a)))


def _wilcoxon(pairs: PairsByRoute | None) -> float | None:
    """P value on route means: of the log of their ratio, which no route's difficulty outweighs."""
    if pairs is None or len(pairs.counts) < 2:
        return None
    mean_a, mean_b = (
        np.where(pairs.present, side, 0.0).sum(axis=1) / pairs.counts for side in (pairs.a, pairs.b)
    )
    ratios = bool((mean_a > 0.0).all() and (mean_b > 0.0).all())
    shift = np.log(mean_b / mean_a) if ratios else mean_b - mean_a
    return float(stats.wilcoxon(shift).pvalue) if shift.any() else 1.0


def _needed(
    found: Spread | None, pairs: PairsByRoute | None, change: float, power: float, level: float
) -> Needed | None:
    if found is None or pairs is None:
        return None
    now = float(len(pairs.counts) / np.sum(1.0 / pairs.counts))  # harmonic mean of pairs a route
    seeds = sorted({1, 3, 10, max(1, round(now))}) if found.within is not None else [1]
    routes = {n: routes_needed(found, change, n, wanted=power, level=level) for n in seeds}
    smallest = detectable(found, len(pairs.counts), now, wanted=power, level=level)
    return Needed(change, power, routes, smallest)


def _rows(a: FloatArray, b: FloatArray, labels: Any, whole: BoolArray) -> tuple[RouteRow, ...]:
    rows = []
    for name in sorted(set(labels.tolist())):
        here = labels == name
        x, y = a[here & whole], b[here & whole]
        mean_a, mean_b = (float(v.mean()) if len(v) else np.nan for v in (x, y))
        sd_a, sd_b = (float(v.std(ddof=1)) if len(v) > 1 else np.nan for v in (x, y))
        change = mean_b / mean_a - 1.0 if mean_a > 0.0 else np.nan
        rows.append(RouteRow(name, int(here.sum()), len(x), mean_a, mean_b, sd_a, sd_b, change))
    return tuple(rows)
