"""``p2gd-fgo doctor``: table, JSON, picture, exit codes; and the room without truth."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.cli.main import main


def call(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object
) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["p2gd-fgo", "doctor", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    printed = capsys.readouterr()
    return stop.value.code if isinstance(stop.value.code, int) else 0, printed.out, printed.err


def test_healthy_recording_and_its_picture(
    short_demo: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    picture = tmp_path / "lens.png"
    code, out, err = call(monkeypatch, capsys, short_demo, "--picture", picture)
    assert code == 0, out + err
    assert "fit to run" in out and "not fit" not in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "folder.png").mkdir()
    code, _, err = call(monkeypatch, capsys, short_demo, "--picture", tmp_path / "folder.png")
    assert code == 2 and "--picture" in err and "can't be written" in err


def test_broken_recording_without_truth(
    short_demo: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    copy = tmp_path / "broken"
    shutil.copytree(short_demo, copy, ignore=shutil.ignore_patterns("state_*", "data"))
    (copy / "mav0" / "cam0" / "data").symlink_to(short_demo / "mav0" / "cam0" / "data")
    path = copy / "mav0" / "imu0" / "data.csv"
    rows = [row for row in path.read_text().splitlines() if row[:1].isdigit()]
    values = np.loadtxt(rows, delimiter=",")[:, 1:]
    values[:, 2] *= -1.0
    stamps = [row.partition(",")[0] for row in rows]
    path.write_text(
        "\n".join(
            f"{s},{','.join(map(repr, v))}" for s, v in zip(stamps, values.tolist(), strict=True)
        )
    )
    code, out, _ = call(monkeypatch, capsys, copy, "--json")
    report = json.loads(out)
    assert code == 1
    assert report["verdict"] == "not fit to run"
    assert report["faults"] == ["gyro_axes"]


def test_bad_input_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = call(monkeypatch, capsys, tmp_path / "nothing")
    assert code == 2 and len(err.strip().splitlines()) == 1
