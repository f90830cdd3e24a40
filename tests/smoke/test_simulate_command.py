"""``p2gd-fgo simulate``: a folder with its sheet, run again for nothing, and its refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from p2gd_fgo.cli.main import main

TINY = """
duration_s: 0.4
world: {kind: campus, block_m: [20, 24], detail: 0.25}
vehicle: {kind: robot, speed: [0.8, 1.5], standstill_s: 0, imu_height_m: 0.6}
camera: {width: 96, height: 72, focal: [60, 60], center: [48, 36], position: [0.3, 0, 0]}
"""


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["p2gd-fgo", "simulate", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    code = ended.value.code
    return code if isinstance(code, int) else 0


def test_a_recording_and_its_sheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, out = tmp_path / "tiny.yaml", tmp_path / "out"
    scenario.write_text(TINY)
    arguments = (scenario, "--seed", 4, "--out", out, "--jobs", 1, "--preview", 2)
    assert run(monkeypatch, *arguments) == 0
    assert "5 images, 5 of them rendered now" in capsys.readouterr().out
    assert (out / "preview.jpg").is_file() and (out / "mav0" / "imu0" / "data.csv").is_file()
    assert "seed: 4" in (out / "scenario.yaml").read_text()
    assert run(monkeypatch, *arguments) == 0
    assert "5 images, 0 of them rendered now" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("moon",), "'moon' is neither a preset nor a scenario file"),
        (("kaist_like", "--set", "vehicle.speed=[-1,3]"), "--set: vehicle.speed.0 is -1"),
        (("kaist_like", "--duration", "0"), "--set: duration_s is 0.0"),
        (("kaist_like", "--set", "seed"), "give a key and a value as KEY=VALUE"),
        (("kaist_like", "--route", "missing.tum"), "missing.tum: no such trajectory file"),
        (("kaist_like", "--only-preview"), "needs --preview"),
        (("demo", "--reuse", "missing"), "--reuse missing: no such folder"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: tuple[str, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *arguments, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err.strip()
    assert words in error and len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()
