from __future__ import annotations

import cv2
import numpy as np
import pytest
from frontend_scenes import HEIGHT, WIDTH, settings, shifted, texture

from p2gd_fgo.frontend.orb import OrbTracker
from p2gd_fgo.types import FloatArray, Image


def _tracker(search_px: float = 40.0, max_hamming: int = 80, ratio: float = 0.95) -> OrbTracker:
    return OrbTracker(20, search_px=search_px, max_hamming=max_hamming, ratio=ratio)


def _corners(image: Image, margin: float = 45.0) -> FloatArray:
    """FAST corners, moved off the pixels as sub-pixel refinement would."""
    keypoints = cv2.FastFeatureDetector.create(20, nonmaxSuppression=True).detect(image)
    pixels = np.asarray(cv2.KeyPoint.convert(keypoints), np.float64)
    inside = (pixels >= margin).all(axis=1) & (pixels <= [WIDTH - margin, HEIGHT - margin]).all(1)
    pixels = pixels[inside][::4]
    return pixels + np.random.default_rng(0).uniform(-0.49, 0.49, pixels.shape)


@pytest.mark.parametrize("flow", [(0.0, 0.0), (5.0, -3.0), (0.4, -0.7), (-17.5, 11.25)])
def test_known_flow(flow: tuple[float, float]) -> None:
    image = texture()
    points = _corners(image)
    result = _tracker().track(image, shifted(image, flow), points, None)
    assert len(points) > 50
    assert result.consistent.mean() > 0.9
    error = np.linalg.norm(result.pixels - points - flow, axis=1)[result.consistent]
    assert np.median(error) < 0.25
    assert np.percentile(error, 95) < 0.8
    assert (error > 3.0).mean() < 0.02


def test_whole_pixels_are_followed_exactly() -> None:
    image = texture()
    points = _corners(image)
    result = _tracker().track(image, np.roll(image, (4, 7), (0, 1)), points, None)
    error = np.linalg.norm(result.pixels - points - [7.0, 4.0], axis=1)[result.consistent]
    assert np.median(error) < 0.15


def test_the_search_ends_at_its_radius_around_the_guess() -> None:
    image = texture()
    flow = (-30.0, 3.0)
    moved, points = shifted(image, flow), _corners(image)

    def share_found(guess: FloatArray | None, search_px: float) -> float:
        result = _tracker(search_px).track(image, moved, points, guess)
        error = np.linalg.norm(result.pixels - points - flow, axis=1)
        return float((result.consistent & (error < 1.5)).mean())

    assert share_found(None, 20.0) == 0.0
    assert share_found(None, 40.0) > 0.9
    assert share_found(points + np.array([-25.0, 5.0]), 20.0) > 0.9


def test_of_two_points_that_want_the_same_corner_the_likelier_gets_it() -> None:
    image = texture()
    points = np.rint(_corners(image))
    both = np.concatenate([points, points + np.array([2.0, 0.0])])
    result = _tracker().track(image, image, both, None)
    right, beside = np.split(result.consistent, 2)
    assert right.mean() > 0.95
    assert np.split(result.found, 2)[1].mean() > 0.5
    assert beside.mean() < 0.5 * np.split(result.found, 2)[1].mean()


def test_the_hamming_limit_and_the_ratio_refuse() -> None:
    image = texture()
    noise = np.random.default_rng(1).normal(0.0, 25.0, image.shape)
    noisy = np.clip(image + noise, 0, 255).astype(np.uint8)
    points = _corners(image)
    found = [
        int(_tracker(max_hamming=bits, ratio=ratio).track(image, noisy, points, None).found.sum())
        for bits, ratio in ((80, 0.95), (4, 0.95), (80, 0.1))
    ]
    assert found[0] > 1.5 * found[1] > 0
    assert found[0] > 1.5 * found[2]
    strict = _tracker(max_hamming=40, ratio=0.7)
    assert strict.track(image, texture(9), points, None).consistent.mean() < 0.15


def test_points_at_the_very_edge_are_described_too() -> None:
    image = texture()
    edge = np.array([[0.0, 0.0], [WIDTH - 1.0, 0.0], [0.0, HEIGHT - 1.0], [3.0, 100.0]])
    points = np.concatenate([edge, _corners(image)])
    result = _tracker().track(image, image, points, None)
    assert len(result.pixels) == len(points)
    assert result.consistent[4:].mean() > 0.95


def test_no_texture_no_tracks_and_no_points() -> None:
    black = np.zeros((HEIGHT, WIDTH), np.uint8)
    points = _corners(texture())
    assert not _tracker().track(texture(), black, points, None).found.any()
    assert _tracker().track(texture(), texture(), np.zeros((0, 2)), None).pixels.shape == (0, 2)


def test_the_same_images_give_the_same_matches() -> None:
    image, moved = texture(), shifted(texture(), (3.3, 1.1))
    a, b = (_tracker().track(image, moved, _corners(image), None) for _ in range(2))
    np.testing.assert_array_equal(a.pixels, b.pixels)
    np.testing.assert_array_equal(a.consistent, b.consistent)


def test_the_configuration_chooses_it() -> None:
    from test_frontend import _drift, _frontend, _run

    assert settings().tracker == "klt"
    orb = _run(_frontend(tracker="orb"), _drift(8))
    klt = _run(_frontend(), _drift(8))
    assert orb[1].pixels.tobytes() != klt[1].pixels.tobytes()
    survivors = np.intersect1d(orb[0].ids, orb[7].ids)
    assert len(survivors) > 20
    first = orb[0].pixels[np.isin(orb[0].ids, survivors)]
    last = orb[7].pixels[np.isin(orb[7].ids, survivors)]
    assert np.median(np.linalg.norm(last - first - [10.5, -3.5], axis=1)) < 1.0
