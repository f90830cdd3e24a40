"""From the command line's options to a configuration."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.threads import set_thread_environment

ConfigOption = Annotated[
    Path | None, typer.Option("--config", "-c", help="YAML configuration.", show_default=False)
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", "-s", metavar="KEY=VALUE", show_default=False,
        help="Any field of the configuration, such as frontend.max_features=180; repeatable.",
    ),
]  # fmt: skip
BackendOption = Annotated[
    str | None, typer.Option(help="Short for --set backend.kind=…", show_default=False)
]
DistributionOption = Annotated[
    str | None, typer.Option(help="Short for --set distribution.kind=…", show_default=False)
]
SeedOption = Annotated[
    int | None, typer.Option(help="Short for --set runtime.seed=…", show_default=False)
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", "-o", help="Run directory [default: results/<name>/<hash>]"),
]
OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Replace the run that is in the run directory.")
]

FiguresOption = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBERS", show_default=False,
        help="Images to draw, by number from 0, such as 120,450: quotas, features, and what P2GD "
        "predicted.",
    ),
]  # fmt: skip


def make_config(
    target: Path | None,
    config: Path | None,
    settings: list[str] | None,
    *,
    backend: str | None = None,
    distribution: str | None = None,
    seed: int | None = None,
) -> Config:
    """The configuration of a command, and its thread counts put in force.

    Parameters
    ----------
    target
        Folder of a recording, or a YAML configuration that names one.
    config
        YAML configuration; with a folder as target the folder wins over ``dataset.path``.

    Raises
    ------
    ConfigError
        Two configurations, a setting without '=', or what :func:`load_config` refuses.
    """
    if target is not None and target.suffix in (".yaml", ".yml"):
        if config is not None:
            raise ConfigError(
                f"{target} and --config {config} are two configurations: give one, and let it "
                "name the other with 'extends:'"
            )
        target, config = None, target
    chosen: dict[str, object] = {} if target is None else {"dataset.path": str(target)}
    chosen |= read_settings(settings)
    shortcuts = {
        "backend.kind": ("--backend", backend),
        "distribution.kind": ("--distribution", distribution),
        "runtime.seed": ("--seed", seed),
    }
    given = {key: value for key, (_, value) in shortcuts.items() if value is not None}
    options = {key: shortcuts[key][0] for key in given}
    made = override(load_config(config), chosen | given, options)
    set_thread_environment(made.runtime.threads)
    return made


def read_settings(settings: list[str] | None) -> dict[str, object]:
    """Keys and values of ``--set KEY=VALUE``, the last of each key.

    Raises
    ------
    ConfigError
        A setting without '='.
    """
    chosen: dict[str, object] = {}
    for setting in settings or []:
        key, equals, value = setting.partition("=")
        if not equals:
            raise ConfigError(f"--set {setting}: give a key and a value as KEY=VALUE")
        chosen[key.strip()] = value
    return chosen


def read_figures(text: str | None) -> tuple[int, ...]:
    """Image numbers of ``--figures 120,450``, each once; none without the option.

    Raises
    ------
    ConfigError
        Something that is no number.
    """
    if text is None:
        return ()
    parts = [part.strip() for part in text.split(",")]
    for part in parts:
        if not part.isascii() or not part.isdigit():
            raise ConfigError(
                f"--figures {text}: '{part}' is no image number; give whole numbers, separated by "
                "commas, such as 120,450"
            )
    return tuple(dict.fromkeys(int(part) for part in parts))
