"""Pairs of errors with a known effect, for asking whether an interval covers it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from p2gd_fgo.types import FloatArray, IntArray

Tail = Literal["normal", "t4", "skewed"]


@dataclass(frozen=True, slots=True)
class PairModel:
    """How log errors vary; every number is a standard deviation.

    Attributes
    ----------
    difficulty
        Of the route, the same for both sides.
    route_effect
        Of the effect from route to route.
    run
        Of one run about what its route and side give.
    common
        Share of a run's variance that it has in common with the other of its pair.
    tail
        Shape of all of them: normal (so that errors are log-normal), Student's t with 4 degrees of
        freedom (cut at 8 standard deviations, where its exponential has no mean), or a gamma of
        shape 2, which leans to large errors.
    """

    difficulty: float = 0.5
    route_effect: float = 0.25
    run: float = 0.3
    common: float = 0.3
    tail: Tail = "normal"


def spread_over(pairs: int, routes: int) -> IntArray:
    """Route (N,) of each of N pairs, as even as they go: 30 over 12 are 6 x 3 and 6 x 2."""
    return np.sort(np.arange(pairs) % routes)


def draw_pairs(
    model: PairModel, route: IntArray, change: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Errors (N,) of a and b, in which b is ``change`` (-0.2: 20 % less) of a.

    Both sides have the same distribution but for this factor, so that it is the true ratio of
    their means, of their RMS and of their geometric means alike.
    """
    routes, n = int(route.max()) + 1, len(route)
    difficulty = model.difficulty * _unit(model.tail, rng, routes)
    common = np.sqrt(model.common) * model.run * _unit(model.tail, rng, n)
    sides = []
    for shift in (0.0, np.log1p(change)):
        effect = model.route_effect / np.sqrt(2.0) * _unit(model.tail, rng, routes)
        own = np.sqrt(1.0 - model.common) * model.run * _unit(model.tail, rng, n)
        sides.append(np.exp((difficulty + effect)[route] + common + own + shift))
    return sides[0], sides[1]


def _unit(tail: Tail, rng: np.random.Generator, size: int) -> FloatArray:
    """Numbers (size,) of mean 0 and standard deviation 1."""
    if tail == "t4":
        return np.asarray(np.clip(rng.standard_t(4, size) / np.sqrt(2.0), -8.0, 8.0))
    if tail == "skewed":
        return np.asarray((rng.gamma(2.0, size=size) - 2.0) / np.sqrt(2.0))
    return rng.normal(size=size)
