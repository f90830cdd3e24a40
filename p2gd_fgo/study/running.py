"""Do what is left of a study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.expansion import Plan
from p2gd_fgo.study.external import judge
from p2gd_fgo.study.keys import code_hash
from p2gd_fgo.study.pool import LocalPool
from p2gd_fgo.study.progress import NoStudyObserver, StudyObserver
from p2gd_fgo.study.remote import DaskPool
from p2gd_fgo.study.reuse import reusable_records
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.store import Store, is_finished, lacks_segments, of_plan
from p2gd_fgo.study.work import Keep


@dataclass(frozen=True, slots=True)
class Options:
    """How a study is run.

    Attributes
    ----------
    jobs
        Processes on this machine, or workers of a local dask cluster.
    keep
        What stays of the run directories.
    dask
        Address of a scheduler or ``local``; None: processes on this machine.
    keep_older_code
        Runs that other code has finished count as finished.
    retry
        Crashed and timed-out runs are done again.
    sources
        Folders of other studies' results, whose finished runs are taken over.
    """

    jobs: int = 1
    keep: Keep = "small"
    dask: str | None = None
    keep_older_code: bool = False
    retry: bool = False
    sources: tuple[Path, ...] = ()

    def stands(self, record: RunRecord | None, code: str) -> bool:
        """Whether a record stands for its row; see :func:`is_finished`."""
        return is_finished(record, code, keep_older_code=self.keep_older_code, retry=self.retry)


def unfinished_runs(
    plan: Plan, records: dict[str, RunRecord], options: Options | None = None
) -> list[Run]:
    """The runs without a record that stands for them and has the segments that they want."""
    chosen, code = options or Options(), code_hash()
    return [
        run
        for run in plan.runs
        if not chosen.stands(record := records.get(run.key), code) or lacks_segments(run, record)
    ]


def taken_over(
    plan: Plan, records: dict[str, RunRecord], out: Path, options: Options
) -> list[RunRecord]:
    """Records of unfinished runs that the studies in ``options.sources`` have.

    Raises
    ------
    ConfigError, DataError
        As :func:`reusable_records`.
    """
    todo = unfinished_runs(plan, records, options)
    return reusable_records(todo, options.sources, out, keep_older_code=options.keep_older_code)


def run_study(
    plan: Plan, out: Path, options: Options | None = None, observer: StudyObserver | None = None
) -> list[RunRecord]:
    """Do the runs of a plan that aren't finished, and return the records of all its rows.

    Each record is on disk before the next one is taken; a study that was killed at any moment goes
    on where it stopped.

    Parameters
    ----------
    out
        Folder of ``results.jsonl`` and of the run directories.

    Raises
    ------
    ConfigError, DataError
        ``out`` is in use or can't be written; a file of records that can't be read; a scheduler
        that doesn't answer; code that was changed in between. What was finished is kept.
    """
    options, observer = options or Options(), observer or NoStudyObserver()
    with Store(out) as store:
        store.name_runs(row.key for row in plan.rows)
        for record in taken_over(plan, store.records, out, options):
            store.append(record)
        todo = unfinished_runs(plan, store.records, options)
        observer.begin(todo, len(plan.runs) - len(todo))
        if todo:
            _work_off(todo, store, options, observer)
        for external in plan.externals:
            if not options.stands(store.records.get(external.key), code_hash()):
                store.append(judge(external))
        return of_plan(store.records, plan.rows)


def _work_off(todo: Sequence[Run], store: Store, options: Options, observer: StudyObserver) -> None:
    pool: LocalPool | DaskPool
    if options.dask is None:
        pool = LocalPool(options.jobs, options.keep, store.scratch, observer)
    else:
        pool = DaskPool(options.dask, options.jobs, options.keep, store.scratch, observer)
    for run, record in pool.outcomes(todo):
        observer.finished(run, store.add(run, record))
