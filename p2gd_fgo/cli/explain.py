"""``p2gd-fgo explain``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from p2gd_fgo.config.loading import load_config
from p2gd_fgo.errors import DataError
from p2gd_fgo.threads import set_thread_environment

if TYPE_CHECKING:
    from p2gd_fgo.config import Config
    from p2gd_fgo.evaluation.episodes import SegmentPair
    from p2gd_fgo.types import FloatArray, IntArray


def explain(
    a: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_A", show_default=False,
            help="A run directory, or a folder of them.",
        ),
    ],
    b: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_B", show_default=False,
            help="Another of the same recording, or a folder with runs of the same names.",
        ),
    ],
    length: Annotated[
        float, typer.Option(metavar="M", min=0.1, help="Length of a piece of the way, m.")
    ] = 10.0,
    masks: Annotated[
        str | None,
        typer.Option(
            metavar="DIR", show_default=False,
            help="Masks of moving objects, a folder or its place in the recording, 'none' for "
            "none [default: mav0/mask0/data if the recording has it].",
        ),
    ] = None,
    top: Annotated[
        int, typer.Option(metavar="N", min=0, help="Pieces to list, of those that differ most.")
    ] = 8,
) -> None:  # fmt: skip
    """Say in which episodes of the way two runs of a recording differ."""
    set_thread_environment(1)
    from p2gd_fgo.evaluation.episodes import compare_episodes, largest
    from p2gd_fgo.report.episode_table import episode_table

    found: list[SegmentPair] = []
    seen: dict[str, tuple[IntArray, FloatArray] | None] = {}
    runs = _runs(a, b)
    for first, second in runs:
        found += _pairs(first, second, length, masks, seen)
    if not found:
        raise DataError(
            f"{a} and {b} have no piece of {length:g} m of the way in common: give a shorter "
            "--length, or two runs of the same part of a recording"
        )
    rows = compare_episodes(found)
    header = [
        ("a", str(a)),
        ("b", str(b)),
        ("way", f"{len(found)} pieces of {length:g} m in {len(runs)} pair(s) of runs"),
        ("moving objects", _said(list(seen.values()))),
    ]
    Console().print(episode_table(header, rows, largest(found, top), ("a", "b")))


def _pairs(
    first: Path,
    second: Path,
    length_m: float,
    masks: str | None,
    seen: dict[str, tuple[IntArray, FloatArray] | None],
) -> tuple[SegmentPair, ...]:
    from p2gd_fgo.evaluation.episodes import pair_segments
    from p2gd_fgo.evaluation.run_segments import run_segments
    from p2gd_fgo.run_directory import CONFIG

    config = load_config(first / CONFIG)
    part = config.dataset.model_dump_json()  # of one recording another part has other masks
    if part not in seen:
        seen[part] = _moving(config, masks)
    a, b = (run_segments(run, length_m=length_m, moving=seen[part]) for run in (first, second))
    return pair_segments(a, b, Path(str(config.dataset.path)).name)


def _runs(a: Path, b: Path) -> list[tuple[Path, Path]]:
    """The two runs, or those of the same names in two folders.

    Raises
    ------
    DataError
        A folder without runs, or none of the same name.
    """
    from p2gd_fgo.run_directory import STATUS, read_status

    if read_status(a) is not None or read_status(b) is not None:
        return [(a, b)]
    names = [
        {str(status.parent.relative_to(side)) for status in side.rglob(STATUS)} for side in (a, b)
    ]
    for side, inside in zip((a, b), names, strict=True):
        if not inside:
            raise DataError(f"{side}: no run directory, nor any in it")
    common = sorted(names[0] & names[1])
    if not common:
        raise DataError(
            f"{a} and {b} hold no runs of the same name: the first is {min(names[0])} in one and "
            f"{min(names[1])} in the other"
        )
    return [(a / name, b / name) for name in common]


def _moving(config: Config, masks: str | None) -> tuple[IntArray, FloatArray] | None:
    from p2gd_fgo.evaluation.run_segments import has_masks, moving_objects

    if masks == "none":
        return None
    if masks is not None:
        return moving_objects(config, masks)
    return moving_objects(config) if has_masks(config) else None


def _said(found: list[tuple[IntArray, FloatArray] | None]) -> str:
    known = sum(item is not None for item in found)
    return f"by the masks of {known} of {len(found)} recording(s)" if known else "no masks"
