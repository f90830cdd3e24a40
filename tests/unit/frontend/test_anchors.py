"""Tracks that are held to their first patches: exact under affine maps, honest where they end."""

from __future__ import annotations

import numpy as np
import pytest
from frontend_scenes import CAMERA, HEIGHT, WIDTH, settings, texture
from scipy import ndimage

from p2gd_fgo.frontend import CellQuotas, Frontend
from p2gd_fgo.frontend.anchors import AnchorPatches
from p2gd_fgo.frontend.tracker import KltTracker
from p2gd_fgo.types import FloatArray, Image

CENTRE = np.array([WIDTH / 2, HEIGHT / 2])
QUOTAS = CellQuotas(np.full((3, 4), 5, np.int64))


def mapped(image: Image, A: FloatArray, gain: float = 1.0, level: float = 0.0) -> Image:
    """The image under x -> CENTRE + A (x - CENTRE), with another contrast and brightness."""
    inverse = np.linalg.inv(A)[::-1, ::-1]  # of (row, column)
    offset = CENTRE[::-1] - inverse @ CENTRE[::-1]
    moved = ndimage.affine_transform(
        image.astype(np.float64), inverse, offset, order=3, mode="mirror"
    )
    return np.asarray(np.clip(np.rint(gain * moved + level), 0, 255), dtype=np.uint8)


def zoom(factor: float, degrees: float = 0.0) -> FloatArray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return factor * np.array([[c, -s], [s, c]])


def points(count: int = 60) -> FloatArray:
    return np.random.default_rng(3).uniform([60, 60], [WIDTH - 60, HEIGHT - 60], (count, 2))


@pytest.mark.parametrize(
    ("A", "gain", "level"),
    [
        (np.eye(2), 1.0, 0.0),
        (zoom(1.12, 6.0), 1.0, 0.0),
        (zoom(0.9), 0.7, 30.0),
        (np.array([[1.0, 0.15], [0.0, 0.95]]), 1.0, 0.0),
    ],
    ids=["nothing", "zoom and turn", "away and darker", "shear"],
)
def test_an_affine_map_and_another_exposure_are_seen_through(
    A: FloatArray, gain: float, level: float
) -> None:
    image, start = texture(), points()
    ids = np.arange(len(start))
    truth = CENTRE + (start - CENTRE) @ A.T
    guess = truth + np.random.default_rng(0).normal(0.0, 0.3, truth.shape)
    anchors = AnchorPatches(15)
    anchors.begin(image, ids, start)
    found, moved = anchors.align(mapped(image, A, gain, level), ids, guess)
    error = np.linalg.norm(found - truth, axis=1)
    assert moved.mean() > 0.8
    assert np.median(error[moved]) < 0.03
    assert np.percentile(error[moved], 90) < 0.2
    np.testing.assert_array_equal(found[~moved], guess[~moved])


def blobs() -> tuple[Image, FloatArray]:
    """Dark blobs on a bright wall, and a point (N, 2) beside each, still in its patch."""
    u, v = np.meshgrid(np.arange(80, WIDTH - 79, 32.0), np.arange(60, HEIGHT - 59, 32.0))
    image = np.full((HEIGHT, WIDTH), 200.0)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    for x, y in zip(u.ravel(), v.ravel(), strict=True):
        image -= 150.0 * np.exp(-((columns - x) ** 2 + 2.0 * (rows - y) ** 2) / 18.0)
    return image.astype(np.uint8), np.column_stack([u.ravel() + 2.5, v.ravel() + 1.5])


@pytest.mark.parametrize("anchor", [False, True])
def test_what_grows_keeps_its_points(anchor: bool) -> None:
    """Over 15 images that grow by 2 % each, the tracker keeps the blob's distance in pixels."""
    image, start = blobs()
    tracker, anchors = KltTracker(15, 3, 1.0), AnchorPatches(15)
    ids, pixels, previous = np.arange(len(start)), start, image
    for k in range(1, 16):
        current = mapped(image, zoom(1.02**k))
        if anchor:
            anchors.begin(previous, ids, pixels)
        flow = tracker.track(previous, current, pixels, None)
        assert flow.consistent.all()
        pixels, previous = flow.pixels, current
        if anchor:
            pixels, _ = anchors.align(current, ids, pixels)
    error = np.linalg.norm(pixels - CENTRE - (start - CENTRE) * 1.02**15, axis=1)
    assert np.median(error) < 0.05 if anchor else np.median(error) > 0.5


def test_the_front_end_holds_its_tracks_if_told_to() -> None:
    """A zoom over 12 images; tracks are renamed, lost and found on the way."""
    ends = []
    for anchor in (False, True, True):
        changes = {"anchor": anchor, "max_track_length": 8, "continue_consumed": True}
        frontend = Frontend(CAMERA, settings(**changes), 0)
        image = texture(4)
        for k in range(12):
            frontend.track(k, mapped(image, zoom(1.02**k)), np.eye(3))
            frontend.extract(QUOTAS)
        buffer = frontend.buffer
        lived = buffer.lengths >= 4
        assert lived.sum() > 20
        moved = buffer.pixel_history[lived, -4] - CENTRE
        error = np.linalg.norm(buffer.pixels[lived] - CENTRE - moved * 1.02**3, axis=1)
        assert np.median(error) < 0.1
        ends.append(buffer.pixels.tobytes())
    assert ends[0] != ends[1] == ends[2]


def test_what_is_covered_stays_with_the_tracker_and_begins_anew() -> None:
    image, start = texture(), points(20)
    ids = np.arange(5, 25)
    covered = mapped(texture(7), np.eye(2))
    anchors = AnchorPatches(15)
    anchors.begin(image, ids, start)
    found, moved = anchors.align(covered, ids, start + 0.2)
    assert moved.mean() < 0.2
    np.testing.assert_array_equal(found[~moved], start[~moved] + 0.2)
    anchors.begin(covered, ids, found)  # what was given up begins where it is
    again, held = anchors.align(covered, ids, found + 0.4)
    assert held[~moved].all()
    np.testing.assert_allclose(again[~moved], found[~moved], atol=0.02)


def test_tracks_come_and_go_in_any_order() -> None:
    image, start = texture(), points(6)
    anchors = AnchorPatches(15)
    anchors.begin(image, np.array([4, 9]), start[:2])
    anchors.begin(image, np.array([9, 2, 7, 4]), np.vstack([start[5], start[2:4], start[5]]))
    anchors.keep(np.array([2, 4, 9]))
    ids, where = np.array([9, 2, 4]), start[[1, 2, 0]]
    found, moved = anchors.align(image, ids, where + np.array([0.3, -0.2]))
    assert moved.all()  # a patch is that of its first image, whatever is handed in later
    np.testing.assert_allclose(found, where, atol=0.02)


def test_nothing_to_see_moves_nothing() -> None:
    flat = np.full((HEIGHT, WIDTH), 90, np.uint8)
    start = np.vstack([points(4), [[1.0, 2.0], [WIDTH - 1.0, HEIGHT - 1.0]]])
    ids = np.arange(len(start))
    for first, second in ((flat, flat), (flat, texture()), (texture(), flat)):
        anchors = AnchorPatches(15)
        anchors.begin(first, ids, start)
        found, moved = anchors.align(second, ids, start)
        assert not moved.any()
        np.testing.assert_array_equal(found, start)
    none = np.zeros(0, np.int64)
    anchors = AnchorPatches(15)
    anchors.begin(flat, none, np.zeros((0, 2)))
    found, moved = anchors.align(flat, none, np.zeros((0, 2)))
    assert found.shape == (0, 2) and moved.shape == (0,)
