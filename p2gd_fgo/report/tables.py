"""Tables for the terminal: a run, and an evaluation alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.panel import Panel
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from p2gd_fgo.evaluation.metrics import Accuracy, Metrics
from p2gd_fgo.evaluation.trajectory_errors import RelativeError
from p2gd_fgo.report.summaries import OUTSIDE_STAGE, TOTAL_STAGE, EventCount, StageTime

ALIGNMENT_MEANING = {
    "yaw_pos": "position + yaw",
    "se3": "6 degrees of freedom",
    "sim3": "with scale",
    "origin": "first pose only",
}
_PARTIAL = 0.9  # below this completeness the table says so aloud
_NONE = "–"


def run_table(
    header: Sequence[tuple[str, str]],
    metrics: Metrics | None,
    timing: Mapping[str, StageTime],
    status: tuple[str, str | None],
    events: Sequence[EventCount],
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
    """
    parts: list[RenderableType] = [Rule("run", align="left", style="dim"), _pairs(header)]
    parts += _warnings(metrics, status)
    if metrics is not None and metrics.frames:
        parts += _metrics(metrics)
    if timing:
        parts += [_title("CPU time per frame"), _timing(timing)]
    if events:
        parts += [_title("events"), _events(events)]
    return Group(*parts)


def evaluate_table(metrics: Metrics) -> RenderableType:
    """Lay out the errors of a trajectory whose run isn't known."""
    return Group(*_metrics(metrics))


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
        title = f"absolute errors, RMSE unless said · main alignment: {kind}"
        parts += [
            _title(f"{title} ({ALIGNMENT_MEANING[kind]})"),
            _absolute(accuracy, kind),
        ]
        if accuracy.rte:
            tolerance = f"{100 * accuracy.rte_tolerance:g} %"
            parts += [
                _title(f"relative errors, RMSE over all pairs, length ± {tolerance} of the truth"),
                _relative(accuracy.rte),
            ]
    return [*parts, _title("coverage"), _pairs(_facts(metrics))]


def _absolute(accuracy: Accuracy, main: str) -> Table:
    table = _grid("alignment", "ATE m", "% path", "median m", "max m", "ARE °", "max °")
    known = {
        kind: (ate, are)
        for kind, ate in accuracy.ate_m.items()
        if ate is not None and (are := accuracy.are_deg[kind]) is not None
    }
    per_path = 100.0 / accuracy.path_length_m if accuracy.path_length_m > 0 else math.nan
    columns = [
        _column([ate.rmse for ate, _ in known.values()]),
        _column([ate.rmse * per_path for ate, _ in known.values()]),
        _column([ate.median for ate, _ in known.values()]),
        _column([ate.max for ate, _ in known.values()]),
        _column([are.rmse for _, are in known.values()]),
        _column([are.max for _, are in known.values()]),
    ]
    cells = dict(zip(known, zip(*columns, strict=True), strict=True))
    for kind in accuracy.ate_m:
        name, style = (f"{kind} ◂", "bold") if kind == main else (kind, None)
        table.add_row(name, *cells.get(kind, [_NONE] * len(columns)), style=style)
    return table


def _relative(rte: Sequence[RelativeError]) -> Table:
    table = _grid("length m", "RTE m", "RTE %", "RRE °", "pairs")
    columns = [
        [f"{entry.length_m:g}" for entry in rte],
        _column([entry.rmse_m for entry in rte]),
        _column([entry.percent for entry in rte]),
        _column([entry.rre_deg for entry in rte]),
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
        ("end drift", f"{_number(drift.position_m)} m, {drift.rotation_deg:.3f}° (origin)"),
    ]


def _timing(timing: Mapping[str, StageTime]) -> Table:
    table = _grid("stage", "median ms", "p95 ms", "frames")
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


def _pairs(pairs: Sequence[tuple[str, str]]) -> Table:
    table = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in pairs:
        table.add_row(name, Text(value))
    return table


def _grid(first: str, *others: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _title(text: str) -> RenderableType:
    return Padding(Rule(text, align="left", style="dim"), (1, 0, 0, 0))


def _column(values: Sequence[float]) -> list[str]:
    """Numbers with the same decimals, so many that the largest shows four digits or more."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    decimals = next((d for limit, d in ((0.1, 5), (1.0, 4), (100.0, 3)) if largest < limit), 2)
    return [f"{value:.{decimals}f}" if math.isfinite(value) else _NONE for value in values]


def _number(value: float) -> str:
    return _column([value])[0]
