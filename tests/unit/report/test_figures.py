"""The figure is written in every state that a run can end in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from p2gd_fgo.evaluation.evaluate import error_series
from p2gd_fgo.report.figures import trajectory_figure
from p2gd_fgo.types import Trajectory


def line(count: int, noise: float = 0.0) -> Trajectory:
    stamps = np.arange(count, dtype=np.int64) * 100_000_000
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 3] = np.arange(count)
    T[:, :3, 3] += noise * np.random.default_rng(0).normal(size=(count, 3))
    return Trajectory(stamps, T)


def ink(path: Path) -> float:
    """Share of pixels that aren't white."""
    picture = imread(path)
    assert picture.shape[0] > 500 and picture.shape[1] > 1000
    return float(np.mean(picture[..., :3].min(axis=-1) < 0.97))


@pytest.mark.parametrize("count", [3, 80])
def test_with_truth(tmp_path: Path, count: int) -> None:
    estimate, truth = line(count, 0.3), line(100)
    path = tmp_path / "trajectory.png"
    errors = error_series(estimate, truth, "yaw_pos")
    trajectory_figure(path, estimate, truth, errors, title="a $ b $ c", note="failed: 3 % " * 40)
    assert ink(path) > 0.05
    assert [p.name for p in tmp_path.iterdir()] == ["trajectory.png"]


@pytest.mark.parametrize("count", [0, 1, 50])
def test_without_truth(tmp_path: Path, count: int) -> None:
    path = tmp_path / "trajectory.png"
    trajectory_figure(path, line(count), None, None, title="no truth")
    assert ink(path) > 0.01


def test_perfect_estimate_and_holes(tmp_path: Path) -> None:
    whole = line(60)
    keep = np.r_[0:20, 40:60]
    estimate = Trajectory(whole.stamps_ns[keep], whole.T_world_imu[keep])
    path = tmp_path / "trajectory.png"
    trajectory_figure(path, estimate, whole, error_series(estimate, whole, "origin"), title="x")
    assert ink(path) > 0.01
