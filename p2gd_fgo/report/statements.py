"""What may be said of many comparisons: claims first, and one sentence for each reason of none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from p2gd_fgo.evaluation.bootstrap import MIN_ROUTES, EffectKind
from p2gd_fgo.evaluation.claims import claim, is_shown, span
from p2gd_fgo.evaluation.paired import Comparison

_NOT_SHOWN = "No difference shown, the interval holds zero"
_FEW_ROUTES = f"No claim, below {MIN_ROUTES} routes there is no interval"
_NO_PAIR = "Nothing to compare, no pair is whole"
_NO_RATIO = "Nothing to compare, values not above 0 have no ratio"
_REASONS = (_NOT_SHOWN, _FEW_ROUTES, _NO_PAIR, _NO_RATIO)


@dataclass(frozen=True, slots=True)
class Statement:
    """One measure of one comparison.

    Attributes
    ----------
    about
        What is compared with what.
    measure
        Its label.
    found, kind
        The comparison, and the effect that is spoken of.
    sides
        Names of the two, for runs that are missing.
    """

    about: str
    measure: str
    found: Comparison
    kind: EffectKind
    sides: tuple[str, str]

    @property
    def reason(self) -> str:
        """Why nothing can be claimed; empty where something can (the rule is ``claim``'s)."""
        found, effect = self.found, self.found.effects.get(self.kind)
        if effect is None:
            return _NO_RATIO if found.whole else _NO_PAIR
        if found.routes < MIN_ROUTES:
            return _FEW_ROUTES
        return "" if is_shown(found, self.kind) else _NOT_SHOWN

    @property
    def _missing(self) -> int:
        return self.found.pairs - self.found.whole

    @property
    def size(self) -> str:
        """How many pairs it rests on, and how many are missing."""
        found = self.found
        text = f"n = {found.whole} over {found.routes} route{'s' if found.routes != 1 else ''}"
        if self._missing:
            text += f", {self._missing} of {found.pairs} pairs left out, failed or incomplete"
        return text

    @property
    def short(self) -> str:
        """The measure and its change, with the interval where there is one."""
        effect = self.found.effects.get(self.kind)
        if effect is None:
            return self.measure
        text = span(effect)
        if self.found.routes < MIN_ROUTES:
            text = text.partition(" [")[0]
        worst = self.found.penalised.get(self.kind) if self._missing else None
        if worst is not None and self.found.routes >= MIN_ROUTES:
            text += f" ({span(worst)} with the worst run in place of those)"
        return f"{self.measure} {text}"


def sentences(statements: Sequence[Statement]) -> list[str]:
    """One for each claim that can be made, then one for each reason why others can't."""
    said = [
        f"{claim(f'{s.about}, {s.measure}', s.found, s.kind, sides=s.sides)}."
        for s in statements
        if not s.reason
    ]
    for reason in _REASONS:
        folded = [s for s in statements if s.reason == reason]
        if folded:
            said.append(f"{reason}: {_folded(folded)}.")
    return said


def _folded(statements: Iterable[Statement]) -> str:
    """Measures of the same comparison and size together."""
    together: dict[tuple[str, str], list[str]] = {}
    for each in statements:
        together.setdefault((each.about, each.size), []).append(each.short)
    return "; ".join(
        f"{about} ({size}): {', '.join(texts)}" for (about, size), texts in together.items()
    )
