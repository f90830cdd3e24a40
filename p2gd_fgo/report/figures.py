"""The picture of a run: top view and errors over time."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from p2gd_fgo.atomic_files import atomic_path
from p2gd_fgo.evaluation.evaluate import ErrorSeries
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Trajectory

TRUTH, _ESTIMATE, _ROTATION = "#8a8f98", "#1f6feb", "#d9730d"
TEXT, FRAME, _ALARM = "#444", "#c7cbd1", "#b00020"
_GAP_S = 0.5  # a line is broken where two poses lie farther apart
_ALIGNED_BY = {
    "yaw_pos": "position and yaw (yaw_pos)",
    "se3": "position and rotation (se3)",
    "sim3": "position, rotation and scale (sim3)",
    "origin": "first pose (origin)",
}


def trajectory_figure(
    path: Path,
    estimate: Trajectory,
    truth: Trajectory | None,
    errors: ErrorSeries | None,
    *,
    title: str,
    note: str = "",
) -> None:
    """Write a PNG: top view; beside it the errors over time, or the height without truth.

    Parameters
    ----------
    path
        The PNG; replaced as a whole.
    estimate
        As estimated; drawn aligned where ``errors`` are given. May be empty.
    truth
        Drawn in full: give the part that the run was about.
    errors
        See :func:`p2gd_fgo.evaluation.evaluate.error_series`.
    title, note
        The heading, and a remark at the bottom (such as why a run failed).
    """
    shown = errors.aligned if errors is not None else estimate
    figure = Figure(figsize=(11.0, 5.6), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.012, ha="left", fontsize=13, fontweight="bold", parse_math=False)
    if note:
        text = textwrap.fill(note, 170)
        figure.supxlabel(text, x=0.012, ha="left", fontsize=9, color=TEXT, parse_math=False)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.15, 1.0], height_ratios=[1.5, 1.0])
    view = "not aligned" if errors is None else f"aligned by {_ALIGNED_BY[errors.alignment]}"
    _top_view(figure.add_subplot(grid[:, 0]), shown, truth, f"top view, {view}")
    start = int(estimate.stamps_ns[0]) if len(estimate) else 0
    if errors is None:
        axes = figure.add_subplot(grid[:, 1])
        height = shown.T_world_imu[:, 2, 3]
        axes.plot(*broken(shown.stamps_ns, height, start), color=_ESTIMATE, lw=1.4)
        finish(axes, "height (m)", "time since the first estimate (s)")
    else:
        upper = figure.add_subplot(grid[0, 1])
        lower = figure.add_subplot(grid[1, 1], sharex=upper)
        stamps = errors.reference.stamps_ns
        _error(upper, stamps, errors.position_m, start, _ESTIMATE, ("ATE", " m"))
        _error(lower, stamps, errors.rotation_deg, start, _ROTATION, ("ARE", "°"))
        finish(upper, "position error (m)", "")
        finish(lower, "rotation error (°)", "time since the first estimate (s)")
        upper.tick_params(labelbottom=False)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png")


def _top_view(axes: Axes, estimate: Trajectory, truth: Trajectory | None, title: str) -> None:
    if truth is not None and len(truth):
        xy = broken_path(truth)
        axes.plot(xy[:, 0], xy[:, 1], color=TRUTH, lw=3.2, alpha=0.75, label="truth")
    if len(estimate):
        xy = broken_path(estimate)
        axes.plot(xy[:, 0], xy[:, 1], color=_ESTIMATE, lw=1.4, label="estimate")
        marks = (("o", "white", "start", 0), ("s", _ESTIMATE, "end", -1))
        for marker, face, label, index in marks:
            axes.plot(
                *estimate.T_world_imu[index, :2, 3],
                ls="",
                marker=marker,
                ms=7,
                mfc=face,
                mec=_ESTIMATE,
                mew=1.6,
                label=label,
            )
    else:
        axes.text(0.5, 0.5, "no estimate", transform=axes.transAxes, ha="center", color=_ALARM)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    finish(axes, "y (m)", "x (m)")
    axes.set_title(title, loc="left", fontsize=10, color=TEXT)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", fontsize=9, framealpha=0.9, edgecolor=FRAME)


def _error(
    axes: Axes,
    stamps_ns: IntArray,
    values: FloatArray,
    start_ns: int,
    color: str,
    name_unit: tuple[str, str],
) -> None:
    seconds, shown = broken(stamps_ns, values, start_ns)
    rmse = float(np.sqrt(np.mean(values**2)))
    axes.fill_between(seconds, 0.0, shown, color=color, alpha=0.13, lw=0)
    axes.plot(seconds, shown, color=color, lw=1.4)
    axes.axhline(rmse, color="#333", lw=1.0, ls=(0, (4, 3)))
    axes.set_ylim(0.0, max(1.12 * float(values.max()), 1e-6))
    name, unit = name_unit
    text = f"{name} {rmse:.3g}{unit} RMSE (dashed), {values.max():.3g}{unit} at most"
    axes.set_title(text, loc="left", fontsize=10, color=TEXT)


def finish(axes: Axes, ylabel: str, xlabel: str) -> None:
    """Label the axes and give them the look of all figures."""
    axes.set_ylabel(ylabel)
    axes.set_xlabel(xlabel)
    axes.grid(color="#e6e8eb", lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FRAME)
    axes.tick_params(labelsize=9, color=FRAME)


def _gaps(stamps_ns: IntArray) -> IntArray:
    return np.flatnonzero(np.diff(stamps_ns) > _GAP_S * NANOSECONDS) + 1


def broken_path(trajectory: Trajectory) -> FloatArray:
    """Top view (M, 2) with a row of NaN in every gap."""
    return np.insert(trajectory.T_world_imu[:, :2, 3], _gaps(trajectory.stamps_ns), np.nan, axis=0)


def broken(stamps_ns: IntArray, values: FloatArray, start_ns: int) -> tuple[FloatArray, FloatArray]:
    """Seconds since ``start_ns`` and values, with NaN in every gap."""
    gaps = _gaps(stamps_ns)
    seconds = (stamps_ns - start_ns) / NANOSECONDS
    return np.insert(seconds, gaps, np.nan), np.insert(values, gaps, np.nan)
