"""What may be said of a comparison: its interval says it, never a single pair."""

from __future__ import annotations

import math

from p2gd_fgo.evaluation.bootstrap import MIN_ROUTES, Effect, EffectKind
from p2gd_fgo.evaluation.paired import Comparison

_MINUS = "\u2212"
_MOST_PERCENT = 999.0  # few routes can leave an end anywhere; beyond, its digits say nothing


def claim(
    name: str,
    found: Comparison,
    kind: EffectKind = "mean",
    *,
    sides: tuple[str, str] = ("a", "b"),
    unit: str = "",
) -> str:
    """One line: "ATE −18 % [−27, −8], n = 60 over 12 routes", or that no difference is shown.

    Parameters
    ----------
    name
        Of the measure.
    kind
        Which effect.
    sides
        Names of a and b, for the runs that are missing.
    unit
        Of a ``difference``.

    A difference is claimed only if the interval excludes zero, and, where runs failed, the
    interval with the worst value in their place does too, on the same side.
    """
    effect = found.effects.get(kind)
    size = f"n = {found.whole} over {found.routes} route{'s' if found.routes != 1 else ''}"
    left_out = _left_out(found, sides)
    if effect is None:
        reason = "no pair is whole" if not found.whole else "values not above 0 have no ratio"
        return f"{name}: nothing to compare, {reason}{left_out}"
    if found.routes < MIN_ROUTES:
        change = f"{_number(effect.change, effect, unit)}{_unit(effect, unit)}"
        return (
            f"{name}: no claim, {change} by {size}, at least {MIN_ROUTES} routes are needed"
            f"{left_out}"
        )
    worst = found.penalised.get(kind) if left_out else None
    if worst is not None:
        left_out += f", {span(worst, unit)} with the worst run in their place"
    shown = is_shown(found, kind)
    said = f"{name} " if shown else f"{name}: no difference shown, "
    return f"{said}{span(effect, unit)}, {size}{left_out}"


def is_shown(found: Comparison, kind: EffectKind) -> bool:
    """Whether a difference may be claimed, by the rule of :func:`claim`.

    Where no way of a measure is the better one there is no worst run: whole pairs decide alone.
    """
    effect, worst = found.effects.get(kind), found.penalised.get(kind)
    if effect is None or effect.verdict == "not shown":
        return False
    if found.pairs == found.whole or found.better_share is None:
        return True
    return worst is not None and worst.verdict == effect.verdict


def span(effect: Effect, unit: str = "") -> str:
    """The change with its interval: "−18 % [−27, −8]"."""
    numbers = [_number(v, effect, unit) for v in (effect.change, effect.low, effect.high)]
    return f"{numbers[0]}{_unit(effect, unit)} [{numbers[1]}, {numbers[2]}]"


def _left_out(found: Comparison, sides: tuple[str, str]) -> str:
    missing = found.pairs - found.whole
    if not missing:
        return ""
    counts = zip(sides, (found.missing_a, found.missing_b), strict=True)
    runs = ", ".join(f"{number} of {side}" for side, number in counts if number)
    return f"; {missing} of {found.pairs} pairs left out, failed or incomplete: {runs}"


def _unit(effect: Effect, unit: str) -> str:
    if effect.kind != "difference":
        return " %"
    return f" {unit}" if unit else ""


def _number(value: float, effect: Effect, unit: str) -> str:
    """With its sign, and so many decimals that no end of the interval rounds to zero."""
    if not math.isfinite(value):
        return "?"
    scale = 1.0 if effect.kind == "difference" else 100.0
    if effect.kind != "difference" and scale * value > _MOST_PERCENT:
        return f"> +{_MOST_PERCENT:.0f}"
    ends = [abs(scale * v) for v in (effect.low, effect.high) if math.isfinite(v) and v]
    smallest = min(ends, default=abs(scale * value))
    if effect.kind == "difference":
        decimals = max(0, min(6, 1 - math.floor(math.log10(smallest)))) if smallest else 0
    else:
        decimals = next((d for d in (0, 1) if smallest >= 0.5 * 10**-d), 2)
    text = f"{scale * value:+.{decimals}f}".replace("-", _MINUS)
    return text if any(c in "123456789" for c in text) else text.lstrip(f"+{_MINUS}")
