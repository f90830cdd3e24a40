"""``p2gd-fgo config``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from p2gd_fgo.cli.options import (
    BackendOption,
    ConfigOption,
    DistributionOption,
    SeedOption,
    SetOption,
    make_config,
)
from p2gd_fgo.config import dump_yaml, resolve

app = typer.Typer(help="Look at the configuration.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Look at the configuration."""


@app.command()
def dump(
    target: Annotated[
        Path | None, typer.Argument(metavar="[CONFIG]", help="YAML file.", show_default=False)
    ] = None,
    config: ConfigOption = None,
    settings: SetOption = None,
    backend: BackendOption = None,
    distribution: DistributionOption = None,
    seed: SeedOption = None,
    width: Annotated[
        int | None,
        typer.Option(
            help="Image width in px, to fill the defaults that depend on it.", min=1,
            show_default=False,
        ),
    ] = None,
    comments: Annotated[bool, typer.Option(help="Each field's meaning beside it.")] = True,
) -> None:  # fmt: skip
    """Print every field with its value and meaning, as YAML that can be used."""
    made = make_config(
        target, config, settings, backend=backend, distribution=distribution, seed=seed
    )
    if width is not None:
        made = resolve(made, width)
    Console(soft_wrap=True, highlight=False, markup=False, emoji=False).print(
        dump_yaml(made, comments=comments), end=""
    )
