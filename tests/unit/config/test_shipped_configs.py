"""The configurations of ``configs/``: they load, and say what the paper and the data sets say."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.config import load_config, override, resolve

ROOT = Path(__file__).parents[3] / "configs"
FOLDERS = {"kaist": 5, "euroc": 11, "tum_vi": 6, "kitti_raw": 5, "robot": 7}
BASES = sorted(ROOT.glob("*.yaml"))
RECORDINGS = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("*.yaml"))
WIDTHS = {"kaist": 1280, "euroc": 752, "tum_vi": 512, "kitti_raw": 1392, "robot": 800}


def test_all_are_there() -> None:
    found = {folder: len(list((ROOT / folder).glob("*"))) for folder in FOLDERS}
    assert found == FOLDERS
    assert {path.name for path in ROOT.iterdir() if path.is_dir()} == {*FOLDERS, "simulation"}


@pytest.mark.parametrize("path", [*BASES, *RECORDINGS], ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_each_loads_resolves_and_says_where_its_numbers_come_from(path: Path) -> None:
    config = load_config(path)
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# ") and len(text.splitlines()[0]) <= 120
    for width in (640, 1280):
        assert resolve(config, width).frontend.max_features is not None


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_a_recording_differs_from_its_base_by_its_name_alone(path: Path) -> None:
    """So that running the bases, as the smoke tests do, runs them all."""
    base = next(line for line in path.read_text().splitlines() if line.startswith("extends: "))
    parent = path.parent / base.removeprefix("extends: ")
    assert parent in {path.parent / ".." / other.name for other in BASES}
    assert load_config(path) == override(load_config(parent), {"name": path.stem})


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_the_papers_settings(path: Path) -> None:
    config = resolve(load_config(path), WIDTHS[path.parent.name])
    frontend = config.frontend
    found = frontend.max_features, frontend.grid, frontend.min_distance_px, config.backend.window
    car = path.parent.name in ("kaist", "kitti_raw")
    assert found == ((180, (10, 6), 40.0, 20) if car else (150, (8, 6), 30.0, 20))
    assert config.backend.msckf.fej == (path.parent.name == "robot")
    if path.parent.name != "robot":
        assert config.initialization.kind == "given"
