"""``p2gd-fgo convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from p2gd_fgo.cli.options import ConfigOption, SetOption, make_config
from p2gd_fgo.config import Config
from p2gd_fgo.errors import DataError

_TRAJECTORY_SUFFIXES = (".tum", ".txt")


def convert(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="IN", show_default=False,
            help="A recording of any known format: a folder or a bag; or a YAML configuration "
            "that names one.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", show_default=False,
            help="ASL folder to write; or a .tum file for the truth alone, such as a planner's "
            "topic in a bag.",
        ),
    ],
    config: ConfigOption = None,
    settings: SetOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace what is in OUT.")
    ] = False,
) -> None:  # fmt: skip
    """Write a recording as an ASL folder: images, IMU, calibration, truth, masks."""
    made = make_config(recording, config, settings)
    console = Console(soft_wrap=True, highlight=False, markup=False, emoji=False)
    if out.suffix in _TRAJECTORY_SUFFIXES:
        _write_trajectory(made, out, overwrite, console)
        return

    from p2gd_fgo.datasets import open_sequence
    from p2gd_fgo.datasets.convert import convert_to_asl
    from p2gd_fgo.datasets.opening import recording_path

    source, target = recording_path(made.dataset).resolve(), out.resolve()
    if source.is_relative_to(target):
        raise DataError(f"{out}: the recording itself lies there: give another folder")
    if made.dataset.mask is not None:
        raise DataError(
            "dataset.mask: an ASL folder holds no mask that is the same for all images: leave it "
            "away here, and give it to the run"
        )
    sequence = open_sequence(made.dataset, max_gap_s=made.imu.max_gap_s)
    columns = (
        TextColumn("[bold]{task.description}"), BarColumn(bar_width=None), MofNCompleteColumn(),
        TimeRemainingColumn(compact=True),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(f"converting {sequence.name}", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        done = convert_to_asl(sequence, out, overwrite=overwrite, progress=show)
    how = f"{done.images} images ({done.copied} copied, {done.images - done.copied} as PNG)"
    masks = f", {done.masks} masks" if done.masks else ""
    poses = len(sequence.truth.trajectory) if sequence.truth else 0
    console.print(f"{out}: {how}{masks}, {len(sequence.imu)} IMU samples, {poses} poses of truth")
    for note in (*(event.message for event in sequence.events), *done.notes):
        console.print(f"note: {note}")


def _write_trajectory(config: Config, out: Path, overwrite: bool, console: Console) -> None:
    from p2gd_fgo.datasets import open_sequence
    from p2gd_fgo.datasets.bag import read_bag_trajectory
    from p2gd_fgo.datasets.opening import recording_format, recording_path
    from p2gd_fgo.trajectory_files import write_tum

    if out.exists() and not overwrite:
        raise DataError(f"{out} exists already: give a new file, or --overwrite")
    path = recording_path(config.dataset)
    if recording_format(config.dataset) == "bag":
        trajectory = read_bag_trajectory(path, config.dataset)
    else:
        truth = open_sequence(config.dataset).truth
        if truth is None:
            raise DataError(f"{path}: the recording has no truth to write")
        trajectory = truth.trajectory
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_tum(out, trajectory)
    except OSError as error:
        raise DataError(f"{out}: can't be written: {error.strerror}") from None
    console.print(f"{out}: {len(trajectory)} poses")
