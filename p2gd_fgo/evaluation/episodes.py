"""From which episodes the difference between two runs comes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.bootstrap import MIN_ROUTES, Effect, by_route, effect
from p2gd_fgo.evaluation.segments import Segment
from p2gd_fgo.types import FloatArray

STANDING, TURNING, MOVING, STRAIGHT = "standing", "turning", "moving objects", "straight on"
KINDS = (STANDING, TURNING, MOVING, STRAIGHT)
ALL = "all"

STILL_SHARE = 0.1
TURN_DEG_PER_M = 2.0
MOVING_SHARE = 0.02

_ERRORS = ("translation_percent", "rotation_deg", "scale_error", "ate_made_m")


@dataclass(frozen=True, slots=True)
class SegmentPair:
    """One piece of the way in two runs."""

    route: str
    a: Segment
    b: Segment

    @property
    def kind(self) -> str:
        """What happened in it."""
        return kind_of(self.a)

    @property
    def excess(self) -> float:
        """What b's squared translation error has over a's, m²."""
        return self.b.translation_m**2 - self.a.translation_m**2


@dataclass(frozen=True, slots=True)
class EpisodeRow:
    """The pieces of one kind, b against a.

    Attributes
    ----------
    kind
        One of :data:`KINDS`, or ``all``.
    pieces, routes
        How many, on how many routes.
    a, b
        Means over the pieces: ``translation_percent``, ``rotation_deg``, ``scale_error`` (of its
        size), ``ate_made_m`` and the measures per image.
    translation, rotation
        Difference of the mean errors, in percent of the length and in degrees.
    part
        Share in the change of the mean square of the translation error: the parts of the kinds
        add up to that of ``all``, which is b's mean square over a's, minus 1.
    over
        What the intervals resample: ``routes`` from 3 on, and then the pieces of each; otherwise
        ``pieces``, and then they speak of these recordings alone.
    """

    kind: str
    pieces: int
    routes: int
    a: Mapping[str, float]
    b: Mapping[str, float]
    translation: Effect
    rotation: Effect
    part: float
    over: str


def kind_of(segment: Segment) -> str:
    """What a piece of the way is, the first of these that holds.

    ``standing``: a tenth of its time or more below 0.05 m/s; ``turning``: 2° a metre or more (20°
    in 10 m); ``moving objects``: over 2 % and more of the image; otherwise ``straight on``. All of
    it is known from the truth and the recording, so that a piece is of one kind in every run.
    """
    if segment.still_share >= STILL_SHARE:
        return STANDING
    if segment.turn_deg >= TURN_DEG_PER_M * segment.length_m:
        return TURNING
    return MOVING if segment.moving_share >= MOVING_SHARE else STRAIGHT


def pair_segments(
    a: Sequence[Segment], b: Sequence[Segment], route: str
) -> tuple[SegmentPair, ...]:
    """Pair the pieces that both runs cover; the runs are of the same recording.

    Raises
    ------
    DataError
        A piece lies elsewhere in the one than in the other: other recordings or other lengths.
    """
    others = {segment.index: segment for segment in b}
    pairs = []
    for mine in a:
        other = others.get(mine.index)
        if other is None:
            continue
        if abs(mine.start_m - other.start_m) > 0.01 or abs(mine.start_s - other.start_s) > 0.2:
            raise DataError(
                f"piece {mine.index} of {route} begins at {mine.start_m:.2f} m, "
                f"{mine.start_s:.1f} s in one run and at {other.start_m:.2f} m, "
                f"{other.start_s:.1f} s in the other: give two runs of the same recording"
            )
        pairs.append(SegmentPair(route, mine, other))
    return tuple(pairs)


def compare_episodes(
    pairs: Sequence[SegmentPair], *, level: float = 0.95, draws: int = 2000, seed: int = 0
) -> tuple[EpisodeRow, ...]:
    """Average the pairs by kind: a row for each kind that occurs, and one for all.

    Parameters
    ----------
    pairs
        Of one pair of runs or of many; those of one route belong together.
    level, draws, seed
        Of the intervals, see :func:`effect`.

    Raises
    ------
    DataError
        No pairs.
    """
    if not pairs:
        raise DataError("the two runs have no piece of the way in common")
    total = sum(pair.a.translation_m**2 for pair in pairs)
    options = {"level": level, "draws": draws, "seed": seed}
    kinds = {kind: [pair for pair in pairs if pair.kind == kind] for kind in KINDS}
    groups = {kind: chosen for kind, chosen in kinds.items() if chosen} | {ALL: list(pairs)}
    return tuple(_row(kind, chosen, total, options) for kind, chosen in groups.items())


def largest(pairs: Sequence[SegmentPair], count: int = 5) -> tuple[SegmentPair, ...]:
    """The pieces whose squared errors differ most, to either side, the largest first."""
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.excess))[:count])


def _row(
    kind: str, pairs: Sequence[SegmentPair], total: float, options: Mapping[str, Any]
) -> EpisodeRow:
    routes = {pair.route for pair in pairs}
    by_routes = len(routes) >= MIN_ROUTES
    labels = [pair.route for pair in pairs] if by_routes else list(range(len(pairs)))

    def difference(name: str) -> Effect:
        a, b = (np.array([getattr(side, name) for side in sides]) for sides in
                zip(*((pair.a, pair.b) for pair in pairs), strict=True))  # fmt: skip
        found = effect(by_route(a, b, labels), "difference", **options)
        assert found is not None
        return found

    excess = sum(pair.excess for pair in pairs)
    return EpisodeRow(
        kind=kind,
        pieces=len(pairs),
        routes=len(routes),
        a=_means([pair.a for pair in pairs]),
        b=_means([pair.b for pair in pairs]),
        translation=difference("translation_percent"),
        rotation=difference("rotation_deg"),
        part=excess / total if total else 0.0,
        over="routes" if by_routes else "pieces",
    )


def _means(found: Sequence[Segment]) -> dict[str, float]:
    values = {name: np.array([abs(getattr(s, name)) for s in found]) for name in _ERRORS}
    values["ate_made_m"] = np.array([s.ate_made_m for s in found])
    names = dict.fromkeys(name for s in found for name in s.measures)
    values |= {name: np.array([s.measures.get(name, np.nan) for s in found]) for name in names}
    return {name: _mean(column) for name, column in values.items()}


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
