"""``p2gd-fgo evaluate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from p2gd_fgo.config import override
from p2gd_fgo.config.loading import load_config
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.threads import set_thread_environment


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="TUM file of the IMU's poses.")],
    truth: Annotated[Path, typer.Argument(help="TUM file, or EuRoC csv of the truth.")],
    alignment: Annotated[
        str, typer.Option(help="Main alignment: yaw_pos, se3, sim3 or origin.")
    ] = "yaw_pos",
    frames: Annotated[
        int | None,
        typer.Option(
            help="Images in the recording, for the completeness.", min=1, show_default=False
        ),
    ] = None,
    as_json: Annotated[
        Path | None, typer.Option("--json", help="Write the numbers here.", show_default=False)
    ] = None,
) -> None:
    """Compare a trajectory with the truth and print its ATE/RTE table."""
    key = "evaluation.alignment"
    config = override(load_config(), {key: alignment}, {key: "--alignment"})
    set_thread_environment(config.runtime.threads)
    from p2gd_fgo.atomic_files import write_text
    from p2gd_fgo.evaluation.evaluate import evaluate as judge
    from p2gd_fgo.report.tables import evaluate_table
    from p2gd_fgo.trajectory_files import read_trajectory

    metrics = judge(
        read_trajectory(estimate),
        read_trajectory(truth),
        frames_total=frames,
        config=config.evaluation,
    )
    Console().print(evaluate_table(metrics))
    if as_json is not None:
        try:
            write_text(as_json, json.dumps(metrics.to_json(), indent=2, sort_keys=True) + "\n")
        except OSError as error:
            raise ConfigError(
                f"--json {as_json}: can't be written ({error.strerror}): name another file"
            ) from None
