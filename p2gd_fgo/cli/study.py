"""``p2gd-fgo study``: run, plan, status, table."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.study.spec import FULL, StudySpec, load_study
from p2gd_fgo.threads import set_thread_environment

if TYPE_CHECKING:
    from p2gd_fgo.run_record import RunRecord
    from p2gd_fgo.study.expansion import Plan
    from p2gd_fgo.study.running import Options
    from p2gd_fgo.study.runs import Run

app = typer.Typer(
    help="Many runs that answer one question, from one YAML.", no_args_is_help=True,
    rich_markup_mode=None,
)  # fmt: skip

StudyArgument = Annotated[
    Path, typer.Argument(metavar="STUDY", show_default=False, help="study.yaml, or its folder.")
]
ProfileOption = Annotated[
    str, typer.Option(metavar="NAME", help="Size of the study, such as quick.")
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="DIR", show_default=False,
        help="Folder of results.jsonl and the run directories [default: the study's folder; of "
        "another profile than full the folder of its name in it]",
    ),
]  # fmt: skip
DataOption = Annotated[
    Path | None,
    typer.Option(
        metavar="ROOT", show_default=False,
        help="Root of the recordings that the study names; without it they are left out.",
    ),
]  # fmt: skip
FromOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--from", metavar="DIR", show_default=False,
        help="Take over the runs that another study has finished; may be given again.",
    ),
]  # fmt: skip
OlderOption = Annotated[
    bool, typer.Option("--keep-older-code", help="Runs of an older code count as finished.")
]


@app.command()
def run(
    study: StudyArgument,
    profile: ProfileOption = FULL,
    out: OutOption = None,
    data: DataOption = None,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=0, help="Processes; 0: one for each core.")
    ] = 0,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", show_default=False,
            help="Run on a dask cluster: tcp://HOST:PORT of its scheduler, or local.",
        ),
    ] = None,
    keep_runs: Annotated[
        str,
        typer.Option(
            metavar="small|all|none",
            help="Of each run directory: estimate, truth beside it, metrics, events and "
            "configuration; everything; nothing.",
        ),
    ] = "small",
    sources: FromOption = None,
    keep_older_code: OlderOption = False,
    retry: Annotated[
        bool, typer.Option("--retry", help="Do crashed and timed-out runs again.")
    ] = False,
) -> None:  # fmt: skip
    """Do what is left of a study, and print its table; a killed study goes on where it stopped."""
    plan, folder = _plan(study, profile, out, data)
    from p2gd_fgo.cli.study_progress import StudyProgress, cost_line
    from p2gd_fgo.study.running import Options, run_study
    from p2gd_fgo.study.work import Keep

    kept: Keep | None = next((k for k in get_args(Keep) if k == keep_runs), None)
    if kept is None:
        raise ConfigError(f"--keep-runs {keep_runs}: give small, all or none")
    options = Options(
        jobs or os.cpu_count() or 1, kept, dask, keep_older_code, retry, tuple(sources or ())
    )
    console = Console()
    _, todo = _left(console, plan, folder, options)
    if todo:
        console.print(cost_line(todo, options.jobs), highlight=False, soft_wrap=True)
    with StudyProgress(console) as bar:
        records = run_study(plan, folder, options, bar)
    _summary(console, plan.spec, records, folder)
    if any(record.status in ("crashed", "timeout") for record in records):
        raise typer.Exit(1)


@app.command("plan")
def show_plan(
    study: StudyArgument,
    profile: ProfileOption = FULL,
    out: OutOption = None,
    data: DataOption = None,
    sources: FromOption = None,
    keep_older_code: OlderOption = False,
) -> None:
    """List the runs of a study, with what is done, and what the rest costs."""
    plan, folder = _plan(study, profile, out, data)
    from p2gd_fgo.cli.study_progress import cost_line
    from p2gd_fgo.study.running import Options

    console = Console()
    options = Options(keep_older_code=keep_older_code, sources=tuple(sources or ()))
    records, todo = _left(console, plan, folder, options)
    left = {run.key for run in todo}
    for planned in plan.runs:
        found = records.get(planned.key)
        state = "to do"
        if found is not None:
            state = f"{found.status}, older code" if planned.key in left else found.status
        console.print(f"{planned.key}  {state:<8}  {planned.label}", soft_wrap=True, markup=False,
                      highlight=False)  # fmt: skip
    if todo:
        console.print(cost_line(todo, os.cpu_count() or 1), highlight=False, soft_wrap=True)


@app.command()
def status(
    study: StudyArgument,
    profile: ProfileOption = FULL,
    out: OutOption = None,
    data: DataOption = None,
    keep_older_code: OlderOption = False,
) -> None:
    """Count the runs of a study by what became of them."""
    plan, folder = _plan(study, profile, out, data)
    from p2gd_fgo.study.running import Options
    from p2gd_fgo.study.store import of_plan

    console = Console()
    records, todo = _left(console, plan, folder, Options(keep_older_code=keep_older_code))
    left = {run.key for run in todo}
    known = of_plan(records, plan.rows)
    table = Table(box=None, pad_edge=False)
    groups = list(dict.fromkeys(run.group for run in plan.runs))
    states = ("done", "failed", "crashed", "timeout", "older code", "to do")
    for name in ("group", *states):
        table.add_column(name, justify="left" if name == "group" else "right")
    for group in groups:
        found = [record for record in known if record.group == group]
        count = Counter("older code" if r.key in left else r.status for r in found)
        count["to do"] = sum(row.group == group for row in plan.rows) - len(found)
        table.add_row(Text(group), *(str(count[state] or "") for state in states))
    console.print(table)
    others = len(records) - len(known)
    if others:
        console.print(f"{others} more lines in the file belong to no run of this plan")


@app.command("table")
def show_table(
    study: StudyArgument,
    profile: ProfileOption = FULL,
    out: OutOption = None,
    data: DataOption = None,
) -> None:
    """Print the paired table of the runs that are finished."""
    plan, folder = _plan(study, profile, out, data)
    from p2gd_fgo.study.store import of_plan, records_in

    known = of_plan(records_in(folder), plan.rows)
    if not known:
        raise ConfigError(f"{folder}: no run of this plan is finished: 'study run' does them")
    _summary(Console(), plan.spec, known, folder)


def _plan(study: Path, profile: str, out: Path | None, data: Path | None) -> tuple[Plan, Path]:
    """The runs, and the folder of their results; threads are set before numpy is loaded."""
    path = study / "study.yaml" if study.is_dir() else study
    spec = load_study(path).profile(profile)
    set_thread_environment(1)
    from p2gd_fgo.study.expansion import expand

    if data is not None and not data.is_dir():
        raise ConfigError(f"--data {data}: no such folder")
    folder = out or (path.parent if profile == FULL else path.parent / profile)
    return expand(spec, path.parent, data), folder


def _left(
    console: Console, plan: Plan, folder: Path, options: Options
) -> tuple[dict[str, RunRecord], list[Run]]:
    """Say what is done; the records that there are or will be taken over, and the runs left."""
    from p2gd_fgo.study.running import taken_over, unfinished_runs
    from p2gd_fgo.study.store import records_in

    records = records_in(folder)
    taken = taken_over(plan, records, folder, options)
    records |= {record.key: record for record in taken}
    todo = unfinished_runs(plan, records, options)
    _announce(console, plan, len(todo), folder)
    if options.sources:
        console.print(f"{len(taken)} of the finished are taken over from other studies")
    return records, todo


def _announce(console: Console, plan: Plan, todo: int, folder: Path) -> None:
    console.print(f"{plan.spec.name}: {plan.spec.question}", soft_wrap=True, markup=False)
    console.print(
        f"{len(plan.runs)} runs, {len(plan.runs) - todo} finished, {todo} to do; results in "
        f"{folder}", soft_wrap=True, markup=False, highlight=False,
    )  # fmt: skip
    if plan.left_out:
        console.print(f"left out, for want of --data: {', '.join(plan.left_out)}", soft_wrap=True,
                      markup=False)  # fmt: skip
    for name in plan.spec.external:
        there = sum(external.name == name for external in plan.externals)
        if there:
            console.print(f"{name}: {there} trajectories made elsewhere", markup=False)
    if plan.absent:
        console.print(
            f"no such trajectories: {', '.join(map(str, plan.absent))}", soft_wrap=True,
            markup=False, highlight=False,
        )  # fmt: skip


def _summary(console: Console, spec: StudySpec, records: list[RunRecord], folder: Path) -> None:
    from p2gd_fgo.report.study_table import FULL_WIDTH, study_table

    count = Counter(record.status for record in records)
    codes = {record.code for record in records}
    console.print(
        ", ".join(f"{number} {state}" for state, number in sorted(count.items()))
        + f": {folder / 'results.jsonl'}", soft_wrap=True, markup=False, highlight=False,
    )  # fmt: skip
    if len(codes) > 1:
        console.print(f"the runs are of {len(codes)} versions of the code (field 'code')")
    for record in records:
        if record.status in ("crashed", "timeout"):
            console.print(
                f"{record.status}: {record.sequence} {dict(record.axes)}: {record.reason}",
                soft_wrap=True, markup=False, highlight=False,
            )  # fmt: skip
    if spec.pairing is not None:
        paired = spec.pairing
        if not console.is_terminal:
            console.width = max(console.width, FULL_WIDTH)
        console.print(study_table(records, paired.axis, paired.baseline, console.width))
