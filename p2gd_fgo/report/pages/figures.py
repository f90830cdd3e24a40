"""Figures over many runs: relative errors, track lengths, times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from p2gd_fgo.evaluation.measures import measure
from p2gd_fgo.evaluation.tracking_quality import LENGTHS
from p2gd_fgo.report.figures import TEXT, finish
from p2gd_fgo.report.pages.collection import Collection, Method
from p2gd_fgo.report.pages.measures import length_share, rte_lengths, stage_times
from p2gd_fgo.report.pages.styles import Style
from p2gd_fgo.run_directory import TRACKS
from p2gd_fgo.types import FloatArray

SIZE_IN = (5.8, 3.9)
MOST_METHODS = 8  # that colours and markers tell apart
_LEGEND_LETTERS = 75  # that fit across a figure
_BOX_FROM = 5  # fewer values are shown as points alone
_STAGES_SHOWN = {  # colour and hatch
    "track": ("#4c78a8", ""), "extract": ("#72b7b2", "///"), "propagate": ("#8c8582", "..."),
    "distribute": ("#e45756", "xxx"), "update": ("#f2a541", "\\\\\\"), "other": ("#dddddd", ""),
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class ReportFigure:
    """A figure with all that its reader must know.

    Attributes
    ----------
    key
        File name without suffix.
    title, caption
        Heading and what is drawn, of which runs, under which alignment.
    figure
        Of matplotlib.
    """

    key: str
    title: str
    caption: str
    figure: Figure


def new_figure(height: float = 1.0) -> Figure:
    """An empty figure of the report's size, its height times this."""
    figure = Figure(figsize=(SIZE_IN[0], height * SIZE_IN[1]), dpi=160, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def legend(figure: Figure, handles: Sequence[Any], names: Sequence[str]) -> None:
    """A legend below the axes; a handle is an artist, or a tuple of some drawn over each other."""
    most = max(1, _LEGEND_LETTERS // (max(map(len, names), default=1) + 7))
    rows = math.ceil(len(names) / most)
    shown = figure.legend(
        handles, names, loc="outside lower left",
        ncols=max(1, math.ceil(len(names) / max(rows, 1))), fontsize=9, frameon=False,
        labelcolor=TEXT, handlelength=2.4, columnspacing=1.4,
    )  # fmt: skip
    for text in shown.get_texts():
        text.set_parse_math(False)


def rte_figure(
    collection: Collection, group: str, looks: Mapping[Method, Style]
) -> ReportFigure | None:
    """Box plots of the runs' RTE by length (paper Figs. 8, 11 and 12); None without any."""
    routes, methods = collection.of(group), collection.methods_of(group)
    runs = [e.record for route in routes for m in methods for e in collection.runs(route, m)]
    lengths = rte_lengths(runs)
    found = {
        (method, length): [
            v
            for route in routes
            for v in collection.values(route, method, measure(f"rte_{length:g}"))
        ]
        for method in methods
        for length in lengths
    }
    if not any(found.values()):
        return None
    draw = _side_by_side if len(methods) <= MOST_METHODS else _below_each_other
    figure = draw(found, methods, lengths, looks)
    most = max(map(len, found.values()))
    caption = (
        f"Each point is the RTE of one run, {most} for a method at most; no alignment. Boxes from "
        f"{_BOX_FROM} runs on: quartiles and median, whiskers to 1.5 times the quartiles' distance."
    )
    return ReportFigure("rte", "Relative translation error", caption, figure)


_Found = Mapping[tuple[Method, float], Sequence[float]]
_Looks = Mapping[Method, Style]


def _side_by_side(
    found: _Found,
    methods: Sequence[Method],
    lengths: Sequence[float],
    looks: Mapping[Method, Style],
) -> Figure:
    """The boxes of each length beside each other, told apart by a legend."""
    figure = new_figure()
    axes = figure.add_subplot()
    width = 0.8 / len(methods)
    for k, method in enumerate(methods):
        for x, length in enumerate(lengths):
            values = np.array(found[method, length])
            _box(axes, x - 0.4 + (k + 0.5) * width, 0.8 * width, values, looks[method])
    axes.set_xticks(range(len(lengths)), [f"{length:g} m" for length in lengths])
    axes.set_xlim(-0.5, len(lengths) - 0.5)
    axes.set_ylim(bottom=0.0)
    finish(axes, "RTE (%)", "distance on the truth")
    axes.grid(visible=False, axis="x")
    _method_legend(figure, methods, looks)
    return figure


def _below_each_other(
    found: _Found,
    methods: Sequence[Method],
    lengths: Sequence[float],
    looks: Mapping[Method, Style],
) -> Figure:
    """A panel for each length, in it a named row for each method, as of many there are."""
    figure = new_figure(0.35 + 0.055 * len(methods))
    panels = figure.subplots(1, len(lengths), sharey=True, squeeze=False)[0]
    for axes, length in zip(panels, lengths, strict=True):
        for y, method in enumerate(methods):
            _box(axes, y, 0.65, np.array(found[method, length]), looks[method], rows=True)
        axes.set_xlim(left=0.0)
        finish(axes, "", f"RTE over {length:g} m (%)")
        axes.grid(visible=False, axis="y")
    panels[0].set_yticks(range(len(methods)), [looks[m].name for m in methods], fontsize=8)
    for label in panels[0].get_yticklabels():
        label.set_parse_math(False)
    panels[0].set_ylim(len(methods) - 0.4, -0.6)
    return figure


def track_lengths_figure(
    collection: Collection, group: str, looks: Mapping[Method, Style]
) -> ReportFigure | None:
    """How many tracks reach which length; None where no run has tracks."""
    known = collection.methods_of(group)
    methods = known[:MOST_METHODS]
    left_out = f" The first {len(methods)} of {len(known)} methods." if known != methods else ""
    folders = {m: _folders(collection, group, m) for m in methods}
    whole = all(paths and all((p / TRACKS).exists() for p in paths) for paths in folders.values())
    figure = new_figure()
    axes = figure.add_subplot()
    if whole:
        shares = {m: _length_shares(paths) for m, paths in folders.items()}
        longest = max(len(share) for share in shares.values())
        for method, share in shares.items():
            look = looks[method]
            padded = 100.0 * np.pad(share, (0, longest - len(share)))
            edges = np.arange(longest + 1) + 0.5
            axes.stairs(padded, edges, color=look.color, ls=look.dashes, lw=1.6)
            middle = np.arange(1, longest + 1)
            axes.plot(middle, padded, ls="", marker=look.marker, ms=3.2, color=look.color)
        axes.set_xlim(0.5, longest + 0.5)
        axes.set_xticks([1, *range(5, longest + 1, 5)])
        caption = "Percent of all tracks, those alive at the end included, all runs together."
    else:
        width = 0.8 / len(methods)
        for k, method in enumerate(methods):
            heights = [_mean_share(collection, group, method, n) for n in LENGTHS]
            if not all(map(math.isfinite, heights)):
                continue
            place = np.arange(len(LENGTHS)) - 0.4 + (k + 0.5) * width
            look = looks[method]
            axes.bar(place, heights, 0.85 * width, fc=_pale(look), ec=look.color, ls=look.dashes)
            axes.plot(place, heights, ls="", marker=look.marker, ms=3.5, color=look.color)
        axes.set_xticks(range(len(LENGTHS)), map(str, LENGTHS))
        caption = (
            "Percent of all tracks, mean over the runs, at the lengths that are kept of a run."
        )
        if not axes.patches:
            return None
    axes.set_yscale("symlog", linthresh=5.0)
    axes.set_yticks([0, 1, 2, 5, 10, 20, 50], ["0", "1", "2", "5", "10", "20", "50"])
    axes.set_ylim(bottom=0.0)
    finish(axes, "share of tracks (%)", "length (images)")
    _method_legend(figure, methods, looks)
    return ReportFigure(
        "track_lengths", "Track lengths", f"{caption} Logarithmic above 5 %.{left_out}", figure
    )


def timing_figure(
    collection: Collection, group: str, looks: Mapping[Method, Style]
) -> ReportFigure | None:
    """CPU per image as bars of stages; None where no run was timed."""
    routes = collection.of(group)
    methods = [m for m in collection.methods_of(group) if stage_times(collection, routes, m)]
    if not methods:
        return None
    figure = new_figure(max(0.6, 0.25 + 0.11 * len(methods)))
    axes = figure.add_subplot()
    for y, method in enumerate(methods):
        times = stage_times(collection, routes, method)
        total, left = times.pop("frame", 0.0), 0.0
        for stage, ms in (times | {"other": max(total - sum(times.values()), 0.0)}).items():
            color, hatch = _STAGES_SHOWN[stage]
            axes.barh(y, ms, 0.7, left=left, fc=color, ec="white", lw=0.6, hatch=hatch)
            left += ms
        axes.text(left, y, f" {left:.1f}", va="center", fontsize=9, color=TEXT)
    axes.set_yticks(range(len(methods)), [looks[method].name for method in methods])
    for label in axes.get_yticklabels():
        label.set_parse_math(False)
    axes.invert_yaxis()
    axes.margins(x=0.1)
    finish(axes, "", "CPU per image (ms)")
    axes.grid(visible=False, axis="y")
    patches = [
        Patch(fc=color, hatch=hatch, ec="white", lw=0.6) for color, hatch in _STAGES_SHOWN.values()
    ]
    legend(figure, patches, list(_STAGES_SHOWN))
    caption = (
        "Medians of the stages, mean over the runs; reading the image is left out. Runs that "
        "shared a machine with others are slower than these alone would be."
    )
    return ReportFigure("timing", "Time per image", caption, figure)


def _box(
    axes: Axes, x: float, width: float, values: FloatArray, look: Style, *, rows: bool = False
) -> None:
    """Box and points at x, or at y = x where methods are ``rows``."""
    boxed = len(values) >= _BOX_FROM
    if boxed:
        line = {"color": look.color, "linestyle": look.dashes, "linewidth": 1.3}
        axes.boxplot(
            values, positions=[x], widths=width, showfliers=False, manage_ticks=False,
            orientation="horizontal" if rows else "vertical",
            patch_artist=True, whiskerprops=line, capprops=line | {"linestyle": "-"},
            boxprops={"facecolor": _pale(look), "edgecolor": look.color, "linestyle": look.dashes},
            medianprops={"color": look.color, "linewidth": 2.0},
        )  # fmt: skip
    spread = np.linspace(-0.25, 0.25, len(values)) * width if len(values) > 1 else np.zeros(1)
    if len(values):
        places = x + spread
        axes.plot(
            *((values, places) if rows else (places, values)), ls="", marker=look.marker,
            ms=2.8 if boxed else 5.0, mfc=look.color, mec="white", mew=0.3,
            alpha=0.7 if boxed else 1.0,
        )  # fmt: skip


def _method_legend(
    figure: Figure, methods: Sequence[Method], looks: Mapping[Method, Style]
) -> None:
    handles = [
        (
            Patch(fc=_pale(looks[m]), ec=looks[m].color, ls=looks[m].dashes, lw=1.3),
            Line2D([], [], ls="", marker=looks[m].marker, ms=4.5, color=looks[m].color),
        )
        for m in methods
    ]
    legend(figure, handles, [looks[m].name for m in methods])


def _pale(look: Style) -> tuple[str, float]:
    return look.color, 0.22


def _folders(collection: Collection, group: str, method: Method) -> list[Path]:
    entries = [e for route in collection.of(group) for e in collection.runs(route, method)]
    return [e.folder for e in entries if e.folder is not None and e.record.status == "done"]


def _length_shares(folders: Sequence[Path]) -> FloatArray:
    """Share of the tracks of length 1, 2, ... of all runs together."""
    counts = np.zeros(1)
    for folder in folders:
        with np.load(folder / TRACKS) as tracks:
            lengths = np.unique(tracks["ids"], return_counts=True)[1]
        found = np.bincount(lengths)
        size = max(len(counts), len(found))
        counts = np.pad(counts, (0, size - len(counts))) + np.pad(found, (0, size - len(found)))
    return np.asarray(counts[1:] / max(counts.sum(), 1.0))


def _mean_share(collection: Collection, group: str, method: Method, length: int) -> float:
    routes = collection.of(group)
    values = [v for r in routes for v in collection.values(r, method, length_share(length))]
    return float(np.mean(values)) if values else math.nan
