"""``p2gd-fgo run`` and ``p2gd-fgo demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from p2gd_fgo.cli.options import (
    BackendOption,
    ConfigOption,
    DistributionOption,
    FiguresOption,
    OutOption,
    OverwriteOption,
    SeedOption,
    SetOption,
    make_config,
    read_figures,
)
from p2gd_fgo.config import Config, override


def run(
    target: Annotated[
        Path,
        typer.Argument(
            metavar="PATH|CONFIG", show_default=False,
            help="A recording, folder or bag, or a YAML configuration that names one.",
        ),
    ],
    config: ConfigOption = None,
    settings: SetOption = None,
    backend: BackendOption = None,
    distribution: DistributionOption = None,
    seed: SeedOption = None,
    out: OutOption = None,
    overwrite: OverwriteOption = False,
    figures: FiguresOption = None,
) -> None:  # fmt: skip
    """Run a recording and print its ATE/RTE table."""
    frames = read_figures(figures)
    made = make_config(
        target, config, settings, backend=backend, distribution=distribution, seed=seed
    )
    _run(made, out, overwrite, frames)


def demo(
    settings: SetOption = None,
    backend: BackendOption = None,
    distribution: DistributionOption = None,
    seed: SeedOption = None,
    out: OutOption = None,
    overwrite: OverwriteOption = False,
    figures: FiguresOption = None,
) -> None:
    """Render a short robot drive (once, into the user's cache) and run it."""
    frames = read_figures(figures)
    made = make_config(None, None, settings, backend=backend, distribution=distribution, seed=seed)
    console = Console()
    from p2gd_fgo.simulation.demo import demo_sequence

    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("rendering the demo", total=None)
        folder = demo_sequence(progress=lambda n, total: bar.update(task, completed=n, total=total))
    made = override(made, {"dataset.path": str(folder), "name": made.name or "demo"})
    _run(made, out, overwrite, frames)


def _run(config: Config, out: Path | None, overwrite: bool, figures: tuple[int, ...]) -> None:
    from p2gd_fgo.cli.progress import ProgressBar
    from p2gd_fgo.experiment import run_experiment
    from p2gd_fgo.report.summaries import summarize_events
    from p2gd_fgo.report.tables import run_table

    console = Console()
    with ProgressBar(console) as bar:
        done = run_experiment(config, out=out, overwrite=overwrite, observer=bar, figures=figures)
    result = done.result
    console.print(
        run_table(
            done.header,
            done.metrics,
            done.timing,
            (result.status, result.reason),
            summarize_events(done.events),
            done.tracking,
        )
    )
    if result.status != "done":
        raise typer.Exit(1)
