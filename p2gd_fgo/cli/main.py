"""The entry point: commands, exit codes, errors as sentences.

Exit codes: 0 done, 1 the run failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import typer

from p2gd_fgo import __version__
from p2gd_fgo.cli import config as config_commands
from p2gd_fgo.cli import study as study_commands
from p2gd_fgo.cli.compare import compare
from p2gd_fgo.cli.convert import convert
from p2gd_fgo.cli.doctor import doctor
from p2gd_fgo.cli.evaluate import evaluate
from p2gd_fgo.cli.explain import explain
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.cli.report import report
from p2gd_fgo.cli.run import demo, run
from p2gd_fgo.cli.simulate import simulate

app = typer.Typer(
    name="p2gd-fgo",
    help="Visual-inertial odometry lab: run recordings, swap estimators, print ATE/RTE reports.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command()(run)
app.command()(demo)
app.command()(compare)
app.command()(explain)
app.command()(evaluate)
app.command()(report)
app.command()(doctor)
app.command()(simulate)
app.command()(convert)
app.add_typer(config_commands.app, name="config")
app.add_typer(study_commands.app, name="study")


def _version(value: bool) -> None:
    if value:
        typer.echo(f"p2gd-fgo {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Visual-inertial odometry lab: run recordings, swap estimators, print ATE/RTE reports."""


def main() -> None:
    """Run the command line."""
    run_refusing(app)


if __name__ == "__main__":
    main()
