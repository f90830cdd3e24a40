from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.frontend.features import FeatureBuffer


def _buffer_after(steps: int, count: int = 12, history: int = 6) -> FeatureBuffer:
    """Features that move by (3, 4) px an image; normalised coordinates are a tenth of that."""
    buffer = FeatureBuffer(history)
    start = np.random.default_rng(1).uniform(0, 100, (count, 2))
    buffer.advance(0, buffer.pixels, buffer.normalized)
    buffer.add(start, start / 10)
    for k in range(1, steps + 1):
        moved = start[: len(buffer)] + k * np.array([3.0, 4.0])
        buffer.advance(100 * k, moved, moved / 10)
    return buffer


def test_history_holds_every_sighting_newest_last() -> None:
    buffer = _buffer_after(3)
    steps = np.diff(buffer.pixel_history[:, -4:], axis=1)
    np.testing.assert_allclose(steps, np.broadcast_to([3.0, 4.0], steps.shape), atol=1e-12)
    np.testing.assert_allclose(buffer.normalized_history[:, -4:] * 10, buffer.pixel_history[:, -4:])
    assert np.isnan(buffer.pixel_history[:, :-4]).all()
    assert buffer.lengths.tolist() == [4] * 12
    assert buffer.stamps_ns.tolist() == [-1, -1, 0, 100, 200, 300]
    np.testing.assert_array_equal(buffer.pixels, buffer.pixel_history[:, -1])


def test_keep_moves_all_arrays_together() -> None:
    buffer = _buffer_after(2)
    which = np.arange(12) % 3 == 0
    ids, pixels = buffer.ids[which], buffer.pixels[which]
    buffer.keep(which)
    np.testing.assert_array_equal(buffer.ids, ids)
    np.testing.assert_array_equal(buffer.pixels, pixels)
    assert len(buffer) == len(buffer.lengths) == len(buffer.normalized_history) == 4


def test_ids_are_never_reused() -> None:
    buffer = FeatureBuffer(4)
    seen: set[int] = set()
    for k in range(10):
        buffer.keep(np.zeros(len(buffer), np.bool_))
        buffer.advance(k, buffer.pixels, buffer.normalized)
        buffer.add(np.zeros((5, 2)), np.zeros((5, 2)))
        assert not seen & set(buffer.ids.tolist())
        seen |= set(buffer.ids.tolist())
    assert len(seen) == 50


def test_disparity_is_the_median_over_features_seen_in_both_images() -> None:
    buffer = _buffer_after(3)
    buffer.add(np.zeros((4, 2)), np.zeros((4, 2)))
    np.testing.assert_allclose(buffer.disparity_px(2), (10.0, 12))
    np.testing.assert_allclose(buffer.disparity_px(3), (15.0, 12))


@pytest.mark.parametrize("frames", [0, 4, 5, 6, 100])
def test_disparity_without_common_features(frames: int) -> None:
    value, count = _buffer_after(3).disparity_px(frames)
    assert np.isnan(value)
    assert count == 0


def test_a_renamed_track_starts_anew_but_its_corner_keeps_its_past() -> None:
    buffer = _buffer_after(3)
    which = np.arange(12) < 5
    old = buffer.ids.copy()
    buffer.rename(which)
    buffer.advance(400, buffer.pixels, buffer.normalized)
    assert not set(buffer.ids[which].tolist()) & set(old.tolist())
    np.testing.assert_array_equal(buffer.ids[~which], old[~which])
    assert buffer.lengths.tolist() == [1] * 5 + [5] * 7
    np.testing.assert_allclose(buffer.disparity_px(4), (15.0, 12))
