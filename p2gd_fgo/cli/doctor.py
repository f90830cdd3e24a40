"""``p2gd-fgo doctor``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from p2gd_fgo.cli.options import ConfigOption, SetOption, make_config
from p2gd_fgo.config import Config, resolve
from p2gd_fgo.errors import ConfigError

if TYPE_CHECKING:
    from p2gd_fgo.datasets import Sequence
    from p2gd_fgo.doctor import Examination, Report

_STYLES = {
    "ok": "green", "note": "cyan", "undetermined": "dim", "warning": "yellow", "fault": "bold red",
}  # fmt: skip
_MIN_WIDTH = 120


def doctor(
    target: Annotated[
        Path,
        typer.Argument(
            metavar="PATH|CONFIG", show_default=False,
            help="A recording, folder or bag, or a YAML configuration that names one.",
        ),
    ],
    config: ConfigOption = None,
    settings: SetOption = None,
    picture: Annotated[
        Path | None,
        typer.Option(help="Write an image and its undistorted grid here.", show_default=False),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the findings as JSON instead of a table.")
    ] = False,
) -> None:  # fmt: skip
    """Say whether a recording is fit to run, and what is wrong with it if it isn't.

    Exit code 0: fit, with warnings or without; 1: not fit, or too little data to judge; 2: it
    can't be opened.
    """
    made = make_config(target, config, settings)
    if picture is not None and (picture.suffix != ".png" or not picture.parent.is_dir()):
        raise ConfigError(f"--picture {picture}: give a file *.png in a folder that exists")
    report = _examine(made, picture, quiet=as_json)
    if as_json:
        typer.echo(json.dumps(report.to_json(), indent=2))
    else:
        _print(report)
    from p2gd_fgo.doctor import NOT_FIT, TOO_LITTLE

    if report.verdict in (NOT_FIT, TOO_LITTLE):
        raise typer.Exit(1)


def _examine(config: Config, picture: Path | None, *, quiet: bool) -> Report:
    import cv2

    from p2gd_fgo.datasets import open_sequence
    from p2gd_fgo.doctor import examine

    cv2.setNumThreads(config.runtime.threads)
    sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
    resolved = resolve(config, sequence.calibration.camera.width)
    with Progress(console=Console(stderr=True), disable=quiet, transient=True) as bar:
        task = bar.add_task("images", total=None)
        examined = examine(
            sequence, resolved, lambda done, total: bar.update(task, completed=done, total=total)
        )
    if picture is not None:
        _write_picture(picture, sequence, examined)
    return examined.report


def _write_picture(path: Path, sequence: Sequence, examined: Examination) -> None:
    from p2gd_fgo.atomic_files import atomic_path
    from p2gd_fgo.doctor.picture import lens_picture
    from p2gd_fgo.errors import DataError

    if examined.example is None:
        raise DataError(f"--picture {path}: none of the images looked at can be decoded")
    data = lens_picture(sequence.image(examined.example), sequence.calibration.camera)
    try:
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        raise DataError(f"--picture {path}: can't be written ({error.strerror})") from None


def _print(report: Report) -> None:
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, _MIN_WIDTH)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for name in ("check", "", "found", "held against"):
        table.add_column(name, overflow="fold")
    for finding in report.findings:
        style = _STYLES[finding.status]
        found = Text(finding.value)
        if finding.mend and finding.status in ("warning", "fault", "undetermined"):
            found.append(f"\n→ {finding.mend}", style="bold")
        mark = "?" if finding.status == "undetermined" else finding.status
        table.add_row(
            finding.check, Text(mark, style=style), found, Text(finding.threshold, style="dim")
        )
    console.print(table)
    style = {"fit to run": "bold green", "not fit to run": "bold red"}.get(
        report.verdict, "bold yellow"
    )
    names = f": {', '.join(dict.fromkeys(report.faults))}" if report.faults else ""
    console.print(
        Text(f"\n{report.name}: "), Text(f"{report.verdict}{names}", style=style),
        Text(f" ({report.seconds:.0f} s)", style="dim"), sep="",
    )  # fmt: skip
