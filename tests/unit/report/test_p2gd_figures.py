"""The pictures of single images show what they are given, whatever is missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from p2gd_fgo.config import P2gdConfig
from p2gd_fgo.distribution.base import Explanation
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.report.frame_capture import Snapshot
from p2gd_fgo.report.p2gd_figures import features_figure, p2gd_figure
from p2gd_fgo.types import FloatArray

CAMERA = RadTanCamera(640, 480, 400.0, 400.0, 320.0, 240.0, -0.2, 0.03, 0.0, 0.0)
HORIZON = 20
ROWS, COLUMNS = 6, 8


def forward_drive(steps: int) -> FloatArray:
    """T_world_cam (steps + 1, 4, 4) of a camera that looks along the world's x and drives so."""
    T = np.tile(np.eye(4), (steps + 1, 1, 1))
    T[:, :3, :3] = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    T[:, 0, 3] = 0.2 * np.arange(steps + 1)
    return T


def explanation(points: int = 40, steps: int = HORIZON) -> Explanation:
    rng = np.random.default_rng(0)
    world = rng.uniform([4.0, -3.0, -1.0], [15.0, 3.0, 2.0], (points, 3))
    T = forward_drive(steps)
    pixels = np.full((points, steps + 1, 2), np.nan)
    lengths = np.zeros(points, np.int64)
    for k in range(steps + 1):
        cam = (world - T[k, :3, 3]) @ T[k, :3, :3]
        seen = CAMERA.visible(cam) & (lengths == k)
        pixels[seen, k] = CAMERA.project(cam[seen])
        lengths[seen] += 1
    values = np.radians(rng.uniform(0.0, 25.0, points))
    weights = np.where(np.arange(ROWS * COLUMNS) % 3 > 0, 0.2, 0.0).reshape(ROWS, COLUMNS)
    quotas = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS) % 8
    kept = np.arange(points) % 2 == 0
    visible = lengths > 0
    return Explanation(
        world[visible], kept[visible], T, pixels[visible], lengths[visible] - 1, values[visible],
        weights, quotas,
    )  # fmt: skip


def snapshot(why: Explanation | None) -> Snapshot:
    rng = np.random.default_rng(1)
    return Snapshot(
        120, 12.0, 12_000_000_000, rng.integers(0, 255, (480, 640), dtype=np.uint8),
        rng.uniform(0.0, 480.0, (50, 2)), np.arange(50) > 40,
        np.full((ROWS, COLUMNS), 3), why, "no prior poses",
    )  # fmt: skip


def colored(path: Path) -> float:
    """Share of pixels with a colour, neither grey nor white."""
    picture = imread(path)[..., :3]
    return float(np.mean(np.ptp(picture, axis=-1) > 0.1))


@pytest.mark.parametrize(
    "changes", [{}, {"weight": "track_length"}, {"allocate": "d_optimal"}], ids=str
)
def test_all_three_panels(tmp_path: Path, changes: dict[str, str]) -> None:
    path = tmp_path / "p2gd_000120.png"
    p2gd_figure(
        path, snapshot(explanation()), CAMERA, P2gdConfig.model_validate(changes), title="a $ b"
    )
    picture = imread(path)
    assert picture.shape[0] > 700 and picture.shape[1] > 1000
    assert colored(path) > 0.05
    assert [p.name for p in tmp_path.iterdir()] == ["p2gd_000120.png"]


@pytest.mark.parametrize(("points", "steps"), [(0, HORIZON), (1, 1), (40, 0), (1, 0)])
def test_few_points_and_short_horizons(tmp_path: Path, points: int, steps: int) -> None:
    why = explanation(points, steps)
    if points == 0:
        why = replace(why, weights=np.zeros((ROWS, COLUMNS)))
    path = tmp_path / "a.png"
    p2gd_figure(path, snapshot(why), CAMERA, P2gdConfig(), title="few")
    assert path.exists()


def test_heat_follows_the_weights(tmp_path: Path) -> None:
    # The same picture but for the weights: only the map may change, and one cell in 48 by little.
    why = explanation()
    pictures = []
    for factor in (1.0, 0.5):
        path = tmp_path / f"{factor}.png"
        weights = why.weights.copy()
        weights[2, 4] *= factor
        changed = snapshot(replace(why, weights=weights))
        p2gd_figure(path, changed, CAMERA, P2gdConfig(), title="t")
        pictures.append(imread(path))
    differs = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.02
    rows, columns = np.nonzero(differs)
    assert 0.001 < differs.mean() < 0.02
    assert rows.max() < 0.5 * len(differs) and columns.max() < 0.5 * differs.shape[1]


def test_a_camera_that_looks_straight_down(tmp_path: Path) -> None:
    why = explanation()
    T = why.T_world_cam.copy()
    T[:, :3, :3] = [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    looking = snapshot(replace(why, T_world_cam=T))
    p2gd_figure(tmp_path / "a.png", looking, CAMERA, P2gdConfig(), title="down")
    assert colored(tmp_path / "a.png") > 0.05


def test_features_alone(tmp_path: Path) -> None:
    for name, quotas in (("with", snapshot(None).quotas), ("without", None)):
        path = tmp_path / f"{name}.png"
        features_figure(path, replace(snapshot(None), quotas=quotas), title="t", note="why " * 60)
        assert 0.0005 < colored(path) < 0.05
    with pytest.raises(ValueError, match="explanation"):
        p2gd_figure(tmp_path / "x.png", snapshot(None), CAMERA, P2gdConfig(), title="t")


def test_what_a_mask_covers_is_shaded(tmp_path: Path) -> None:
    masked = np.zeros((480, 640), np.bool_)
    masked[240:, :320] = True
    pictures = []
    for name, mask in (("without", None), ("with", masked)):
        path = tmp_path / f"{name}.png"
        shown = replace(snapshot(None), quotas=None, masked=mask)
        features_figure(path, shown, title="t")
        pictures.append(imread(path)[..., :3].mean(axis=-1))
    low, side = (size // 2 for size in pictures[0].shape)
    darker = [
        float((before - after)[rows, columns].mean())
        for before, after in [pictures]
        for rows, columns in (
            (slice(low + 40, -60), slice(20, side - 40)),
            (slice(60, low - 40), slice(20, side - 40)),
            (slice(low + 40, -60), slice(side + 40, -20)),
        )
    ]
    assert darker[0] > 0.1 and max(map(abs, darker[1:])) < 0.02
    whole = replace(snapshot(explanation()), masked=masked)
    p2gd_figure(tmp_path / "p2gd.png", whole, CAMERA, P2gdConfig(), title="t")
    assert (tmp_path / "p2gd.png").exists()
