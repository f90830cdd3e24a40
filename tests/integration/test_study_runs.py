"""Studies that are killed, late, crashed or elsewhere give what one that ran through gives."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_study import write_study

from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.run_record import RESULTS, RunRecord, canonical, read_records
from p2gd_fgo.study.expansion import Plan, expand
from p2gd_fgo.study.progress import NoStudyObserver
from p2gd_fgo.study.running import Options, run_study, unfinished_runs
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.spec import load_study
from p2gd_fgo.trajectory_files import read_tum

_WORKER = "p2gd_fgo.study.worker"


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The user's cache, for this process and those that it starts."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def plan(study: Path, cache: Path) -> Plan:
    return expand(load_study(study), study.parent)


@pytest.fixture(scope="module")
def whole(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a study that ran through in one process."""
    out = tmp_path_factory.mktemp("whole")
    records = run_study(plan, out)
    assert [record.status for record in records] == ["done"] * 4
    return out


class Watcher(NoStudyObserver):
    """Calls back when a run has been started, and when one is finished."""

    def __init__(
        self,
        started: Callable[[Run], None] = lambda run: None,
        finished: Callable[[int], None] = lambda number: None,
    ) -> None:
        self.done: list[str] = []
        self._started, self._finished = started, finished

    def running(self, run: Run, done: int, total: int) -> None:
        self._started(run)

    def finished(self, run: Run, record: RunRecord) -> None:
        self.done.append(run.key)
        self._finished(len(self.done))


def same(out: Path, other: Path) -> bool:
    return canonical(read_records(out / RESULTS)) == canonical(read_records(other / RESULTS))


def lines(out: Path) -> list[str]:
    path = out / RESULTS
    return path.read_text().splitlines() if path.is_file() else []


def workers_of(pid: int) -> list[int]:
    """Worker processes below a process."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
            command = (status.parent / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == pid and _WORKER.encode() in command:
            found.append(int(status.parent.name))
    return found


def wait_for(condition: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it didn't come"
        time.sleep(0.05)


def test_what_is_kept_of_a_run_is_small_and_enough(whole: Path, plan: Plan) -> None:
    for run, record in zip(plan.runs, read_records(whole / RESULTS), strict=True):
        assert record.key == run.key and record.directory is not None
        assert record.axes == run.axes and record.tracking["mean_length"] > 1.0
        folder = whole / record.directory
        assert {path.name for path in folder.iterdir()} == {
            *("config.yaml", "events.jsonl", "frames.csv", "metrics.json", "status.json"),
            *("estimate.tum", "truth.tum"),
        }
        truth, estimate = read_tum(folder / "truth.tum"), read_tum(folder / "estimate.tum")
        assert len(truth) <= 2 * len(estimate)
        again = evaluate(
            estimate, truth, frames_total=len(estimate), config=run.config.evaluation
        ).to_json()
        ate = record.metrics["ate_m"]["yaw_pos"]["rmse"]
        assert again["ate_m"]["yaw_pos"]["rmse"] == pytest.approx(ate, rel=1e-6)
        assert str(whole) not in record.to_json()


def test_axes_and_seeds_change_the_estimate(whole: Path) -> None:
    errors = {r.metrics["ate_m"]["yaw_pos"]["rmse"] for r in read_records(whole / RESULTS)}
    assert len(errors) == 4


def test_a_killed_study_goes_on_where_it_stopped(
    plan: Plan, study: Path, whole: Path, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "p2gd_fgo", "study", "run", str(study), "-j", "1"]
    process = subprocess.Popen([*command, "-o", str(tmp_path)], stdout=subprocess.DEVNULL)
    wait_for(lambda: lines(tmp_path))
    workers = workers_of(process.pid)
    process.kill()
    process.wait()
    assert workers
    wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 20.0)
    before = {record.key for record in read_records(tmp_path / RESULTS)}
    assert 1 <= len(before) < 4
    with (tmp_path / RESULTS).open("a") as file:
        file.write('{"key": "torn')
    watcher = Watcher()
    run_study(plan, tmp_path, Options(jobs=2), watcher)
    assert set(watcher.done) == {run.key for run in plan.runs} - before
    assert len(lines(tmp_path)) == 4 and same(tmp_path, whole)


def test_finished_runs_are_taken_over_from_another_study(
    plan: Plan, study: Path, whole: Path, tmp_path: Path
) -> None:
    spec = load_study(study).model_copy(update={"name": "again"})
    again, out = expand(spec, study.parent), tmp_path / "again"
    watcher = Watcher()
    records = run_study(again, out, Options(sources=(whole,)), watcher)
    assert watcher.done == [] and len(lines(out)) == 4
    assert {record.study for record in records} == {"again"}
    assert [replace(r, study="tiny", directory=None) for r in records] == [
        replace(r, directory=None) for r in read_records(whole / RESULTS)
    ]
    assert all((out / str(r.directory) / "estimate.tum").is_file() for r in records)
    run_study(again, out, Options(sources=(whole,)), watcher)
    assert watcher.done == [] and len(lines(out)) == 4


def test_a_trajectory_made_elsewhere_is_judged_once_beside_the_runs(
    study: Path, whole: Path, tmp_path: Path, cache: Path
) -> None:
    first = read_records(whole / RESULTS)[0]
    template = f"{whole}/{first.directory}/estimate.tum"
    spec = load_study(study).model_copy(update={"external": {"Peer": template}})
    plan = expand(spec, study.parent)
    for _ in range(2):
        *_, peer = run_study(plan, tmp_path, Options(sources=(whole,)))
        assert len(lines(tmp_path)) == 5
    assert peer.axes == {"distribution": "Peer"} and peer.status == "done"
    ours = first.metrics["ate_m"]["yaw_pos"]["rmse"]
    assert peer.metrics["ate_m"]["yaw_pos"]["rmse"] == pytest.approx(ours, rel=1e-6)
    assert peer.metrics["completeness"] == first.metrics["completeness"]


def test_a_crash_takes_one_run_with_it(plan: Plan, whole: Path, tmp_path: Path) -> None:
    victim = plan.runs[1]
    killed: list[int] = []

    def kill(run: Run) -> None:
        if run == victim and not killed:
            killed.extend(workers_of(os.getpid()))
            for pid in killed:
                os.kill(pid, signal.SIGSEGV)

    records = run_study(plan, tmp_path, observer=Watcher(started=kill))
    assert [record.status for record in records] == ["done", "crashed", "done", "done"]
    assert records[1].reason == "the process was ended by SIGSEGV"
    assert unfinished_runs(plan, {r.key: r for r in records}) == []
    run_study(plan, tmp_path, Options(retry=True))
    assert len(lines(tmp_path)) == 5 and same(tmp_path, whole)


def test_a_late_run_is_ended_and_stays_so(plan: Plan, tmp_path: Path) -> None:
    late = dataclasses.replace(plan.runs[0], timeout_s=0.02)
    (record,) = run_study(dataclasses.replace(plan, runs=(late,)), tmp_path)
    assert (record.status, record.reason) == ("timeout", "not finished after 0.02 s (timeout_s)")
    assert not workers_of(os.getpid())
    watcher = Watcher()
    run_study(dataclasses.replace(plan, runs=(late,)), tmp_path, observer=watcher)
    assert watcher.done == []


def test_what_a_run_raises_is_in_its_record(plan: Plan, tmp_path: Path) -> None:
    bad = plan.runs[0]
    dataset = bad.config.dataset.model_copy(update={"mask": "nowhere.png"})
    bad = dataclasses.replace(bad, config=bad.config.model_copy(update={"dataset": dataset}))
    two = dataclasses.replace(plan, runs=(bad, plan.runs[1]))
    records = run_study(two, tmp_path, Options(keep="none"))
    assert [record.status for record in records] == ["crashed", "done"]
    assert "nowhere.png" in (records[0].reason or "")
    assert "nowhere.png" in (tmp_path / "runs" / bad.key / "crash.txt").read_text()
    assert records[1].directory is None and not (tmp_path / "runs" / records[1].key).exists()


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and its workers, each a process without a nanny that would start it anew."""
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    file = folder / "scheduler.json"
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    started = [
        subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *common], cwd=folder, **quiet
        )  # type: ignore[call-overload]
    ]
    try:
        wait_for(file.is_file)
        for _ in range(workers):
            command = [*dask, "worker", "--no-nanny", "--nthreads", "1", "--host", "127.0.0.1"]
            started.append(subprocess.Popen([*command, *common], cwd=folder, **quiet))  # type: ignore[call-overload]
        address = re.search(r"tcp://[0-9.:]+", file.read_text())
        assert address is not None
        yield address[0], started[1:]
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def test_dask_loses_a_worker_and_nothing_else(plan: Plan, whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with dask_cluster(tmp_path, 2) as (address, workers):
        ours: list[int] = []

        def kill(number: int) -> None:
            if number == 1:
                ours.extend(workers_of(workers[0].pid))
                workers[0].kill()
                workers[0].wait()

        watcher = Watcher(finished=kill)
        records: Sequence[RunRecord] = run_study(plan, out, Options(dask=address), watcher)
        assert workers[0].poll() is not None and workers[1].poll() is None
        wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in ours), 20.0)
    assert [record.status for record in records] == ["done"] * 4
    assert len(watcher.done) == len(set(watcher.done)) == len(lines(out)) == 4
    assert same(out, whole)
    for record in records:
        assert record.directory is not None
        estimate = Path(record.directory) / "estimate.tum"
        assert (out / estimate).read_bytes() == (whole / estimate).read_bytes()
