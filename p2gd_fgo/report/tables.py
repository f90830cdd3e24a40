"""Tables for the terminal: a run, and an evaluation alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from p2gd_fgo.evaluation.metrics import Accuracy, Metrics
from p2gd_fgo.evaluation.tracking_quality import LENGTHS, TrackingQuality
from p2gd_fgo.evaluation.trajectory_errors import RelativeError
from p2gd_fgo.report.layout import NONE, column, fixed, grid, pairs, title
from p2gd_fgo.report.summaries import OUTSIDE_STAGE, TOTAL_STAGE, EventCount, StageTime

ALIGNMENT_MEANING = {
    "yaw_pos": "position + yaw",
    "se3": "6 degrees of freedom",
    "sim3": "with scale",
    "origin": "first pose only",
}
_PARTIAL = 0.9  # below this completeness the table says so aloud


def run_table(
    header: Sequence[tuple[str, str]],
    metrics: Metrics | None,
    timing: Mapping[str, StageTime],
    status: tuple[str, str | None],
    events: Sequence[EventCount],
    tracking: TrackingQuality | None = None,
) -> RenderableType:
    """Lay out the report of a run.

    Parameters
    ----------
    header
        What was chosen: name and value, one line each.
    metrics
        None where the run ended before there was anything to count.
    timing
        CPU by stage, see :func:`summarize_timing`.
    status
        State (``done``, ``failed``, ``running``) and the reason where it failed.
    events
        Counts by kind, see :func:`summarize_events`.
    tracking
        None where no image was processed.
    """
    parts: list[RenderableType] = [Rule("run", align="left", style="dim"), pairs(header)]
    parts += _warnings(metrics, status)
    if metrics is not None and metrics.frames:
        parts += _metrics(metrics)
    if tracking is not None and tracking.tracks:
        parts += _tracking(tracking)
    if timing:
        parts += [title("CPU time per frame"), _timing(timing)]
    if events:
        parts += [title("events"), _events(events)]
    return Group(*parts)


def evaluate_table(metrics: Metrics) -> RenderableType:
    """Lay out the errors of a trajectory whose run isn't known."""
    return Group(*_warnings(metrics, ("done", None)), *_metrics(metrics))


def _warnings(metrics: Metrics | None, status: tuple[str, str | None]) -> list[RenderableType]:
    state, reason = status
    lines = []
    if state != "done":
        what = "THE RUN FAILED" if state == "failed" else f"THE RUN IS NOT FINISHED ({state})"
        lines.append(f"{what}{': ' + reason if reason else ''}")
    share = metrics.completeness if metrics else None
    if metrics is not None and metrics.frames and share is not None and share < _PARTIAL:
        lines.append(
            f"PARTIAL: only {metrics.frames} of {metrics.frames_total} images have an estimate "
            f"({100 * share:.1f} %); all errors are of this part alone"
        )
    if metrics is not None and metrics.frames_total and metrics.frames > metrics.frames_total:
        lines.append(
            f"COMPLETENESS UNKNOWN: {metrics.frames} poses are not one for each of "
            f"{metrics.frames_total} images, so their number doesn't say how far they go"
        )
    coverage = metrics.truth_coverage if metrics else None
    if metrics and metrics.accuracy and coverage is not None and coverage < _PARTIAL:
        lines.append(
            f"TRUTH IS PARTIAL: {metrics.accuracy.frames_compared} of {metrics.frames} estimates "
            "are compared"
        )
    if metrics is not None and metrics.frames and metrics.accuracy is None:
        lines.append("NO TRUTH TO COMPARE WITH: nothing can be said about accuracy")
    if not lines:
        return []
    failed = state == "failed"
    text = Text("\n".join(lines), style="bold red" if failed else "bold yellow")
    return [Panel(text, border_style="red" if failed else "yellow", box=box.HEAVY)]


def _metrics(metrics: Metrics) -> list[RenderableType]:
    accuracy = metrics.accuracy
    parts: list[RenderableType] = []
    if accuracy is not None:
        kind = metrics.alignment
        head = f"absolute errors, RMSE unless said · main alignment: {kind}"
        parts += [
            title(f"{head} ({ALIGNMENT_MEANING[kind]})"),
            _absolute(accuracy, kind),
        ]
        if accuracy.rte:
            tolerance = f"{100 * accuracy.rte_tolerance:g} %"
            parts += [
                title(f"relative errors, RMSE over all pairs, length ± {tolerance} of the truth"),
                _relative(accuracy.rte),
            ]
    return [*parts, title("coverage"), pairs(_facts(metrics))]


def _absolute(accuracy: Accuracy, main: str) -> Table:
    table = grid("alignment", "ATE m", "% path", "median m", "max m", "ARE °", "max °")
    known = {
        kind: (ate, are)
        for kind, ate in accuracy.ate_m.items()
        if ate is not None and (are := accuracy.are_deg[kind]) is not None
    }
    per_path = 100.0 / accuracy.path_length_m if accuracy.path_length_m > 0 else math.nan
    columns = [
        column([ate.rmse for ate, _ in known.values()]),
        column([ate.rmse * per_path for ate, _ in known.values()]),
        column([ate.median for ate, _ in known.values()]),
        column([ate.max for ate, _ in known.values()]),
        column([are.rmse for _, are in known.values()]),
        column([are.max for _, are in known.values()]),
    ]
    cells = dict(zip(known, zip(*columns, strict=True), strict=True))
    for kind in accuracy.ate_m:
        name, style = (f"{kind} ◂", "bold") if kind == main else (kind, None)
        table.add_row(name, *cells.get(kind, [NONE] * len(columns)), style=style)
    return table


def _relative(rte: Sequence[RelativeError]) -> Table:
    table = grid("length m", "RTE m", "RTE %", "RRE °", "pairs")
    columns = [
        [f"{entry.length_m:g}" for entry in rte],
        column([entry.rmse_m for entry in rte]),
        column([entry.percent for entry in rte]),
        column([entry.rre_deg for entry in rte]),
        [str(entry.pairs) for entry in rte],
    ]
    for row in zip(*columns, strict=True):
        table.add_row(*row)
    return table


def _facts(metrics: Metrics) -> list[tuple[str, str]]:
    share, accuracy = metrics.completeness, metrics.accuracy
    frames = f"{metrics.frames} estimates"
    if share is not None:
        frames = f"{100 * share:.1f} % ({metrics.frames} of {metrics.frames_total} images)"
    facts = [("completeness" if share is not None else "frames", frames)]
    if accuracy is None:
        return [*facts, ("duration", f"{metrics.duration_s:.1f} s")]
    scale = "not determined by this path"
    if accuracy.scale is not None:
        scale = f"{accuracy.scale:.4f} (sim3: the estimate times this fits the truth)"
    drift = accuracy.final_drift
    return [
        *facts,
        ("compared", f"{accuracy.frames_compared} poses with truth"),
        ("path", f"{accuracy.path_length_m:.1f} m in {metrics.duration_s:.1f} s"),
        ("scale", scale),
        ("end drift", f"{column([drift.position_m])[0]} m, {drift.rotation_deg:.3f}° (origin)"),
    ]


def _tracking(quality: TrackingQuality) -> list[RenderableType]:
    head = f"tracking · {quality.tracks} tracks, alive ones included · rotations from"
    shares = [quality.length_shares[n] for n in LENGTHS]
    by_track = grid("mean length", "two-view °", "total °", "% of length 1", *map(str, LENGTHS[1:]))
    by_track.add_row(
        fixed(quality.mean_length, 2),
        column([quality.two_view_parallax_deg])[0],
        column([quality.total_parallax_deg])[0],
        *(fixed(100.0 * share, 1) for share in shares),
    )
    by_image = grid("per image: features", "quota", "served", "parallax °", "tracks ≥ 3", "≥ 10")
    by_image.add_row(
        fixed(quality.features_per_frame, 1),
        fixed(quality.quota_asked_per_frame, 1),
        fixed(quality.quota_served_per_frame, 1),
        fixed(quality.total_parallax_per_frame_deg, 1),
        fixed(quality.tracks_3_per_frame, 2),
        fixed(quality.tracks_10_per_frame, 2),
    )
    parts: list[RenderableType] = [title(f"{head} {quality.rotations}"), by_track, by_image]
    if quality.frames_without_rotation:
        parts.append(
            Text(
                f"{quality.frames_without_rotation} of {quality.frames} images have no rotation: "
                f"{quality.pairs_left_out} pairs are missing from the parallax",
                style="dim",
            )
        )
    return parts


def _timing(timing: Mapping[str, StageTime]) -> Table:
    table = grid("stage", "median ms", "p95 ms", "frames")
    for stage, time in timing.items():
        outer, _, inner = stage.partition(".")
        name = f"  {inner}" if inner else outer
        table.add_row(
            f"{name} (not in the frame)" if stage == OUTSIDE_STAGE else name,
            f"{time.median_cpu_ms:.2f}",
            f"{time.p95_cpu_ms:.2f}",
            str(time.frames),
            style="bold" if stage == TOTAL_STAGE else None,
        )
    return table


def _events(events: Sequence[EventCount]) -> Table:
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    table.add_column(justify="right")
    table.add_column(style="yellow", no_wrap=True)
    table.add_column(overflow="fold")
    for event in events:
        table.add_row(f"{event.count} ×", event.kind, Text(event.first_message))
    return table
