"""The scripts of ``experiments/`` refuse bad input as the commands do: in one sentence."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "experiments"


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*/run.py")), ids=lambda p: p.parent.name)
def test_every_script_is_run_by_the_one_that_refuses(script: Path) -> None:
    assert script.read_text().endswith('if __name__ == "__main__":\n    run_refusing(main)\n')


def test_a_folder_that_is_missing_and_a_setting_without_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, options, says in (
        ("benchmark", [str(tmp_path / "nowhere")], "nowhere"),
        ("initialization", ["x", "--starts", "a,b"], "--starts a,b: give seconds"),
        ("pixel_noise", ["x", "--tracks", "tied"], "--tracks tied: there are free and anchored"),
        ("standstill", ["--set", "backend.window"], "KEY=VALUE"),
    ):
        script = str(SCRIPTS / name / "run.py")
        monkeypatch.setattr(sys, "argv", [script, *options])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(script, run_name="__main__")
        error = capsys.readouterr().err
        assert ended.value.code == 2, error
        assert says in error and len(error.strip().splitlines()) == 1, error
