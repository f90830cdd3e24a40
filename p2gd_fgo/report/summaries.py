"""Times and events of a run, boiled down for its table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.timing import WHOLE_FRAME
from p2gd_fgo.types import Event

TOTAL_STAGE = WHOLE_FRAME
OUTSIDE_STAGE = "decode"
"""Reading the image: not counted in the frame."""


@dataclass(frozen=True, slots=True)
class StageTime:
    """Process CPU of one stage over the frames in which it ran: median and 95th percentile."""

    median_cpu_ms: float
    p95_cpu_ms: float
    frames: int


@dataclass(frozen=True, slots=True)
class EventCount:
    """Events of one kind: how many, and what the first one says."""

    kind: str
    count: int
    first_message: str


def summarize_timing(
    rows: Sequence[Mapping[str, tuple[float, float]]],
) -> dict[str, StageTime]:
    """CPU time by stage of rows (stage to CPU and wall ms), in order of first appearance.

    The stage ``frame`` is the whole of a frame and comes first; what is outside it comes last.
    Inner stages (``outer.inner``) follow their outer one.
    """
    stages = list(dict.fromkeys(stage for row in rows for stage in row))
    outer = [stage.partition(".")[0] for stage in stages]
    rank = {stage: k for k, stage in enumerate(dict.fromkeys(outer))}
    rank |= {TOTAL_STAGE: -1, OUTSIDE_STAGE: len(stages)}
    ordered = sorted(stages, key=lambda stage: rank[stage.partition(".")[0]])
    out = {}
    for stage in ordered:
        cpu_ms = np.array([row[stage][0] for row in rows if stage in row])
        median, p95 = np.percentile(cpu_ms, [50.0, 95.0]).tolist()
        out[stage] = StageTime(median, p95, len(cpu_ms))
    return out


def summarize_events(events: Iterable[Event]) -> list[EventCount]:
    """Count events by kind, in order of first appearance."""
    counts: dict[str, EventCount] = {}
    for event in events:
        known = counts.get(event.kind, EventCount(event.kind, 0, event.message))
        counts[event.kind] = EventCount(event.kind, known.count + 1, known.first_message)
    return list(counts.values())
