"""What a study leaves on disk: whole lines, one writer, no remains of a killed run."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.expansion import expand
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.spec import StudySpec
from p2gd_fgo.study.store import Store, is_finished, lacks_segments, records_in
from p2gd_fgo.study.work import unfinished


@pytest.fixture(scope="module")
def runs() -> tuple[Run, ...]:
    spec = {
        "name": "s",
        "question": "q",
        "sequences": [{"simulate": "robot_like", "routes": [3], "duration_s": 2}],
        "axes": {"distribution": ["grid", "p2gd"], "seed": [0, 1]},
    }
    return expand(StudySpec.model_validate(spec), Path()).runs


def record(run: Run) -> RunRecord:
    return unfinished(run, "failed", "for a test", 1.0)


def leave_files(store: Store, run: Run, truth: str) -> None:
    store.scratch(run).mkdir(parents=True)
    (store.scratch(run) / "truth.tum").write_text(truth)


def test_a_line_and_a_directory_for_each_run(tmp_path: Path, runs: tuple[Run, ...]) -> None:
    with Store(tmp_path / "out") as store:
        leave_files(store, runs[0], "1")
        added = store.add(runs[0], record(runs[0]))
        assert added.directory == f"runs/{runs[0].key}"
        assert store.add(runs[1], record(runs[1])).directory is None
        assert records_in(tmp_path / "out") == store.records
    assert (tmp_path / "out" / "runs" / runs[0].key / "truth.tum").read_text() == "1"
    with Store(tmp_path / "out") as again:
        assert again.records == store.records


def test_what_a_killed_process_left_is_taken_away(tmp_path: Path, runs: tuple[Run, ...]) -> None:
    with Store(tmp_path) as store:
        store.add(runs[0], record(runs[0]))
    with store.path.open("a") as file:
        file.write(record(runs[1]).to_json()[:50])
    stale = tmp_path / "runs" / f".{runs[1].key}.part"
    stale.mkdir(parents=True)
    (stale / "estimate.tum").write_text("half")
    with Store(tmp_path) as store:
        assert set(store.records) == {runs[0].key} and not stale.exists()
        store.add(runs[1], record(runs[1]))
    assert len(store.path.read_text().splitlines()) == 2
    assert set(records_in(tmp_path)) == {runs[0].key, runs[1].key}


def test_a_directory_without_a_line_is_replaced(tmp_path: Path, runs: tuple[Run, ...]) -> None:
    stale = tmp_path / "runs" / runs[0].key
    stale.mkdir(parents=True)
    (stale / "old.txt").write_text("of a run that has no line")
    with Store(tmp_path) as store:
        leave_files(store, runs[0], "new")
        store.add(runs[0], record(runs[0]))
    assert [path.name for path in stale.iterdir()] == ["truth.tum"]


def test_half_a_run_is_not_kept(tmp_path: Path, runs: tuple[Run, ...]) -> None:
    with Store(tmp_path) as store:
        leave_files(store, runs[0], "half")
        crashed = dataclasses.replace(record(runs[0]), status="crashed")
        assert store.add(runs[0], crashed).directory is None
        leave_files(store, runs[1], "half")
        (store.scratch(runs[1]) / "crash.txt").write_text("the traceback")
        assert store.add(runs[1], crashed).directory is not None
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [runs[1].key]


def test_a_full_disk_is_a_sentence(
    tmp_path: Path, runs: tuple[Run, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with Store(tmp_path) as store:
        monkeypatch.setattr("os.fsync", full)
        with pytest.raises(DataError, match="No space left on device"):
            store.add(runs[0], record(runs[0]))
        assert store.records == {}


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path), pytest.raises(ConfigError, match="another study is writing"):
        Store(tmp_path).__enter__()
    with Store(tmp_path):
        pass


def test_equal_truths_of_a_recording_take_their_space_once(
    tmp_path: Path, runs: tuple[Run, ...]
) -> None:
    with Store(tmp_path) as store:
        for run, truth in zip(runs, ("same", "same", "other", "same"), strict=True):
            leave_files(store, run, truth)
            store.add(run, record(run))
    files = [tmp_path / "runs" / run.key / "truth.tum" for run in runs]
    assert [path.read_text() for path in files] == ["same", "same", "other", "same"]
    assert [path.stat().st_nlink for path in files] == [3, 3, 1, 3]


def test_when_a_record_stands_for_its_run(runs: tuple[Run, ...]) -> None:
    crashed = dataclasses.replace(record(runs[0]), status="crashed")
    done = dataclasses.replace(crashed, status="done", reason=None)
    failed = dataclasses.replace(crashed, status="failed")
    now = crashed.code
    assert not is_finished(None, now)
    assert all(is_finished(r, now) for r in (crashed, done, failed))
    assert [is_finished(r, now, retry=True) for r in (crashed, done, failed)] == [False, True, True]
    assert not is_finished(done, "newer")
    assert is_finished(done, "newer", keep_older_code=True)


def test_without_hard_links_every_run_keeps_its_truth(
    tmp_path: Path, runs: tuple[Run, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr("os.link", refuse)
    with Store(tmp_path) as store:
        for run in runs[:2]:
            leave_files(store, run, "same")
            store.add(run, record(run))
    for run in runs[:2]:
        files = sorted((tmp_path / "runs" / run.key).iterdir())
        assert [path.name for path in files] == ["truth.tum"] and files[0].read_text() == "same"


def test_runs_whose_pieces_are_wanted_later_are_done_again(runs: tuple[Run, ...]) -> None:
    done = dataclasses.replace(record(runs[0]), status="done", reason=None)
    wanting = dataclasses.replace(runs[0], segments=True)
    assert lacks_segments(wanting, done) and not lacks_segments(runs[0], done)
    assert not lacks_segments(wanting, dataclasses.replace(done, segments=[]))
    assert not lacks_segments(wanting, dataclasses.replace(done, status="failed"))
