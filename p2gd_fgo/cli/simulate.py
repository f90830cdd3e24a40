"""``p2gd-fgo simulate``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.errors import ConfigError


def simulate(
    preset: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|SCENARIO", show_default=False,
            help="Name of a preset in configs/simulation, or a YAML scenario.",
        ),
    ],
    seed: Annotated[int | None, typer.Option(help="Short for --set seed=…")] = None,
    duration: Annotated[
        float | None, typer.Option(help="Short for --set duration_s=…")
    ] = None,
    imu_seed: Annotated[
        int | None, typer.Option(help="Short for --set imu.seed=…: other noise, same images")
    ] = None,
    route: Annotated[
        Path | None, typer.Option(help="Drive this trajectory: TUM, EuRoC csv, KAIST global_pose.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", "-s", metavar="KEY=VALUE", show_default=False,
            help="Any field of the scenario, such as camera.exposure_ms=8; repeatable.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder [default: in the user's cache]")
    ] = None,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=0, help="Processes; 0: one for each core.")
    ] = 0,
    preview: Annotated[
        int,
        typer.Option(min=0, help="Put this many images on one sheet, preview.jpg in the folder."),
    ] = 0,
    only_preview: Annotated[
        bool, typer.Option("--only-preview", help="Render the images of --preview and no others.")
    ] = False,
    reuse: Annotated[
        Path | None,
        typer.Option(help="Recording with the same images: link them instead of rendering."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace another simulated recording in --out.")
    ] = False,
) -> None:  # fmt: skip
    """Render a recording with known truth, as an ASL folder; what is there already is kept."""
    from p2gd_fgo.simulation.presets import find_preset, load_scenario

    chosen = read_settings(settings)
    short = {
        "seed": seed, "duration_s": duration, "imu.seed": imu_seed,
        "route.file": None if route is None else str(route),
    }  # fmt: skip
    chosen |= {key: value for key, value in short.items() if value is not None}
    scenario = load_scenario(find_preset(preset), chosen)
    if only_preview and preview < 1:
        raise ConfigError("--only-preview needs --preview and a number of images")

    from p2gd_fgo.simulation import recorder

    console = Console(soft_wrap=True, highlight=False, markup=False, emoji=False)
    folder = out or recorder.default_folder(scenario)
    if only_preview:
        recorder.sample_sheet(scenario, preview, folder / "preview.jpg")
        console.print(f"{folder / 'preview.jpg'}: {preview} images")
        return
    columns = (
        TextColumn("[bold]{task.description}"), BarColumn(bar_width=None), MofNCompleteColumn(),
        TimeRemainingColumn(compact=True),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(f"building {scenario.name}", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, description=f"rendering {scenario.name}")

        made = recorder.record(
            scenario,
            folder,
            jobs=jobs or os.cpu_count() or 1,
            overwrite=overwrite,
            reuse=reuse,
            progress=show,
        )
    if preview:
        recorder.contact_sheet(made.folder, preview, made.folder / "preview.jpg")
    console.print(f"{made.folder}: {made.frames} images, {made.rendered} of them rendered now")
