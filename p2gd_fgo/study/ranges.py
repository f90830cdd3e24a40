"""``200..211`` in a study's file: whole numbers without writing each."""

from __future__ import annotations

import re
from typing import Any

_RANGE = re.compile(r"(\d+)\.\.(\d+)")
_MOST = 100_000


def spread(value: Any) -> Any:
    """``"200..211"`` as the list of these numbers, alone or in a list; all else as it is.

    Raises
    ------
    ValueError
        An empty range, or one of more than 100,000 numbers.
    """
    if isinstance(value, list):
        return [item for given in value for item in _numbers(given) or [given]]
    return _numbers(value) or value


def _numbers(value: Any) -> list[int]:
    ends = _RANGE.fullmatch(value) if isinstance(value, str) else None
    if ends is None:
        return []
    first, last = int(ends[1]), int(ends[2])
    if not first <= last < first + _MOST:
        raise ValueError(f"the range {value} is empty or too long: give FIRST..LAST")
    return list(range(first, last + 1))
