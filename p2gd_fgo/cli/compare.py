"""``p2gd-fgo compare``."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer
from rich.console import Console

from p2gd_fgo.cli.options import (
    ConfigOption,
    OverwriteOption,
    SeedOption,
    SetOption,
    make_config,
)
from p2gd_fgo.config import BackendConfig, Config, DistributionConfig, override
from p2gd_fgo.errors import ConfigError, P2gdError

if TYPE_CHECKING:
    from p2gd_fgo.report.compare_table import ComparedRun


def compare(
    target: Annotated[
        Path,
        typer.Argument(
            metavar="PATH|CONFIG", show_default=False,
            help="A recording, folder or bag, or a YAML configuration that names one.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="DIR", show_default=False,
            help="Folder of the run directories, DIR/<backend>-<distribution>.",
        ),
    ],
    backend: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES", show_default=False,
            help="Back ends, separated by commas [default: the configuration's].",
        ),
    ] = None,
    distribution: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES", show_default=False,
            help="Distributions, separated by commas [default: the configuration's].",
        ),
    ] = None,
    config: ConfigOption = None,
    settings: SetOption = None,
    seed: SeedOption = None,
    overwrite: OverwriteOption = False,
) -> None:  # fmt: skip
    """Run a recording with every back end and distribution named, and print one table."""
    made = make_config(target, config, settings, seed=seed)
    kinds = (
        _names("--backend", backend, BackendConfig) or (made.backend.kind,),
        _names("--distribution", distribution, DistributionConfig) or (made.distribution.kind,),
    )
    combinations = [
        override(made, {"backend.kind": b, "distribution.kind": d})
        for b in kinds[0]
        for d in kinds[1]
    ]
    _compare(combinations, out, overwrite)


def _names(
    option: str, text: str | None, model: type[BackendConfig | DistributionConfig]
) -> tuple[str, ...]:
    """The names in ``a,b``, all of them known to the field ``kind``, none of them twice."""
    if text is None:
        return ()
    known = get_args(model.model_fields["kind"].annotation)
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise ConfigError(f"{option} {text}: no '{name}': {hint}it takes {', '.join(known)}")
        if names.count(name) > 1:
            raise ConfigError(
                f"{option} {text}: '{name}' stands there twice and would be the same run: name "
                "each once (runs of several seeds are a study's, 'p2gd-fgo study')"
            )
    return tuple(names)


def _compare(combinations: Sequence[Config], out: Path, overwrite: bool) -> None:
    from p2gd_fgo.cli.progress import ProgressBar
    from p2gd_fgo.experiment import run_experiment
    from p2gd_fgo.report.compare_table import FULL_WIDTH, ComparedRun, compare_table
    from p2gd_fgo.report.summaries import TOTAL_STAGE
    from p2gd_fgo.run_directory import check_free

    folders = [out / f"{c.backend.kind}-{c.distribution.kind}" for c in combinations]
    for folder in folders:
        check_free(folder, overwrite)
    console = Console()
    runs: list[ComparedRun] = []
    header: list[tuple[str, str]] = []
    refusals: list[P2gdError] = []
    for number, (config, folder) in enumerate(zip(combinations, folders, strict=True), 1):
        backend, distribution = config.backend.kind, config.distribution.kind
        label = f"{number}/{len(folders)} {folder.name}"
        try:
            with ProgressBar(console, label) as bar:
                done = run_experiment(config, out=folder, overwrite=overwrite, observer=bar)
        except P2gdError as error:
            refusals.append(error)
            runs.append(
                ComparedRun(backend, distribution, None, None, float("nan"), "refused", str(error))
            )
            continue
        frame = done.timing.get(TOTAL_STAGE)
        runs.append(
            ComparedRun(
                backend,
                distribution,
                done.metrics,
                done.tracking,
                frame.median_cpu_ms if frame else float("nan"),
                done.result.status,
                done.result.reason,
            )
        )
        if not header or distribution == "p2gd":
            header = _common(done.header, out)
    if len(refusals) == len(runs):
        raise refusals[0]
    if not console.is_terminal:
        console.width = max(console.width, FULL_WIDTH)
    console.print(compare_table(header, runs, console.width))
    if any(run.status != "done" for run in runs):
        raise typer.Exit(1)


def _common(header: Sequence[tuple[str, str]], out: Path) -> list[tuple[str, str]]:
    """What a run's header says of all the runs."""
    shared = ("sequence", "camera", "priors", "features", "start", "seed")
    return [*((name, value) for name, value in header if name in shared), ("results", str(out))]
