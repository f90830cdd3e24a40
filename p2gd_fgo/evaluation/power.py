"""How many routes and seeds a comparison needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.bootstrap import PairsByRoute

_MOST_ROUTES = 10_000
_LARGEST = 5.0  # of |log ratio|: a factor of 148


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of the log ratio of a pair.

    Attributes
    ----------
    between
        Of the effect from route to route; with one pair a route all of the spread.
    within
        Of a pair about its route's effect; None with one pair a route.
    """

    between: float
    within: float | None


def spread(pairs: PairsByRoute) -> Spread | None:
    """Take the variance of log(b / a) apart, routes against pairs within them.

    By the mean squares of a one-way layout with unequal numbers (Searle, Casella, McCulloch,
    "Variance Components", 1992, section 3.6); a negative variance between routes counts as 0. None
    below two routes, or where a value isn't above 0.
    """
    routes = len(pairs.counts)
    if routes < 2 or not ((pairs.a > 0.0).all() and (pairs.b > 0.0).all()):
        return None
    d, n = np.log(pairs.b / pairs.a), pairs.counts
    means = np.where(pairs.present, d, 0.0).sum(axis=1) / n
    total = int(n.sum())
    if total == routes:
        return Spread(float(np.std(means, ddof=1)), None)
    inside = float(np.where(pairs.present, (d - means[:, None]) ** 2, 0.0).sum()) / (total - routes)
    overall = float(n @ means) / total
    across = float(n @ (means - overall) ** 2) / (routes - 1)
    per_route = (total - float(n @ n) / total) / (routes - 1)
    return Spread(float(np.sqrt(max(0.0, (across - inside) / per_route))), float(np.sqrt(inside)))


def power(found: Spread, change: float, routes: int, seeds: float, *, level: float = 0.95) -> float:
    """Chance that an interval over so many routes and seeds a route excludes zero.

    By the t test on the routes' mean log ratios. ``change`` is the true one, −0.1 for 10 % less.
    """
    if not change > -1.0 or change == 0.0:
        raise DataError(f"a change of {change:g} has no power: give one above -1 that isn't 0")
    return _power(found, float(np.log1p(change)), routes, seeds, level)


def routes_needed(
    found: Spread, change: float, seeds: int, *, wanted: float = 0.8, level: float = 0.95
) -> int | None:
    """Fewest routes that give ``wanted`` power with ``seeds`` pairs each.

    None beyond 10,000.
    """
    if power(found, change, _MOST_ROUTES, seeds, level=level) < wanted:
        return None
    low, high = 1, _MOST_ROUTES
    while high - low > 1:
        middle = (low + high) // 2
        if power(found, change, middle, seeds, level=level) >= wanted:
            high = middle
        else:
            low = middle
    return high


def detectable(
    found: Spread, routes: int, seeds: float, *, wanted: float = 0.8, level: float = 0.95
) -> float | None:
    """Smallest decrease, as a negative fraction, that this design shows with ``wanted`` power.

    None with one route, or where nothing short of a factor of 100 would show.
    """
    if routes < 2 or _power(found, _LARGEST, routes, seeds, level) < wanted:
        return None
    if _power(found, 1e-9, routes, seeds, level) >= wanted:
        return 0.0
    size = brentq(lambda x: _power(found, x, routes, seeds, level) - wanted, 1e-9, _LARGEST)
    return float(np.expm1(-size))


def _power(found: Spread, size: float, routes: int, seeds: float, level: float) -> float:
    if routes < 2:
        return 0.0
    error = np.sqrt((found.between**2 + (found.within or 0.0) ** 2 / seeds) / routes)
    if error == 0.0:
        return 1.0
    limit = stats.t.ppf(0.5 + level / 2.0, routes - 1)
    shift = abs(size) / error
    if shift > 30.0 + limit:
        return 1.0
    other_side = np.nan_to_num(stats.nct.cdf(-limit, routes - 1, shift))  # NaN where it is tiny
    return float(stats.nct.sf(limit, routes - 1, shift) + other_side)
