"""A run that can't be written, and one that is read from elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.run_segments import run_segments
from p2gd_fgo.experiment import run_experiment
from p2gd_fgo.run_directory import CONFIG, RunDirectory, read_status


def short(path: str) -> Config:
    settings: dict[str, object] = {
        "dataset.path": path, "dataset.duration_s": 4.0, "backend.kind": "dead_reckoning"
    }  # fmt: skip
    return override(load_config(), settings)


@pytest.mark.parametrize("late", ["write_trajectory", "finish"])
def test_a_full_disk_is_a_sentence_and_the_run_not_under_way(
    late: str, short_demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = getattr(RunDirectory, late)
    asked: list[str] = []

    def full(directory: RunDirectory, *arguments: object) -> None:
        asked.append(late)
        if len(asked) == 1:
            raise OSError(28, "No space left on device")
        original(directory, *arguments)

    monkeypatch.setattr(RunDirectory, late, full)
    with pytest.raises(DataError, match=r"out: the run can't be written \(No space left"):
        run_experiment(short(str(short_demo)), out=tmp_path / "out")
    found = read_status(tmp_path / "out")
    assert found is not None and found["state"] == "failed"
    assert "No space left" in found["reason"]


def test_a_run_knows_its_recording_from_anywhere(
    short_demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(short_demo.parent)
    made = run_experiment(short(short_demo.name), out=tmp_path / "out")
    assert load_config(made.path / CONFIG).dataset.path == str(short_demo.resolve())
    assert run_segments(made.path, length_m=1.0)
