"""The measures of a run that comparisons are made on, by name."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.alignment import ALIGNMENTS
from p2gd_fgo.run_record import RunRecord

WHOLE_RUN = 0.9
"""Completeness below which a run counts as one without a value: it stopped early."""

_BY_LENGTH = re.compile(r"(rte|rre)_(\d+(?:\.\d+)?)")


@dataclass(frozen=True, slots=True)
class Measure:
    """A number that a run has.

    Attributes
    ----------
    name
        For files and options.
    label, unit
        For tables and claims.
    lower_is_better
        None where neither way is.
    read
        Takes it from a record; NaN where it isn't known.
    """

    name: str
    label: str
    unit: str
    lower_is_better: bool | None
    read: Callable[[RunRecord], float]

    def of(self, record: RunRecord) -> float:
        """The number, NaN unless the run is done and whole (completeness of 0.9 or more)."""
        return self.read(record) if counts(record) else math.nan


def counts(record: RunRecord) -> bool:
    """Whether a run is done and didn't stop early."""
    share = record.metrics.get("completeness")
    return record.status == "done" and (share is None or share >= WHOLE_RUN)


def measure(name: str) -> Measure:
    """The measure of a name: one of :data:`MEASURES`, or ``rte_<m>``, ``rre_<m>``.

    Raises
    ------
    ConfigError
        There is none.
    """
    if name in MEASURES:
        return MEASURES[name]
    if match := _BY_LENGTH.fullmatch(name):
        kind, length = match[1], match[2]
        key, unit = ("percent", "%") if kind == "rte" else ("rre_deg", "°")
        return Measure(
            name, f"{kind.upper()} {length} m", unit, True, lambda r: _relative(r, length, key)
        )
    near = difflib.get_close_matches(name, MEASURES, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'? " if near else ""
    raise ConfigError(
        f"measure '{name}' is not known: {hint}it takes {', '.join(MEASURES)}, rte_<m>, rre_<m>"
    )


def _number(tree: Mapping[str, Any], *path: str) -> float:
    value: Any = tree
    for key in path:
        value = value.get(key) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) else math.nan


def _relative(record: RunRecord, length: str, key: str) -> float:
    found = (e for e in record.metrics.get("rte") or () if e["length_m"] == float(length))
    return _number(next(found, {}), key)


def _main(record: RunRecord, what: str) -> float:
    return _number(record.metrics, what, record.metrics.get("alignment", ""), "rmse")


def _error(what: str, kind: str) -> Callable[[RunRecord], float]:
    return lambda record: _number(record.metrics, what, kind, "rmse")


def _tracking(key: str) -> Callable[[RunRecord], float]:
    return lambda record: _number(record.tracking, key)


def _all() -> tuple[Measure, ...]:
    return (
        Measure("ate", "ATE", "m", True, lambda r: _main(r, "ate_m")),
        Measure("are", "ARE", "°", True, lambda r: _main(r, "are_deg")),
        Measure(
            "ate_percent", "ATE", "% of the path", True, lambda r: _number(r.metrics, "ate_percent")
        ),
        *(
            Measure(f"ate_{kind}", f"ATE {kind}", "m", True, _error("ate_m", kind))
            for kind in ALIGNMENTS
        ),
        *(
            Measure(f"are_{kind}", f"ARE {kind}", "°", True, _error("are_deg", kind))
            for kind in ALIGNMENTS
        ),
        Measure(
            "scale_error", "scale error", "", True, lambda r: abs(_number(r.metrics, "scale") - 1.0)
        ),
        Measure(
            "completeness", "completeness", "", False, lambda r: _number(r.metrics, "completeness")
        ),
        Measure("mean_length", "track length", "images", False, _tracking("mean_length")),
        Measure(
            "two_view_parallax", "two-view parallax", "°", False, _tracking("two_view_parallax_deg")
        ),
        Measure("total_parallax", "total parallax", "°", False, _tracking("total_parallax_deg")),
        Measure(
            "parallax_per_image", "parallax per image", "°", False,
            _tracking("total_parallax_per_frame_deg"),
        ),
        Measure("single_share", "tracks of one image", "", True, _tracking("single_frame_share")),
        Measure("features", "features per image", "", None, _tracking("features_per_frame")),
        Measure("tracks_3", "tracks >= 3 per image", "", False, _tracking("tracks_3_per_frame")),
        Measure("tracks_10", "tracks >= 10 per image", "", False, _tracking("tracks_10_per_frame")),
        Measure(
            "served", "features served", "", False, _tracking("quota_served_per_frame")
        ),
        Measure(
            "frame_ms", "CPU per image", "ms", True,
            lambda r: _number(r.cpu_ms, "frame", "median_cpu_ms"),
        ),
    )  # fmt: skip


MEASURES: dict[str, Measure] = {found.name: found for found in _all()}
"""Every measure with a fixed name."""
