"""The scripts of ``experiments/`` refuse bad input as the commands do: in one sentence."""

from __future__ import annotations

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_records import records

from p2gd_fgo.evaluation.measures import measure

SCRIPTS = Path(__file__).parents[2] / "experiments"


STANDING = SCRIPTS / "weights_and_policies" / "standing.py"


@pytest.mark.parametrize(
    "script", [*sorted(SCRIPTS.glob("*/run.py")), STANDING], ids=lambda p: p.parent.name
)
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


def test_rows_stand_against_their_mean() -> None:
    """A row of e times another's error is half of it above the mean, however hard the routes."""
    effects = {"grid": np.e, "p2gd": 1.0}
    made = [
        replace(r, axes={"policy": r.axes["distribution"], "backend": "msckf"})
        for r in records(
            ["car"], routes=5, seeds=2, backends=["msckf"], effects=effects, noise=0.01
        )
    ]
    found = runpy.run_path(str(STANDING))["standing"](made[:-1], measure("ate"))
    assert list(found) == ["grid", "p2gd"]
    (above, half, routes), (below, same, _) = found["grid"], found["p2gd"]
    assert above == pytest.approx(0.5, abs=0.01) and below == pytest.approx(-above)
    assert 0.0 < half < 0.02 and half == pytest.approx(same)
    assert routes == 5  # the seed that one row lacks is left out, its route stays
