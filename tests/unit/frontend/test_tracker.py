from __future__ import annotations

import numpy as np
import pytest
from frontend_scenes import HEIGHT, WIDTH, shifted, texture

from p2gd_fgo.frontend.tracker import KltTracker
from p2gd_fgo.types import FloatArray


def _points(margin: float = 45.0) -> FloatArray:
    rng = np.random.default_rng(3)
    return rng.uniform([margin, margin], [WIDTH - margin, HEIGHT - margin], (80, 2))


@pytest.mark.parametrize("flow", [(0.0, 0.0), (0.4, -0.7), (6.3, 2.6), (-17.5, 11.25)])
def test_known_flow_below_a_tenth_of_a_pixel(flow: tuple[float, float]) -> None:
    image = texture()
    result = KltTracker(15, 5, 0.5).track(image, shifted(image, flow), _points(), None)
    assert result.consistent.mean() > 0.75
    error = np.linalg.norm(result.pixels - _points() - flow, axis=1)[result.consistent]
    assert np.median(error) < 0.05
    assert np.percentile(error, 95) < 0.1


def test_a_guess_carries_beyond_the_reach_of_the_pyramid() -> None:
    image = texture(width=2 * WIDTH)
    flow = (-90.0, 3.0)
    moved = shifted(image, flow)
    points = _points() + np.array([150.0, 0.0])
    tracker = KltTracker(15, 3, 1.0)

    def share_found(guess: FloatArray | None) -> float:
        result = tracker.track(image, moved, points, guess)
        error = np.linalg.norm(result.pixels - points - flow, axis=1)
        return float((result.consistent & (error < 0.2)).mean())

    assert share_found(points + np.array([-88.0, 4.5])) > 0.9
    assert share_found(None) < 0.2


def test_an_occluded_patch_fails_the_way_back() -> None:
    image = texture()
    current = shifted(image, (2.0, 1.0))
    current[80:160, 100:220] = texture(9)[80:160, 100:220]
    points = _points()
    u, v = points.T
    hidden = (u > 112) & (u < 206) & (v > 92) & (v < 146)
    result = KltTracker(15, 4, 0.5).track(image, current, points, None)
    assert hidden.sum() >= 8
    assert result.consistent[hidden].mean() < 0.2
    seen = (u < 85) | (u > 235) | (v < 65) | (v > 175)
    assert result.consistent[seen].mean() > 0.95


def test_no_texture_no_tracks() -> None:
    black = np.zeros((HEIGHT, WIDTH), np.uint8)
    for previous, current in ((texture(), black), (black, texture()), (black, black)):
        assert not KltTracker(15, 5, 1.0).track(previous, current, _points(), None).consistent.any()


def test_no_points() -> None:
    result = KltTracker(15, 5, 1.0).track(texture(), texture(), np.zeros((0, 2)), None)
    assert result.pixels.shape == (0, 2)
    assert result.consistent.shape == (0,)
