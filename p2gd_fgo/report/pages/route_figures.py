"""Figures of one route: the way of every method, and its errors over time (paper Figs. 6, 7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.evaluate import ErrorSeries, error_series
from p2gd_fgo.report.figures import TRUTH, broken, broken_path, finish
from p2gd_fgo.report.pages.collection import Collection, Method, Route
from p2gd_fgo.report.pages.figures import ReportFigure, legend, new_figure
from p2gd_fgo.report.pages.styles import Style
from p2gd_fgo.report.tables import ALIGNMENT_MEANING
from p2gd_fgo.trajectory_files import read_tum
from p2gd_fgo.types import NANOSECONDS, Trajectory

MOST_LINES = 8
_MARKERS = 9  # along a line


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRoute:
    """What is drawn of a route: one seed of the methods whose runs were kept.

    Attributes
    ----------
    seed
        The lowest that most methods have.
    truth
        During the estimates.
    errors
        By method.
    left_out
        Methods with runs that aren't drawn.
    """

    route: Route
    seed: int
    truth: Trajectory
    errors: Mapping[Method, ErrorSeries]
    left_out: int


def read_route(collection: Collection, route: Route, alignment: str) -> DrawnRoute | None:
    """Read the trajectories of a route; None where no run was kept, or none has truth."""
    methods = collection.methods_of(route.group)
    kept: dict[int, dict[Method, Path]] = {}
    for method in methods:
        for entry in collection.runs(route, method):
            if entry.folder is not None and (entry.folder / "truth.tum").exists():
                kept.setdefault(entry.record.seed, {})[method] = entry.folder
    if not kept:
        return None
    seed = min(kept, key=lambda s: (-len(kept[s]), s))
    errors, truth = {}, None
    for method, folder in list(kept[seed].items())[:MOST_LINES]:
        try:
            truth = read_tum(folder / "truth.tum")
            errors[method] = error_series(read_tum(folder / "estimate.tum"), truth, alignment)
        except DataError:  # too short to be compared, which its row in the tables says
            continue
    if truth is None or not errors:
        return None
    first = min(int(e.reference.stamps_ns[0]) for e in errors.values())
    last = max(int(e.reference.stamps_ns[-1]) for e in errors.values())
    during = (truth.stamps_ns >= first) & (truth.stamps_ns <= last)
    left_out = sum(bool(collection.runs(route, m)) for m in methods) - len(errors)
    shown = Trajectory(truth.stamps_ns[during], truth.T_world_imu[during])
    return DrawnRoute(route, seed, shown, errors, left_out)


def trajectory_figure(
    drawn: DrawnRoute, looks: Mapping[Method, Style], alignment: str
) -> ReportFigure:
    """The truth and every method from above."""
    figure = new_figure(1.1)
    axes = figure.add_subplot()
    xy = broken_path(drawn.truth)
    lines = axes.plot(xy[:, 0], xy[:, 1], color=TRUTH, lw=3.4, alpha=0.75)
    for method, errors in drawn.errors.items():
        look, path = looks[method], broken_path(errors.aligned)
        lines += axes.plot(*path.T, lw=1.2, **_line(look, len(lines), len(path)))
    start = drawn.truth.T_world_imu[0, :2, 3]
    axes.plot(*start, ls="", marker="o", ms=7, mfc="white", mec=TRUTH, mew=1.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    finish(axes, "y (m)", "x (m)")
    legend(figure, lines, ["truth", *(looks[method].name for method in drawn.errors)])
    caption = f"From above; circle: start. {_which(drawn, alignment)}"
    return ReportFigure("trajectory", f"Trajectories, {drawn.route.name}", caption, figure)


def error_figure(drawn: DrawnRoute, looks: Mapping[Method, Style], alignment: str) -> ReportFigure:
    """Position and rotation error over time."""
    figure = new_figure(1.1)
    upper, lower = figure.subplots(2, 1, sharex=True)
    start = min(int(errors.reference.stamps_ns[0]) for errors in drawn.errors.values())
    lines: list[Line2D] = []
    for method, errors in drawn.errors.items():
        look, stamps = looks[method], errors.reference.stamps_ns
        for axes, values in ((upper, errors.position_m), (lower, errors.rotation_deg)):
            seconds, shown = broken(stamps, values, start)
            line = axes.plot(seconds, shown, lw=1.2, **_line(look, len(lines), len(seconds)))
        lines += line
    for axes in (upper, lower):
        axes.set_ylim(bottom=0.0)
    finish(upper, "position error (m)", "")
    finish(lower, "rotation error (°)", "time (s)")
    lower.set_xlim(0.0, _longest_s(drawn, start))
    legend(figure, lines, [looks[method].name for method in drawn.errors])
    title = f"Errors over time, {drawn.route.name}"
    return ReportFigure("errors", title, _which(drawn, alignment), figure)


def _line(look: Style, number: int, points: int) -> dict[str, Any]:
    """A line's look; its markers, which tell it apart without colours, lie between the others'."""
    every = max(points // _MARKERS, 1)
    return {
        "color": look.color, "linestyle": look.dashes, "marker": look.marker,
        "markersize": 4.5, "markerfacecolor": "white", "markeredgewidth": 1.1,
        "markevery": (number * every // MOST_LINES, every),
    }  # fmt: skip


def _longest_s(drawn: DrawnRoute, start_ns: int) -> float:
    ends = [int(errors.reference.stamps_ns[-1]) for errors in drawn.errors.values()]
    return float(max(np.ceil((max(ends) - start_ns) / NANOSECONDS), 1.0))


def _which(drawn: DrawnRoute, alignment: str) -> str:
    text = (
        f"Aligned by {alignment} ({ALIGNMENT_MEANING[alignment]}); one run each, seed {drawn.seed}"
    )
    if drawn.left_out:
        text += f"; not drawn: {drawn.left_out} of the methods"
    return text + "."
