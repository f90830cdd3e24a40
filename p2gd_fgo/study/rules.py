"""Which runs of the product of recordings and axes a study keeps."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator

from p2gd_fgo.run_record import Label
from p2gd_fgo.study.ranges import spread


def _spread_labels(rule: Any) -> Any:
    return {name: spread(v) for name, v in rule.items()} if isinstance(rule, dict) else rule


Rule = Annotated[dict[str, Label | list[Label]], BeforeValidator(_spread_labels)]
"""Labels by axis, or by ``group``, ``route`` or ``sequence``; it fits where all of them hold."""


def is_kept(include: Sequence[Rule], exclude: Sequence[Rule], labels: Mapping[str, str]) -> bool:
    """Whether one rule of ``include`` fits, if there is any, and none of ``exclude``."""
    wanted = not include or any(_fits(rule, labels) for rule in include)
    return wanted and not any(_fits(rule, labels) for rule in exclude)


def check_rules(rules: Sequence[Rule], known: Mapping[str, Collection[str]]) -> None:
    """Refuse a rule that can't fit.

    Parameters
    ----------
    known
        The labels on each axis, and the names of groups, routes and sequences.

    Raises
    ------
    ValueError
        A name or a label that isn't there.
    """
    for rule in rules:
        for name, wanted in rule.items():
            if name not in known:
                raise ValueError(
                    f"a rule names '{name}', which is no axis: there are {', '.join(known)}"
                )
            for option in _options(wanted):
                if option not in known[name]:
                    near = difflib.get_close_matches(option, known[name], n=1, cutoff=0.5)
                    hint = f"did you mean '{near[0]}'?" if near else _few(known[name])
                    raise ValueError(f"a rule names {name} '{option}', which there isn't: {hint}")


def _few(known: Collection[str], most: int = 12) -> str:
    names = list(known)
    return f"there are {', '.join(names[:most])}{', …' * (len(names) > most)}"


def _fits(rule: Rule, labels: Mapping[str, str]) -> bool:
    return all(labels.get(name) in _options(wanted) for name, wanted in rule.items())


def _options(wanted: Label | list[Label]) -> list[str]:
    return [str(option) for option in (wanted if isinstance(wanted, list) else [wanted])]
