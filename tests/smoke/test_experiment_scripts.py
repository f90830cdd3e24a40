"""The scripts of ``experiments/`` refuse bad input as the commands do: in one sentence."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "experiments"


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*/run.py")), ids=lambda p: p.parent.name)
def test_every_script_is_run_by_the_one_that_refuses(script: Path) -> None:
    assert script.read_text().endswith('if __name__ == "__main__":\n    run_refusing(main)\n')


def test_a_folder_that_is_missing_and_a_setting_without_value(tmp_path: Path) -> None:
    for name, options, says in (
        ("benchmark", [str(tmp_path / "nowhere")], "nowhere"),
        ("initialization", ["x", "--starts", "a,b"], "--starts a,b: give seconds"),
        ("standstill", ["--set", "backend.window"], "KEY=VALUE"),
    ):
        done = subprocess.run(
            [sys.executable, str(SCRIPTS / name / "run.py"), *options],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 2, done.stderr
        assert says in done.stderr and len(done.stderr.strip().splitlines()) == 1, done.stderr
