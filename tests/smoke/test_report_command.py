"""``p2gd-fgo report``: tables on the screen, files where they were asked for, refusals."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from run_records import write_run

from p2gd_fgo.cli.main import main


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, os.environ.get(name, "1"))
    monkeypatch.setattr(sys, "argv", ["p2gd-fgo", "report", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return stop.value.code if isinstance(stop.value.code, int) else 0


def test_writes_what_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    for kind in ("grid", "p2gd"):
        write_run(tmp_path / "runs" / kind, distribution__kind=kind)
    files = {name: tmp_path / f"out.{name}" for name in ("html", "tex", "md")}
    code = call(
        monkeypatch, tmp_path / "runs", "--html", files["html"], "--latex", files["tex"],
        "--markdown", files["md"], "--figures", tmp_path / "pictures", "--alignment", "se3",
    )  # fmt: skip
    assert code == 0
    printed = capsys.readouterr().out
    assert "Absolute pose error" in printed and "aligned by se3" in printed
    assert max(map(len, printed.splitlines())) <= max(120, len(str(tmp_path)) + 30)
    for path in files.values():
        assert f"written: {path}" in printed and path.stat().st_size > 500
    assert len(list((tmp_path / "pictures").glob("*.pdf"))) >= 5
    assert r"\toprule" in files["tex"].read_text()


def test_refuses_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_run(tmp_path / "run")
    (tmp_path / "empty").mkdir()
    for arguments in (
        (tmp_path / "empty",),
        (tmp_path / "run", "--alignment", "se2"),
        (tmp_path / "run", "--baseline", "backend=none"),
        (tmp_path / "run", "--latex", tmp_path / "empty"),
    ):
        assert call(monkeypatch, *arguments) == 2
        error = capsys.readouterr().err
        assert len(error.strip().splitlines()) == 1 and "Traceback" not in error
        assert ".part" not in error
