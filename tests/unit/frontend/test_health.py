"""Blank, repeated and suddenly brighter images."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.frontend.health import ImageWatch
from p2gd_fgo.types import Image


def picture(seed: int = 0, gain: float = 1.0) -> Image:
    scene = np.random.default_rng(9).integers(20, 140, (12, 16)).repeat(20, 0).repeat(20, 1)
    noise = np.random.default_rng(seed).normal(0.0, 1.5, scene.shape)
    return np.clip(scene * gain + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_image_without_a_picture_is_blank(level: int) -> None:
    flat = np.full((240, 320), level, np.float64)
    noisy = flat + np.random.default_rng(1).normal(0.0, 2.0, flat.shape)
    watch = ImageWatch()
    assert watch.look(picture()).usable
    for image in (flat, noisy):
        found = watch.look(np.clip(image, 0, 255).astype(np.uint8))
        assert found.blank and not found.usable
    assert watch.look(picture(3)).usable


def test_the_same_scene_is_not_the_same_picture() -> None:
    watch = ImageWatch()
    assert not watch.look(picture(1)).repeated
    assert not watch.look(picture(2)).repeated
    found = watch.look(picture(2).copy())
    assert found.repeated and not found.usable
    assert not watch.look(picture(1)).repeated


def test_one_pixel_more_is_another_picture() -> None:
    watch = ImageWatch()
    image = picture()
    watch.look(image)
    other = image.copy()
    other[3, 5] += 1
    assert not watch.look(other).repeated


@pytest.mark.parametrize(
    ("gain", "jumped"), [(1.1, False), (0.85, False), (1.5, True), (0.6, True)]
)
def test_a_jump_of_the_brightness(gain: float, jumped: bool) -> None:
    watch = ImageWatch()
    assert not watch.look(picture(1)).jumped
    found = watch.look(picture(2, gain))
    assert found.jumped is jumped and found.usable
    assert found.brightness == pytest.approx(gain, rel=0.03)


def test_brightness_is_compared_across_blank_images() -> None:
    watch = ImageWatch()
    watch.look(picture(1))
    assert not watch.look(np.zeros((240, 320), np.uint8)).jumped
    assert not watch.look(picture(2)).jumped
