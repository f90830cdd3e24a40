"""Bodies that move: where they are, their mask, their shadow, and the blur of motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.simulation.movers import Mover
from p2gd_fgo.simulation.renderer import Exposure, Renderer, Rendering
from p2gd_fgo.simulation.textures import build_atlas
from p2gd_fgo.simulation.world import LightMaps, Look, Sky, World, box, concatenate, patches
from p2gd_fgo.types import FloatArray

PINHOLE = RadTanCamera(240, 160, 200.0, 200.0, 119.5, 79.5, 0.0, 0.0, 0.0, 0.0)
FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
EYE = from_rotation_translation(FORWARD, np.zeros(3))
WALL_M = 12.0


def world() -> World:
    flat = np.ones((4, 4), np.float32)
    stripes = np.full((64, 64), 60.0, np.float32)
    stripes[:, :32] = 180.0
    wall = patches([WALL_M, 20.0, -1.0], [0.0, -40.0, 0.0], [0.0, 0.0, 30.0], Look(2, (0.5, 0.5)))
    ground = patches([-5.0, -30.0, -1.0], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0], Look(1))
    surfaces = concatenate([wall, ground])
    atlas = build_atlas([20.0 * flat, 150.0 * flat, stripes])
    light = LightMaps.uniform(len(surfaces))
    return World(surfaces, light, atlas, Sky(), sun=(0.0, 0.0, 0.5), ground_z=-1.0)


def crate(left: float = 2.0, right: float = -2.0) -> Mover:
    """A black crate of 1 m that crosses 6 m ahead in 4 s, from left to right."""
    places = np.array([[6.0, left, 0.0], [6.0, right, 0.0]])
    body = box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], 0.0, Look(0))
    return Mover(body, (1.0, 1.0, 1.0), np.array([0.0, 4.0]), places, -1.0)


def center_px(rendering: Rendering) -> FloatArray:
    rows, columns = np.nonzero(rendering.mover == 0)
    return np.array([columns.mean(), rows.mean()])


def test_a_body_is_where_its_path_says_and_the_mask_covers_it() -> None:
    renderer = Renderer(PINHOLE, world(), [crate()])
    for time_s, y in ((0.5, 1.5), (2.0, 0.0), (3.5, -1.5)):
        view = renderer.render(EYE, time_s)
        near = 5.5  # the face that looks at the camera
        expected = 119.5 - 200.0 * np.array([y + 0.5, y - 0.5]) / near
        face = np.isclose(view.inverse_depth, 1.0 / near)
        columns = np.nonzero(face.any(0))[0]
        np.testing.assert_allclose([columns.min(), columns.max()], expected, atol=1.0)
        mask = view.mask()
        assert set(np.unique(mask)) == {0, 255}
        assert np.all(mask[view.mover == 0] == 0)
        # A pixel of margin, and no more: the anti-aliased rim belongs to the body.
        grown = np.zeros_like(face)
        rows, columns = np.nonzero(view.mover == 0)
        grown[rows.min() - 1 : rows.max() + 2, columns.min() - 1 : columns.max() + 2] = True
        assert np.all(grown[mask == 0])


def test_outside_its_time_a_body_is_absent() -> None:
    renderer = Renderer(PINHOLE, world(), [crate()])
    empty = Renderer(PINHOLE, world()).render(EYE)
    for time_s in (-0.1, 4.1):
        view = renderer.render(EYE, time_s)
        assert np.all(view.mover == -1) and np.all(view.mask() == 255)
        np.testing.assert_array_equal(view.brightness, empty.brightness)


def test_the_ground_is_dark_around_a_foot_and_nowhere_else() -> None:
    before = Renderer(PINHOLE, world()).render(EYE).brightness
    view = Renderer(PINHOLE, world(), [crate()]).render(EYE, 2.0)
    darker = (view.brightness < 0.9 * before) & (view.mask() == 255)
    rows, columns = np.nonzero(darker)
    assert len(rows) > 30
    assert np.abs(columns - 119.5).max() < 200.0 * 1.3 / 5.0
    assert rows.min() > 79.5 + 200.0 / 7.3  # not on the wall
    far = np.ones_like(darker)
    far[:, 60:180] = False
    np.testing.assert_array_equal(view.brightness[far], before[far])


def test_the_sun_shines_on_what_moves() -> None:
    lit = Renderer(PINHOLE, world(), [crate()])
    dark = Renderer(PINHOLE, replace(world(), sun=(0.0, 0.0, 0.0)), [crate()])
    high = from_rotation_translation(FORWARD, np.array([0.0, 0.0, 2.0]))
    bright, dim = lit.render(high, 2.0), dark.render(high, 2.0)
    crate_px = bright.mask() == 0
    inside = crate_px & (bright.mover == 0) & (bright.brightness < 30.0)
    assert bright.brightness[inside].max() > 1.5 * dim.brightness[inside].max()


@pytest.mark.parametrize("exposure_s", [0.02, 0.1])
def test_blur_has_the_length_of_the_motion_and_shifts_nothing(exposure_s: float) -> None:
    velocity = np.array([0.0, -3.0, 0.0])  # to the right: the wall moves left
    renderer = Renderer(PINHOLE, world())
    sharp = renderer.render(EYE)
    blurred = renderer.render(EYE, 0.0, Exposure(exposure_s, velocity, np.zeros(3)))
    length_px = 200.0 * 3.0 * exposure_s / WALL_M
    row = slice(40, 60)
    a, b = sharp.brightness[row].mean(0), blurred.brightness[row].mean(0)
    taps = max(round(length_px), 1)
    expected = np.convolve(a, np.ones(taps) / taps, mode="same")
    inner = slice(20, 220)
    assert np.abs(b[inner] - expected[inner]).max() < 14.0
    shifts = np.arange(-3, 4)
    fit = [np.dot(np.roll(a, s)[inner] - a.mean(), b[inner] - b.mean()) for s in shifts]
    assert shifts[int(np.argmax(fit))] == 0
    assert b[inner].std() < a[inner].std()


def test_rotation_blurs_the_far_as_the_near_and_along_the_turn_only() -> None:
    renderer = Renderer(PINHOLE, world())
    sharp = renderer.render(EYE)
    roll = renderer.render(EYE, 0.0, Exposure(0.05, np.zeros(3), np.array([0.0, 0.0, 2.0])))
    middle = (slice(76, 84), slice(116, 124))
    change = np.abs(roll.brightness - sharp.brightness)
    assert change[middle].mean() < 0.3 * change[10:30, 10:60].mean()


def test_a_body_that_moves_along_stays_sharp() -> None:
    velocity = np.array([0.0, -1.0, 0.0])  # the crate's own
    renderer = Renderer(PINHOLE, world(), [crate()])
    view = renderer.render(EYE, 2.0, Exposure(0.1, velocity, np.zeros(3)))
    still = renderer.render(EYE, 2.0)
    inside = view.mover == 0
    np.testing.assert_allclose(view.brightness[inside], still.brightness[inside], atol=1e-3)
    assert np.abs(view.brightness - still.brightness)[40:60, 20:80].max() > 3.0
