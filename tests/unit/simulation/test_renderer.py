"""Geometry of the renderer against the camera model, and its filtering against areas."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse, transform
from p2gd_fgo.simulation.raster import DISC, RECTANGLE, TRIANGLE, visibility
from p2gd_fgo.simulation.renderer import Renderer, SensorModel
from p2gd_fgo.simulation.textures import build_atlas
from p2gd_fgo.simulation.world import LightMaps, Look, Sky, Surfaces, World, concatenate, patches
from p2gd_fgo.types import FloatArray

CAMERA = RadTanCamera(240, 180, 158.0, 157.0, 121.0, 88.5, -0.28, 0.07, 2e-4, 2e-5)
LARGE = RadTanCamera(640, 480, 421.0, 420.0, 322.0, 238.0, -0.28, 0.07, 2e-4, 2e-5)
FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
BLACK, WHITE, CHECKER = 0, 1, 2


def world_of(*parts: Surfaces) -> World:
    flat = np.ones((4, 4), np.float32)
    checker = np.full((256, 256), 40.0, np.float32)
    checker[:128, :128] = checker[128:, 128:] = 200.0
    surfaces = concatenate(parts)
    atlas = build_atlas([0.0 * flat, 200.0 * flat, checker])
    return World(surfaces, LightMaps.uniform(len(surfaces)), atlas, Sky(100.0, 100.0))


def wall(distance: float, texture: int, *, shape: int = RECTANGLE, half: float = 20.0) -> Surfaces:
    """A square across the line of sight of a camera at the origin that looks along x."""
    look = Look(texture, shape=shape)
    return patches([distance, half, -half], [0.0, -2 * half, 0.0], [0.0, 0.0, 2 * half], look)


def look_along_x(turn: FloatArray | None = None, position: FloatArray | None = None) -> FloatArray:
    R = FORWARD if turn is None else so3.exp(turn) @ FORWARD
    return from_rotation_translation(R, np.zeros(3) if position is None else position)


@pytest.mark.parametrize("tilt", [0.0, 0.25, 0.5])
def test_texture_corners_land_where_the_camera_model_says(tilt: float) -> None:
    R = so3.exp(np.array([0.2, 0.0, tilt]))
    corner, u, v = np.array([3.0, 4.0, -4.0]), R @ [0.0, -8.0, 0.0], R @ [0.0, 0.0, 8.0]
    world = world_of(patches(corner, u, v, Look(CHECKER, (1.6, 1.6))))
    T_world_cam = look_along_x(np.array([0.03, -0.05, 0.1 + tilt / 3]), np.array([0.2, 0.1, 0.3]))
    # A lens' blur: edges as sharp as a pixel would bias the corner finder itself by 0.1 px.
    image = cv2.GaussianBlur(Renderer(LARGE, world).render(T_world_cam).brightness, (0, 0), 1.2)
    a, b = (g.ravel() / 10.0 for g in np.meshgrid(np.arange(1.0, 10.0), np.arange(1.0, 10.0)))
    points = transform(inverse(T_world_cam), corner + a[:, None] * u + b[:, None] * v)
    points = points[points[:, 2] > 0.5]
    expected = LARGE.project(points)
    keep = LARGE.visible(points, expected) & LARGE.inside(expected, 12.0) & (points[:, 2] < 4.5)
    expected = expected[keep]
    assert len(expected) >= 10
    found = expected.astype(np.float32).reshape(-1, 1, 2).copy()
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    cv2.cornerSubPix(np.rint(image).astype(np.uint8), found, (5, 5), (-1, -1), stop)
    error = found[:, 0] - expected
    assert np.abs(error.mean(0)).max() < 0.01
    assert np.linalg.norm(error, axis=1).max() < 0.1


def test_depth_of_a_slanted_plane() -> None:
    normal = so3.exp(np.array([0.0, 0.3, 0.5])) @ [1.0, 0.0, 0.0]
    u = np.cross([0.0, 0.0, 1.0], normal) * 3000.0
    v = np.cross(normal, u)
    plane = patches(5.0 * normal - 0.5 * (u + v), u, v, Look(WHITE))
    rendering = Renderer(CAMERA, world_of(plane)).render(look_along_x())
    rows, columns = np.indices((180, 240))
    rays = CAMERA.undistort(np.stack([columns.ravel(), rows.ravel()], -1).astype(float))
    directions = np.column_stack([rays, np.ones(len(rays))]) @ FORWARD.T
    expected = (directions @ normal).reshape(180, 240) / 5.0
    np.testing.assert_allclose(rendering.inverse_depth, expected, atol=1e-9)


def test_the_nearest_surface_wins_in_any_order() -> None:
    near, far = wall(2.0, BLACK, half=0.4), wall(6.0, WHITE)
    for parts in ((near, far), (far, near)):
        rendering = Renderer(CAMERA, world_of(*parts)).render(look_along_x())
        assert rendering.inverse_depth[88, 121] == pytest.approx(1 / 2.0)
        assert rendering.inverse_depth[20, 20] == pytest.approx(1 / 6.0)
        assert rendering.brightness[88, 121] == 0.0
        assert rendering.brightness[20, 20] == pytest.approx(200.0)


def test_nothing_behind_the_camera_is_seen_and_ground_passes_under_it() -> None:
    behind = wall(-2.0, WHITE)
    ground = patches([-50.0, -50.0, -1.0], [100.0, 0, 0], [0, 100.0, 0], Look(WHITE))
    rendering = Renderer(CAMERA, world_of(behind, ground)).render(look_along_x())
    assert np.all(rendering.inverse_depth[:80] == 0.0)
    np.testing.assert_allclose(rendering.brightness[:80], 100.0, rtol=1e-6)
    assert np.all(rendering.inverse_depth[100:] > 0.0)


@pytest.mark.parametrize(("shape", "area"), [(RECTANGLE, 4.0), (DISC, np.pi), (TRIANGLE, 2.0)])
def test_shapes_cover_their_area_with_soft_edges(shape: int, area: float) -> None:
    pinhole = RadTanCamera(200, 200, 200.0, 200.0, 99.5, 99.5, 0.0, 0.0, 0.0, 0.0)
    world = world_of(wall(10.0, BLACK), wall(4.013, WHITE, shape=shape, half=1.0))
    image = Renderer(pinhole, world).render(look_along_x()).brightness
    seen = image.sum() / 200.0 * (4.013 / 200.0) ** 2
    assert seen == pytest.approx(area, rel=0.004)


def test_a_far_checker_fades_to_its_mean_instead_of_shimmering() -> None:
    look = Look(CHECKER, (0.02, 0.02))
    ground = patches([0.0, -40.0, -1.0], [400.0, 0.0, 0.0], [0.0, 80.0, 0.0], look)
    image = Renderer(CAMERA, world_of(ground)).render(look_along_x()).brightness
    far = image[95:110, 100:140]
    assert far.std() < 3.0
    assert far.mean() == pytest.approx(120.0, abs=3.0)


def test_scan_boxes_lose_no_pixel() -> None:
    rng = np.random.default_rng(5)
    corner, u, v = rng.standard_normal((3, 300, 3))
    world = world_of(patches(3.0 * corner, u, v, Look(WHITE)))
    renderer = Renderer(CAMERA, world)
    forms, boxes = renderer._project(world.surfaces, inverse(look_along_x()))
    whole = np.tile([0, 180, 0, 240], (300, 1))
    rays = renderer._ray_x, renderer._ray_y
    owner, depth = visibility(*rays, forms, world.surfaces.shape, boxes)
    owner_whole, depth_whole = visibility(*rays, forms, world.surfaces.shape, whole)
    np.testing.assert_array_equal(owner, owner_whole)
    np.testing.assert_array_equal(depth, depth_whole)
    assert len(np.unique(owner)) > 10


def test_equal_bytes_for_equal_input() -> None:
    world = world_of(wall(3.0, CHECKER, half=2.0), wall(8.0, WHITE))
    views = [Renderer(CAMERA, world).render(look_along_x()).brightness for _ in range(2)]
    frames = [SensorModel().expose(view, np.random.default_rng(3)) for view in views]
    assert views[0].tobytes() == views[1].tobytes()
    assert frames[0].tobytes() == frames[1].tobytes()


def test_sensor_noise_and_vignetting() -> None:
    sensor = SensorModel(noise_sigma=2.0, vignetting=0.2)
    image = sensor.expose(np.full((200, 300), 100.0, np.float32), np.random.default_rng(0))
    assert image.dtype == np.uint8
    middle = image[80:120, 120:180].astype(float)
    assert middle.std() == pytest.approx(2.0, abs=0.15)
    assert middle.mean() - image[:8, :8].mean() == pytest.approx(20.0, abs=2.0)
