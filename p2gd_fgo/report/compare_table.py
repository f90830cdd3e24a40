"""One table of several runs of the same recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Group, RenderableType
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from p2gd_fgo.evaluation.metrics import Metrics
from p2gd_fgo.evaluation.tracking_quality import TrackingQuality
from p2gd_fgo.report.layout import fitting, fixed, pairs
from p2gd_fgo.report.tables import ALIGNMENT_MEANING

FULL_WIDTH = 120
"""Columns of text that all of a row may need."""

_RTE_LENGTH_M = 10.0
_DECIMALS = 3  # at most: a row has 120 letters


@dataclass(frozen=True, slots=True)
class ComparedRun:
    """What one row is made of.

    Attributes
    ----------
    backend, distribution
        What the runs differ in.
    metrics, tracking, frame_ms
        As judged; None and NaN where the run was refused before its first image.
    status, reason
        ``done``, ``failed`` or ``refused``, and one sentence where it isn't done.
    """

    backend: str
    distribution: str
    metrics: Metrics | None
    tracking: TrackingQuality | None
    frame_ms: float
    status: str
    reason: str | None


def compare_table(
    header: Sequence[tuple[str, str]], runs: Sequence[ComparedRun], width: int = FULL_WIDTH
) -> RenderableType:
    """Lay out one row for each run.

    Parameters
    ----------
    header
        What the runs have in common: name and value, one line each.
    runs
        At least one.
    width
        Of the terminal; below ``FULL_WIDTH`` the columns are spread over two tables.
    """
    rte_lengths = _rte_lengths(runs)
    accuracy = _accuracy(runs, rte_lengths)
    rest = [
        *_tracking(runs),
        ("frame\nms", [fixed(run.frame_ms, 1) for run in runs]),
        ("compl\n%", [fixed(_completeness(run), 1) for run in runs]),
    ]
    status = [("status\n", [run.status.upper() if _ended(run) else "done" for run in runs])]
    whole = [accuracy + rest + status]
    parts = whole if width >= FULL_WIDTH else [accuracy + status, rest]
    return Group(
        Rule("compare", align="left", style="dim"),
        pairs([*header, *_legend(runs, rte_lengths)]),
        *(table for part in parts for table in ("", _table(runs, part))),
        *_reasons(runs),
    )


def _table(runs: Sequence[ComparedRun], columns: Sequence[tuple[str, list[str]]]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("back end\n", no_wrap=True)
    table.add_column("distribution\n", no_wrap=True)
    for name, _ in columns:
        table.add_column(name, justify="right", no_wrap=True)
    for k, run in enumerate(runs):
        cells = [values[k] for _, values in columns]
        style = "red" if _ended(run) else None
        table.add_row(run.backend, run.distribution, *cells, style=style)
    return table


def _ended(run: ComparedRun) -> bool:
    """Whether it ended before its time."""
    return run.status != "done"


def _accuracy(
    runs: Sequence[ComparedRun], rte_lengths: Sequence[float]
) -> list[tuple[str, list[str]]]:
    def rmse(run: ComparedRun, kind: str, *, angle: bool = False) -> float:
        accuracy = run.metrics.accuracy if run.metrics else None
        if accuracy is None:
            return math.nan
        found = (accuracy.are_deg if angle else accuracy.ate_m)[kind]
        return found.rmse if found else math.nan

    def rte(run: ComparedRun, length: float) -> float:
        accuracy = run.metrics.accuracy if run.metrics else None
        entries = accuracy.rte if accuracy else ()
        return next((e.percent for e in entries if e.length_m == length), math.nan)

    kind = _alignment(runs)
    percent = [(run.metrics.ate_percent if run.metrics else None) or math.nan for run in runs]
    return [
        ("ATE\nm", fitting([rmse(run, kind) for run in runs], 4)),
        ("%\npath", fitting(percent, _DECIMALS)),
        ("orig.\nm", fitting([rmse(run, "origin") for run in runs], 4)),
        ("ARE\n°", fitting([rmse(run, kind, angle=True) for run in runs], _DECIMALS)),
        *(
            (f"RTE %\n{n:g} m", fitting([rte(run, n) for run in runs], _DECIMALS))
            for n in rte_lengths
        ),
    ]


def _tracking(runs: Sequence[ComparedRun]) -> list[tuple[str, list[str]]]:
    known = [run.tracking for run in runs]
    two_view = [t.two_view_parallax_deg if t else math.nan for t in known]
    return [
        ("length\nimages", [fixed(t.mean_length if t else math.nan, 2) for t in known]),
        (
            "2-view\n°",
            fitting(two_view, _DECIMALS),
        ),
        ("total\n°", fitting([t.total_parallax_deg if t else math.nan for t in known], _DECIMALS)),
        ("once\n%", [fixed(100.0 * t.single_frame_share if t else math.nan, 1) for t in known]),
        ("feat.\n/img", [fixed(t.features_per_frame if t else math.nan, 1) for t in known]),
    ]


def _legend(runs: Sequence[ComparedRun], rte_lengths: Sequence[float]) -> list[tuple[str, str]]:
    kind = _alignment(runs)
    errors = f"RMSE, aligned by {kind} ({ALIGNMENT_MEANING[kind]}); orig.: by the first pose"
    if not rte_lengths:
        errors += "; RTE: no length fits"
    sources = dict.fromkeys(run.tracking.rotations for run in runs if run.tracking)
    tracks = "length, parallax and share seen once, of all tracks, alive ones included"
    if sources:
        tracks += f"; rotations from {' or '.join(sources)}"
    return [
        ("runs", f"{len(runs)}, one per row, one seed: a difference may be chance"),
        ("errors", errors),
        ("tracks", tracks),
        ("frame", "median process CPU, reading the image left out"),
    ]


def _reasons(runs: Sequence[ComparedRun]) -> list[RenderableType]:
    return [
        Text(f"{run.backend}-{run.distribution} {run.status}: {run.reason}", style="bold red")
        for run in runs
        if run.reason
    ]


def _alignment(runs: Sequence[ComparedRun]) -> str:
    return next((run.metrics.alignment for run in runs if run.metrics), "yaw_pos")


def _completeness(run: ComparedRun) -> float:
    share = run.metrics.completeness if run.metrics else None
    return 100.0 * share if share is not None else math.nan


def _rte_lengths(runs: Sequence[ComparedRun]) -> list[float]:
    """10 m where it fits, and the longest length that does in any run."""
    known = [run.metrics.accuracy.rte for run in runs if run.metrics and run.metrics.accuracy]
    lengths = sorted({entry.length_m for entries in known for entry in entries})
    return sorted({n for n in lengths if n in (_RTE_LENGTH_M, lengths[-1])})
