"""The run's folder: refused, replaced, marked, and written whole or not at all."""

from __future__ import annotations

import csv
import json
import time
from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.atomic_files import atomic_path, write_text
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.run_directory import FILES, RunDirectory, read_status
from p2gd_fgo.types import Event, TrackRecord, Trajectory


def test_life_of_a_run(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path / "results" / "a", overwrite=False)
    status = read_status(run.path)
    assert status is not None and status["state"] == "running" and status["finished_utc"] is None
    run.write_config("name: a\n")
    run.write_trajectory("estimate.tum", Trajectory(np.array([5]), np.eye(4)[None]))
    run.finish("done")
    status = read_status(run.path)
    assert status is not None and status["state"] == "done" and status["finished_utc"]
    assert (run.path / "estimate.tum").read_text() == "0.000000005 0 0 0 0 0 0 1\n"
    assert (run.path / "config.yaml").read_text() == "name: a\n"
    assert {p.name for p in run.path.iterdir()} <= set(FILES)


def test_a_failed_run_keeps_what_it_has(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path / "a", overwrite=False)
    run.write_config("name: a\n")
    run.finish("failed", "the window has too few features")
    status = read_status(run.path)
    assert status is not None and status["state"] == "failed"
    assert status["reason"] == "the window has too few features"
    assert (run.path / "config.yaml").exists()
    with pytest.raises(ValueError, match="reason"):
        run.finish("failed")


def test_an_existing_run_is_refused_then_replaced(tmp_path: Path) -> None:
    old = RunDirectory(tmp_path, overwrite=False)
    old.write_metrics({"ate": 1.0})
    (tmp_path / "my_notes.txt").write_text("keep me")
    with pytest.raises(ConfigError, match="--overwrite"):
        RunDirectory(tmp_path, overwrite=False)
    assert (tmp_path / "metrics.json").exists()
    RunDirectory(tmp_path, overwrite=True)
    assert not (tmp_path / "metrics.json").exists()
    assert (tmp_path / "my_notes.txt").read_text() == "keep me"


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", ["thesis.tex", "config.yaml", "status.json"])
def test_a_folder_of_something_else_is_never_touched(
    tmp_path: Path, name: str, overwrite: bool
) -> None:
    (tmp_path / name).write_text("{}")
    with pytest.raises(ConfigError, match="no run"):
        RunDirectory(tmp_path, overwrite=overwrite)
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_empty_folder_is_taken_and_file_is_refused(tmp_path: Path) -> None:
    RunDirectory(tmp_path, overwrite=False)
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="a file is in the way"):
        RunDirectory(tmp_path / "file", overwrite=True)
    with pytest.raises(ConfigError, match="can't be written"):
        RunDirectory(tmp_path / "file" / "below", overwrite=True)


def test_metrics_are_sorted_and_hold_no_nan(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path, overwrite=False)
    run.write_metrics(
        {"b": float("nan"), "a": {"z": np.float64(2.5), "y": np.array([1.0, np.inf])}, "c": (1, 2)}
    )
    text = (tmp_path / "metrics.json").read_text()
    assert list(json.loads(text)) == ["a", "b", "c"]
    assert json.loads(text) == {"a": {"y": [1.0, None], "z": 2.5}, "b": None, "c": [1, 2]}
    assert "NaN" not in text and "Infinity" not in text


def test_tracks_are_the_same_bytes_at_another_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = TrackRecord(
        np.array([7, 8]), np.array([1, 2]), np.array([5, 5]), np.array([0, 0, 3]),
        np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]),
    )  # fmt: skip
    written = []
    for now in (1.0e9, 1.6e9):
        monkeypatch.setattr(time, "time", lambda now=now: now)
        run = RunDirectory(tmp_path / str(now), overwrite=False)
        run.write_tracks(record)
        written.append((run.path / "tracks.npz").read_bytes())
    assert written[0] == written[1]
    with np.load(run.path / "tracks.npz") as stored:
        assert set(stored) == {"stamps_ns", "counts", "asked", "ids", "normalized"}
        np.testing.assert_array_equal(stored["ids"], record.ids)
        assert stored["normalized"].dtype == np.float32
        np.testing.assert_allclose(stored["normalized"], record.normalized, atol=1e-7)


def test_pictures_of_the_old_run_go_and_others_stay(tmp_path: Path) -> None:
    old = RunDirectory(tmp_path, overwrite=False)
    for index in (7, 120):
        old.image_figure("p2gd", index).write_text("png")
    assert (tmp_path / "figures" / "p2gd_000120.png").exists()
    (tmp_path / "figures" / "mine_000001.png").write_text("keep me")
    RunDirectory(tmp_path, overwrite=True)
    assert [p.name for p in (tmp_path / "figures").iterdir()] == ["mine_000001.png"]


def test_timing_columns_are_the_union_of_stages(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path, overwrite=False)
    rows = [{"frame": (3.0, 4.0)}, {"frame": (5.0, 6.0), "smoother": (1.25, 1.5)}]
    run.write_timing(np.array([1403636584763555527, 1403636584813555527]), rows)
    with (tmp_path / "timing.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == [
        *("stamp_ns", "frame_cpu_ms", "frame_wall_ms", "smoother_cpu_ms", "smoother_wall_ms")
    ]
    assert lines[0]["stamp_ns"] == "1403636584763555527"
    assert lines[0]["smoother_cpu_ms"] == ""
    assert float(lines[1]["smoother_cpu_ms"]) == 1.25
    assert float(lines[1]["frame_wall_ms"]) == 6.0


def test_events_are_one_object_a_line(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path, overwrite=False)
    run.write_events([Event(7, "gap", "a hole of 0.2 s\nin the IMU", {"gap_s": 0.2})])
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert len(lines) == 1
    assert json.loads(lines[0]) == {
        "stamp_ns": 7,
        "kind": "gap",
        "message": "a hole of 0.2 s\nin the IMU",
        "data": {"gap_s": 0.2},
    }


def test_a_writer_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_file_that_cannot_be_written_goes_by_its_own_name(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "folder", tmp_path / "missing" / "page.html"):
        with pytest.raises(OSError) as caught:
            write_text(path, "x")
        assert caught.value.filename == str(path)
    assert not list(tmp_path.glob(".*"))
