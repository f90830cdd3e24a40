"""Two runs of one recording, explained by the pieces of the way in which they differ."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from p2gd_fgo.cli.main import app
from p2gd_fgo.config import load_config, override
from p2gd_fgo.errors import P2gdError
from p2gd_fgo.evaluation.frame_measures import frame_measures, read_frames
from p2gd_fgo.evaluation.run_segments import moving_objects, run_segments
from p2gd_fgo.experiment import run_experiment


@pytest.fixture(scope="module")
def runs(short_demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run directories ``grid`` and ``few``, and a third that was refused."""
    out = tmp_path_factory.mktemp("runs")
    base = override(load_config(), {"dataset.path": str(short_demo), "backend.kind": "msckf"})
    run_experiment(base, out=out / "grid")
    run_experiment(override(base, {"frontend.max_features": 60}), out=out / "few")
    refused = override(base, {"dataset.start_s": 4.0, "dataset.duration_s": 1.5})
    assert run_experiment(refused, out=out / "refused").result.status == "failed"
    return out


def explain(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["explain", *map(str, arguments)], env={"COLUMNS": "80"})


def test_a_table_for_two_runs(runs: Path) -> None:
    result = explain(runs / "grid", runs / "few", "--length", "1", "--top", "3")
    assert result.exit_code == 0, result.output
    for said in ("no masks", "straight on", "all", "over pieces", "where the runs differ most"):
        assert said in result.output
    assert "\u2026" not in result.output and all(len(li) <= 80 for li in result.output.splitlines())
    rows = run_segments(runs / "grid", length_m=1.0)
    assert f"{len(rows)} pieces of 1 m in 1 pair(s)" in result.output
    means = np.mean([row.translation_percent for row in rows])
    last = next(li for li in result.output.splitlines() if li.startswith("all"))
    assert last.split()[1:3] == [str(len(rows)), f"{means:.2f}"]


def test_folders_of_runs_are_paired_by_name(runs: Path, tmp_path: Path) -> None:
    for side, run in (("a", "grid"), ("b", "few")):
        for name in ("seed0", f"only_{side}"):
            copytree(runs / run, tmp_path / side / name)
    result = explain(tmp_path / "a", tmp_path / "b", "--length", "1")
    assert result.exit_code == 0 and "in 1 pair(s)" in result.output


def test_masks_say_what_moves(runs: Path, short_demo: Path, tmp_path: Path) -> None:
    import cv2  # loads numpy's threads: not earlier

    masks = tmp_path / "masks"
    masks.mkdir()
    images = sorted((short_demo / "mav0" / "cam0" / "data").iterdir())
    half = np.full((300, 400), 255, np.uint8)
    half[:, :200] = 0
    for image in images:
        cv2.imwrite(str(masks / f"{image.stem}.png"), half)
    config = load_config(runs / "grid" / "config.yaml")
    stamps, share = moving_objects(config, str(masks), every=4)
    assert len(stamps) == -(-len(images) // 4) and set(share) == {0.5}
    rows = run_segments(runs / "grid", length_m=1.0, moving=(stamps, share))
    assert {row.moving_share for row in rows} == {0.5}
    result = explain(runs / "grid", runs / "few", "--length", "1", "--masks", masks)
    assert result.exit_code == 0 and "moving objects" in result.output
    assert "by the masks of 1 of 1" in result.output


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ("nothing", "nothing", "no run directory, nor any in it"),
        ("grid", "nothing", "no run directory, it has no status.json"),
        ("grid", "refused", "no poses"),
    ],
)
def test_what_is_no_run_is_refused(runs: Path, a: str, b: str, said: str) -> None:
    result = explain(runs / a, runs / b)
    assert isinstance(result.exception, P2gdError)
    assert said in str(result.exception)


def test_a_run_gives_a_line_for_every_image(runs: Path) -> None:
    stamps, columns = read_frames(runs / "grid" / "frames.csv")
    tracks = np.load(runs / "grid" / "tracks.npz")
    assert stamps.tolist() == tracks["stamps_ns"].tolist()
    assert columns["features"].tolist() == tracks["counts"].tolist()
    image = np.repeat(np.arange(len(stamps)), tracks["counts"])
    for name, least in (("new", 1), ("tracks_3", 3), ("tracks_10", 10)):
        seen: dict[int, int] = {}
        expected = np.zeros(len(stamps))
        for k, identity in zip(image.tolist(), tracks["ids"].tolist(), strict=True):
            seen[identity] = seen.get(identity, 0) + 1
            expected[k] += seen[identity] == 1 if name == "new" else seen[identity] >= least
        assert columns[name].tolist() == expected.tolist()
    assert (columns["served"] <= columns["asked"]).all()
    started = np.isfinite(columns["still"])
    assert started.any() and set(columns["still"][started]) == {0.0, 1.0}
    assert np.nanmax(columns["far"]) >= 0.0 and (columns["gated"] >= 0.0).all()
    assert 0.1 < np.nanmax(columns["accel_m_s2"]) < 10.0
    assert frame_measures.__doc__ is not None
    assert all(f"``{name}``" in frame_measures.__doc__ for name in columns)
