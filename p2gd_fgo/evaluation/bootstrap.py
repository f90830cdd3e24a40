"""Intervals for the effect of one thing on runs that come in pairs over a few routes.

Seeds on one route are not independent: routes are drawn first, with replacement, then pairs within
each route drawn (Davison, Hinkley, "Bootstrap Methods and their Application", 1997, section 3.8).
Over 3 to 24 routes the percentiles of such draws cover an effect in 81 to 99 % of cases instead of
95, so the draws are used for the distribution of |θ* − θ| / s*, s the jackknife's standard error
over routes: the symmetric bootstrap-t (same book, sections 2.4 and 5.2; Hall, "On symmetric
bootstrap confidence intervals", J. R. Stat. Soc. B 1988).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import BoolArray, FloatArray, IntArray

EffectKind = Literal["mean", "rms", "geometric", "difference"]
KINDS: tuple[EffectKind, ...] = ("mean", "rms", "geometric", "difference")
MIN_ROUTES = 3
"""With fewer there is no interval."""

_POWER = {"mean": 1, "rms": 2}
_BLOCK = 2_000_000  # numbers held at once while drawing


@dataclass(frozen=True, slots=True)
class Effect:
    """What b is against a, over routes that count the same each.

    Attributes
    ----------
    kind
        ``mean``, ``rms``: mean or RMS of b over that of a, minus 1; ``geometric``: geometric mean
        of the pairs' ratios b / a, minus 1; ``difference``: mean of b − a, in its unit.
    change
        A fraction (−0.18: 18 % less), or in the unit of the values.
    low, high
        Ends of the interval; NaN below 3 routes.
    level
        Of the interval.
    """

    kind: EffectKind
    change: float
    low: float
    high: float
    level: float

    @property
    def verdict(self) -> Literal["less", "more", "not shown"]:
        """On which side of zero the interval lies."""
        if self.high < 0.0:
            return "less"
        return "more" if self.low > 0.0 else "not shown"


@dataclass(frozen=True, slots=True, eq=False)
class PairsByRoute:
    """Paired values sorted by route.

    Attributes
    ----------
    a, b
        (R, m) values of the two sides, the first ``counts[r]`` of row r; the rest is 1.
    counts
        (R,) pairs on each route, m the largest.
    names
        The R routes.
    """

    a: FloatArray
    b: FloatArray
    counts: IntArray
    names: tuple[object, ...]

    @property
    def present(self) -> BoolArray:
        """(R, m) where there is a pair."""
        return np.arange(self.a.shape[1]) < self.counts[:, None]


def by_route(a: FloatArray, b: FloatArray, route: object) -> PairsByRoute:
    """Sort N pairs by route.

    Parameters
    ----------
    a, b
        (N,) finite.
    route
        N labels; equal ones are one route.

    Raises
    ------
    DataError
        No pairs, other lengths, or a value that isn't finite.
    """
    a, b, labels = np.asarray(a, np.float64), np.asarray(b, np.float64), np.asarray(route)
    if not len(a) or a.shape != b.shape or labels.shape != a.shape:
        raise DataError(
            f"pairs need as many values on both sides and routes, at least one: {len(a)}, "
            f"{len(b)} and {len(labels)} were given"
        )
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise DataError("a value of a pair is not finite: leave such pairs out, and count them")
    names, row = np.unique(labels, return_inverse=True)
    counts = np.bincount(row)
    order = np.argsort(row, kind="stable")
    column = np.arange(len(a)) - np.repeat(np.cumsum(counts) - counts, counts)
    padded = np.ones((2, len(names), int(counts.max())))
    padded[:, row[order], column] = a[order], b[order]
    return PairsByRoute(padded[0], padded[1], counts, tuple(names.tolist()))


def effect(
    pairs: PairsByRoute,
    kind: EffectKind,
    *,
    level: float = 0.95,
    draws: int = 2000,
    seed: int = 0,
) -> Effect | None:
    """Estimate one effect and its interval.

    Parameters
    ----------
    level
        Share of cases in which the interval is to cover the effect.
    draws
        Of the bootstrap.
    seed
        Of the draws: the same pairs give the same interval.

    Returns
    -------
    Effect or None
        None where ratios mean nothing: a value of a pair (``geometric``), or the mean of a route,
        that is not above 0.
    """
    moments = _moments(pairs.a, pairs.b, pairs.present, pairs.counts, kind)
    if kind != "difference" and not _positive(pairs, moments, kind):
        return None
    theta, error = (float(v) for v in _estimate(moments, kind))
    half = np.nan
    if len(pairs.counts) >= MIN_ROUTES:
        ratios = _studentised(pairs, kind, theta, np.random.default_rng(seed), draws)
        half = error * (float(np.quantile(ratios, level)) if len(ratios) else 0.0)
    ends = np.array([theta, theta - half, theta + half])
    change, low, high = (ends if kind == "difference" else np.expm1(ends)).tolist()
    return Effect(kind, change, low, high, level)


def resampled(
    pairs: PairsByRoute, kind: EffectKind, *, draws: int = 2000, seed: int = 0
) -> FloatArray:
    """The estimates (draws,) of the draws, log ratios or differences: their percentiles undercover.

    For seeing what the interval gains over them.
    """
    return _draw(pairs, kind, np.random.default_rng(seed), draws)[0]


def _studentised(
    pairs: PairsByRoute, kind: EffectKind, theta: float, rng: np.random.Generator, draws: int
) -> FloatArray:
    """|θ* − θ| / s* of the draws; one without any spread tells nothing and is left out."""
    at, error = _draw(pairs, kind, rng, draws)
    spread = error > 1e-12 * (1.0 + abs(theta))
    return np.asarray(np.abs(at - theta)[spread] / error[spread])


def _draw(
    pairs: PairsByRoute, kind: EffectKind, rng: np.random.Generator, draws: int
) -> tuple[FloatArray, FloatArray]:
    """Estimates and standard errors, (draws,) each, of routes and pairs within them redrawn."""
    routes, most = pairs.a.shape
    block = max(1, _BLOCK // (routes * most))
    found = []
    for begin in range(0, draws, block):
        n = min(block, draws - begin)
        route = rng.integers(0, routes, (n, routes))
        counts = pairs.counts[route]
        member = (rng.random((n, routes, most)) * counts[..., None]).astype(np.int64)
        present = np.arange(most) < counts[..., None]
        a, b = pairs.a[route[..., None], member], pairs.b[route[..., None], member]
        found.append(_estimate(_moments(a, b, present, counts, kind), kind))
    at, error = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return at, error


def _moments(
    a: FloatArray, b: FloatArray, present: BoolArray, counts: IntArray, kind: EffectKind
) -> FloatArray:
    """(k, ..., R) means over each route's pairs: of both sides' powers, or of their contrast."""
    if kind == "difference":
        terms = (b - a)[None]
    elif kind == "geometric":
        with np.errstate(divide="ignore", invalid="ignore"):
            terms = np.log(b / a)[None]
    else:
        terms = np.stack([a, b]) ** _POWER[kind]
    return np.asarray(np.where(present, terms, 0.0).sum(axis=-1) / counts)


def _positive(pairs: PairsByRoute, moments: FloatArray, kind: EffectKind) -> bool:
    if kind == "geometric":
        return bool((pairs.a > 0.0).all() and (pairs.b > 0.0).all())
    return bool((moments > 0.0).all()) and bool((pairs.a >= 0.0).all() and (pairs.b >= 0.0).all())


def _estimate(moments: FloatArray, kind: EffectKind) -> tuple[FloatArray, FloatArray]:
    """Estimate θ (...) from (k, ..., R) and its jackknife standard error over routes."""
    routes = moments.shape[-1]
    total = moments.sum(axis=-1)
    theta = _theta(total / routes, kind)
    if routes < 2:
        return theta, np.full_like(theta, np.nan)
    without = _theta((total[..., None] - moments) / (routes - 1), kind)
    spread = without - without.mean(axis=-1, keepdims=True)
    return theta, np.sqrt((routes - 1) / routes * np.sum(spread * spread, axis=-1))


def _theta(means: FloatArray, kind: EffectKind) -> FloatArray:
    if kind in ("difference", "geometric"):
        return np.asarray(means[0])
    return np.asarray((np.log(means[1]) - np.log(means[0])) / _POWER[kind])
