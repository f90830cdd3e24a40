"""Numbers of a run's record, NaN where it has none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from p2gd_fgo.report.pages.collection import Collection, Method, Route, Value
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.run_record import RunRecord

STAGES = ("track", "extract", "propagate", "distribute", "update")
FRAME = "frame"

_SHORTEST_M = 10.0


def metric(record: RunRecord, *path: str) -> float:
    """A number of the record's metrics, NaN where it isn't there."""
    return _dig(record.metrics, *path)


def tracking(record: RunRecord, *path: str) -> float:
    """A number of the tracks' measures, NaN where it isn't there."""
    return _dig(record.tracking, *path)


def relative(record: RunRecord, length_m: float, what: str) -> float:
    """``percent``, ``rmse_m``, ``rre_deg`` or ``pairs`` of the relative errors of one length."""
    entries = record.metrics.get("rte") or []
    return next((_dig(entry, what) for entry in entries if entry["length_m"] == length_m), math.nan)


def main_alignment(entries: Sequence[Entry]) -> str:
    """The one that all runs name, else yaw_pos, which every path determines."""
    named = {e.record.metrics.get("alignment") for e in entries} - {None}
    return str(named.pop()) if len(named) == 1 else "yaw_pos"


def rte_lengths(records: Sequence[RunRecord]) -> list[float]:
    """Lengths of the relative errors, those below 10 m only where no longer one fits."""
    entries = [entry for record in records for entry in record.metrics.get("rte") or []]
    lengths = sorted({float(entry["length_m"]) for entry in entries})
    return [length for length in lengths if length >= _SHORTEST_M] or lengths


def cpu(stage: str) -> Value:
    """Median CPU of a stage per image, ms."""

    def value(record: RunRecord) -> float:
        return _dig(record.cpu_ms, stage, "median_cpu_ms")

    return value


def stage_times(
    collection: Collection, routes: Sequence[Route], method: Method
) -> dict[str, float]:
    """CPU per image of the stages that ran and of the whole ``frame``, ms, mean over the runs."""
    found = {}
    for stage in (*STAGES, FRAME):
        values = [v for route in routes for v in collection.values(route, method, cpu(stage))]
        if values:
            found[stage] = float(np.mean(values))
    return found


def _dig(data: Mapping[str, Any], *path: str) -> float:
    found: Any = data
    for name in path:
        found = found.get(name) if isinstance(found, Mapping) else None
    return float(found) if isinstance(found, int | float) else math.nan
