"""Which runs a report is made of, and which it says it leaves out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from run_records import metrics, record, records, write_records, write_run

from p2gd_fgo.errors import DataError
from p2gd_fgo.report.pages.sources import find_runs
from p2gd_fgo.run_directory import RunDirectory
from p2gd_fgo.run_record import write_plan


def test_folders_at_any_depth_and_what_their_runs_differ_in(tmp_path: Path) -> None:
    for distribution in ("grid", "p2gd"):
        for seed in (0, 1):
            write_run(
                tmp_path / "a" / f"{distribution}-{seed}",
                seed=seed,
                distribution__kind=distribution,
                backend__window=20 if distribution == "grid" else 30,
            )
    write_run(tmp_path / "b", recording="/data/euroc", distribution__kind="grid")
    found = find_runs([tmp_path])
    assert not found.remarks
    by_name = {e.folder.name: e.record for e in found.entries if e.folder}
    assert set(by_name) == {"grid-0", "grid-1", "p2gd-0", "p2gd-1", "b"}
    assert by_name["p2gd-1"].axes == {
        "backend": "smoother", "distribution": "p2gd", "window": 30,
        "sequence": "kitti_0039", "seed": 1,
    }  # fmt: skip
    assert by_name["b"].sequence == "euroc"
    assert by_name["grid-0"].metrics["ate_m"]["yaw_pos"]["rmse"] > 0.0
    assert by_name["grid-0"].tracking["mean_length"] == 3.0
    assert by_name["grid-0"].cpu_ms["frame"]["median_cpu_ms"] == pytest.approx(14.2)
    assert by_name["grid-0"].events == {"started": 1}


def test_two_recordings_of_one_name_are_told_apart(tmp_path: Path) -> None:
    write_run(tmp_path / "a", recording="/one/room")
    write_run(tmp_path / "b", recording="/two/room")
    write_run(tmp_path / "c", recording="/two/room", dataset__duration_s=5.0)
    names = {e.record.sequence for e in find_runs([tmp_path]).entries}
    assert names == {"room (/one/room)", "room (/two/room)", "room (/two/room for 5.0 s)"}


def test_a_failed_run_keeps_its_reason(tmp_path: Path) -> None:
    write_run(tmp_path / "a", failed="the covariance is not finite")
    (entry,) = find_runs([tmp_path / "a"]).entries
    assert (entry.record.status, entry.record.reason) == ("failed", "the covariance is not finite")


def test_what_is_not_counted_is_said(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    write_run(tmp_path / "b")
    RunDirectory(tmp_path / "c", overwrite=False)
    found = find_runs([tmp_path])
    assert [e.folder.name for e in found.entries if e.folder] == ["a"]
    running, twice = found.remarks
    assert running.startswith(str(tmp_path / "c")) and "running" in running
    assert twice.startswith(str(tmp_path / "b")) and str(tmp_path / "a") in twice


def test_a_place_named_twice_counts_once(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    found = find_runs([tmp_path, tmp_path / "a"])
    assert len(found.entries) == 1 and not found.remarks


def test_a_study_is_read_from_its_records_alone(tmp_path: Path) -> None:
    made = [replace(r, directory=f"runs/{k}") for k, r in enumerate(records(routes=1, seeds=1))]
    write_records(tmp_path / "study" / "results.jsonl", made)
    write_run(tmp_path / "study" / "runs" / "1")
    write_run(tmp_path / "study" / "runs" / "left_over")
    for place in (tmp_path, tmp_path / "study", tmp_path / "study" / "results.jsonl"):
        found = find_runs([place])
        assert [e.record for e in found.entries] == made
        assert [e.folder is not None for e in found.entries] == [False, True] + [False] * 6


def test_of_lines_with_the_same_labels_the_last_counts(tmp_path: Path) -> None:
    old = record("g", "r", 0, "smoother", "grid", metrics(9.0, 9.0, 9.0), key="old")
    new = record("g", "r", 0, "smoother", "grid", metrics(1.0, 1.0, 1.0), key="new")
    found = find_runs([write_records(tmp_path / "results.jsonl", [old, new])])
    assert [e.record.key for e in found.entries] == ["new"]
    assert "1 runs stand in it again" in found.remarks[0]


def test_lines_that_the_study_no_longer_names_are_left_out(tmp_path: Path) -> None:
    made = records(groups=["car"], routes=1, seeds=2, backends=["smoother"])
    path = write_records(tmp_path / "results.jsonl", made)
    write_plan(tmp_path, [made[0].key, made[2].key])
    for place in (tmp_path, path):
        found = find_runs([place])
        assert [e.record for e in found.entries] == [made[0], made[2]]
        assert "2 runs are none that the study names now" in found.remarks[0]


def test_a_run_in_two_studies_counts_once(tmp_path: Path) -> None:
    made = records(groups=["car"], routes=1, seeds=2, backends=["smoother"])
    write_records(tmp_path / "a" / "results.jsonl", made)
    again = [replace(r, study="other") for r in made[:2]]
    renamed = [replace(made[2], study="other", axes={"policy": "grid"})]
    write_records(tmp_path / "b" / "results.jsonl", [*again, *renamed])
    found = find_runs([tmp_path / "a", tmp_path / "b"])
    assert [e.record for e in found.entries][:4] == made and len(found.entries) == 5
    assert "2 runs stand in more than one of the studies" in found.remarks[0]


@pytest.mark.parametrize("name", ["nowhere", "empty", "file.txt"])
def test_a_place_without_runs_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.txt").write_text("x")
    with pytest.raises(DataError, match=name):
        find_runs([tmp_path / name])


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("metrics.json", "{"),
        ("metrics.json", "[1]"),
        ("config.yaml", "a: [1"),
        ("events.jsonl", "{}\n"),
        ("events.jsonl", "x\n"),
    ],
)
def test_a_broken_file_is_named(tmp_path: Path, file: str, text: str) -> None:
    write_run(tmp_path / "a")
    (tmp_path / "a" / file).write_text(text)
    with pytest.raises(DataError, match=file) as raised:
        find_runs([tmp_path])
    assert "\n" not in str(raised.value)


def test_metrics_of_a_run_without_truth(tmp_path: Path) -> None:
    write_run(tmp_path / "a", truth=False)
    (entry,) = find_runs([tmp_path]).entries
    assert entry.record.metrics["ate_m"] is None
    json.dumps(entry.record.metrics, allow_nan=False)
