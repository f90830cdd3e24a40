"""``p2gd-fgo study``: run, plan, status, table, and refusals as one sentence."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from tiny_study import STUDY, write_study

from p2gd_fgo.cli.main import main
from p2gd_fgo.run_record import read_records


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["p2gd-fgo", "study", *map(str, arguments)])
    monkeypatch.setenv("COLUMNS", "120")
    with pytest.raises(SystemExit) as ended:
        main()
    code = ended.value.code
    return code if isinstance(code, int) else 0


def test_plan_run_status_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    text = STUDY.replace("timeout_s: 300", "timeout_s: 300\nsegments: true")
    study = write_study(tmp_path / "study", text)
    profile = ("--profile", "one")

    assert run(monkeypatch, "plan", study, *profile) == 0
    out = capsys.readouterr().out
    assert "2 runs, 0 finished, 2 to do" in out and "rendering 31 images" in out
    assert out.count("to do     tiny-7 · 0 · msckf · ") == 2

    assert run(monkeypatch, "run", study.parent, *profile, "--jobs", "1") == 0
    out = capsys.readouterr().out
    assert "estimated cost" in out and "2 done" in out and "2/2" in out
    assert "tiny-7" in out and "No claim, below 3 routes there is no interval" in out

    results = study.parent / "one" / "results.jsonl"
    records = read_records(results)
    assert {record.axes["distribution"] for record in records} == {"grid", "p2gd"}
    pieces = records[0].segments
    assert pieces and {"translation_percent", "moving_share", "features"} <= pieces[0].keys()

    assert run(monkeypatch, "run", study, *profile) == 0
    assert "2 runs, 2 finished, 0 to do" in capsys.readouterr().out
    assert len(results.read_text().splitlines()) == 2

    lines = [json.loads(line) for line in results.read_text().splitlines()]
    lines[0]["code"] = "older"
    lines[1]["status"], lines[1]["reason"] = "crashed", "it fell over"
    results.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    assert run(monkeypatch, "status", study, *profile) == 0
    header, row = capsys.readouterr().out.splitlines()[-2:]
    assert row.split() == ["tiny", "1", "1"]  # one crashed, one of older code
    assert [row.index("1"), row.rindex("1")] == [
        header.index(name) + len(name) - 1 for name in ("crashed", "older code")
    ]
    assert run(monkeypatch, "plan", study, *profile) == 0
    assert "done, older code" in capsys.readouterr().out
    assert run(monkeypatch, "run", study, *profile, "--keep-older-code") == 1
    out = capsys.readouterr().out
    assert "0 to do" in out and "crashed: tiny-7" in out and "it fell over" in out
    assert "2 versions of the code" in out

    assert run(monkeypatch, "table", study, *profile) == 0
    assert "distribution, compared with grid" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "missing.yaml"), "missing.yaml: no such study file"),
        (("run", "study.yaml", "--profile", "hug"), "there are full, one"),
        (("run", "study.yaml", "--keep-runs", "some"), "give small, all or none"),
        (("run", "study.yaml", "--data", "nowhere"), "--data nowhere: no such folder"),
        (("run", "study.yaml", "--out", "tiny.yaml"), "tiny.yaml: can't be written"),
        (("table", "study.yaml"), "no run of this plan is finished"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: tuple[str, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_study(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


def test_without_distributed_dask_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write_study(tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert run(monkeypatch, "run", study, "--dask", "local") == 2
    assert "pip install 'p2gd-fgo[dask]'" in capsys.readouterr().err
