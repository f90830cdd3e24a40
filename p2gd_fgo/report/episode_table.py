"""Tables of where two runs differ: by kind of episode, and the pieces that matter most."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from p2gd_fgo.evaluation.bootstrap import Effect
from p2gd_fgo.evaluation.episodes import (
    MOVING_SHARE,
    STILL_SHARE,
    TURN_DEG_PER_M,
    EpisodeRow,
    SegmentPair,
)
from p2gd_fgo.evaluation.segments import Segment
from p2gd_fgo.report.layout import NONE, fixed, pairs, title

_MINUS = "\u2212"
_SHOWN = ("features", "served", "tracks_10", "far", "gated", "outliers")


def episode_table(
    header: Sequence[tuple[str, str]],
    rows: Sequence[EpisodeRow],
    episodes: Sequence[SegmentPair],
    sides: tuple[str, str],
) -> RenderableType:
    """Lay out the comparison of two runs, or of two sets of them.

    Parameters
    ----------
    header
        What was compared: name and value, one line each.
    rows
        By kind, as :func:`compare_episodes` gives them.
    episodes
        The pieces that differ most.
    sides
        Names of a and b.
    """
    over = rows[-1].over
    alone = ": of these recordings alone" if over == "pieces" else ""
    legend = [
        (
            "kinds",
            f"the first that holds: standing {100 * STILL_SHARE:g} % of the time, turning "
            f"{TURN_DEG_PER_M:g}° a metre, moving objects over {100 * MOVING_SHARE:g} % of the "
            "image, straight on",
        ),
        ("errors", "relative to the beginning of the piece; means over pieces; scale: its size"),
        ("intervals", f"95 %, over {over}{alone}"),
        ("part", "what a kind adds to the change of the mean square error; they add up to all"),
    ]
    return Group(
        Rule("explain", align="left", style="dim"),
        pairs([*header, *legend]),
        title("error of the motion over a piece"),
        _translation(rows, sides),
        "",
        _rotation(rows, sides),
        title("what the images had to go on, mean per image"),
        _measures(rows, sides),
        title("where the runs differ most"),
        _episodes(episodes, sides),
    )


def _translation(rows: Sequence[EpisodeRow], sides: tuple[str, str]) -> Table:
    table = _table(
        "kind\n", "pieces\n", *(f"RTE %\n{side}" for side in sides), "difference\n", "part\n%"
    )
    for row in rows:
        errors = (fixed(side["translation_percent"], 2) for side in (row.a, row.b))
        part = f"{100.0 * row.part:+.1f}".replace("-", _MINUS)
        table.add_row(row.kind, str(row.pieces), *errors, _span(row.translation, 2), part)
    return table


def _rotation(rows: Sequence[EpisodeRow], sides: tuple[str, str]) -> Table:
    table = _table(
        "kind\n", *(f"RRE °\n{side}" for side in sides), "difference\n",
        *(f"scale %\n{side}" for side in sides),
    )  # fmt: skip
    for row in rows:
        errors = (fixed(side["rotation_deg"], 3) for side in (row.a, row.b))
        scales = (fixed(100.0 * side["scale_error"], 2) for side in (row.a, row.b))
        table.add_row(row.kind, *errors, _span(row.rotation, 3), *scales)
    return table


def _measures(rows: Sequence[EpisodeRow], sides: tuple[str, str]) -> Table:
    shown = [name for name in _SHOWN if any(name in row.a for row in rows)]
    table = _table("kind", "", *(name.replace("_", " ≥ ") for name in shown))
    for row in rows:
        for side, means in zip(sides, (row.a, row.b), strict=True):
            cells = [fixed(_of(means, name), 1) for name in shown]
            table.add_row(row.kind if means is row.a else "", Text(side), *cells)
    return table


def _episodes(found: Sequence[SegmentPair], sides: tuple[str, str]) -> Table:
    several = len({pair.route for pair in found}) > 1
    table = _table(
        "from\nm", "at\ns", "kind\n", *(f"RTE %\n{side}" for side in sides),
        "turn\n°", "still\n%", "moving\n%", *(f"far\n{side}" for side in sides),
    )  # fmt: skip
    for pair in found:
        a, b = pair.a, pair.b
        place = f"{a.start_m:.0f}"
        table.add_row(
            Text(f"{pair.route} {place}" if several else place),
            f"{a.start_s:.1f}",
            pair.kind,
            *(fixed(side.translation_percent, 2) for side in (a, b)),
            fixed(a.turn_deg, 0),
            fixed(100.0 * a.still_share, 0),
            fixed(100.0 * a.moving_share, 1),
            *(_measure(side, "far") for side in (a, b)),
        )
    return table


def _table(*names: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, show_edge=False)
    for k, name in enumerate(names):
        table.add_column(Text(name), justify="left" if not k else "right", no_wrap=True)
    return table


def _of(means: Mapping[str, float], name: str) -> float:
    return means.get(name, math.nan)


def _measure(segment: Segment, name: str) -> str:
    return fixed(segment.measures.get(name, math.nan), 1)


def _span(found: Effect, decimals: int) -> str:
    """A difference and its interval, with signs."""
    ends = (found.low, found.high)
    interval = (
        f" [{', '.join(f'{end:+.{decimals}f}' for end in ends)}]"
        if all(math.isfinite(end) for end in ends)
        else f" [{NONE}]"
    )
    return f"{found.change:+.{decimals}f}{interval}".replace("-", _MINUS)
