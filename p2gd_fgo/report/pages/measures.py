"""Measures that tables and figures of a report add to those that comparisons are made on."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from p2gd_fgo.evaluation.measures import Measure
from p2gd_fgo.report.pages.collection import Collection, Method, Route
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.run_record import RunRecord

STAGES = ("track", "extract", "propagate", "distribute", "update")
FRAME = "frame"

_SHORTEST_M = 10.0


def length_share(length: int) -> Measure:
    """Percent of the tracks that have exactly this length."""

    def read(record: RunRecord) -> float:
        share = (record.tracking.get("length_shares") or {}).get(str(length))
        return 100.0 * share if share is not None else math.nan

    return Measure(f"share_{length}", f"tracks of {length}", "%", None, read)


def cpu(stage: str) -> Measure:
    """Median CPU of a stage per image."""

    def read(record: RunRecord) -> float:
        return float((record.cpu_ms.get(stage) or {}).get("median_cpu_ms", math.nan))

    return Measure(f"{stage}_ms", f"CPU, {stage}", "ms", True, read)


def completeness(record: RunRecord) -> float:
    """Share of the images with an estimate, NaN where it isn't known."""
    share = record.metrics.get("completeness")
    return float(share) if share is not None else math.nan


def rte_lengths(records: Sequence[RunRecord]) -> list[float]:
    """Lengths of the relative errors, those below 10 m only where no longer one fits."""
    entries = [entry for record in records for entry in record.metrics.get("rte") or []]
    lengths = sorted({float(entry["length_m"]) for entry in entries})
    return [length for length in lengths if length >= _SHORTEST_M] or lengths


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


def main_alignment(entries: Sequence[Entry]) -> str:
    """The one that all runs name, else yaw_pos, which every path determines."""
    named = {e.record.metrics.get("alignment") for e in entries} - {None}
    return str(named.pop()) if len(named) == 1 else "yaw_pos"
