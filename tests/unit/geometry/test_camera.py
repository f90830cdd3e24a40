"""Cameras against OpenCV, against themselves, and at their limits."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray

EUROC = RadTanCamera(
    752, 480, 458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187e-05
)
KITTI = RadTanCamera(
    *(1392, 512, 984.2439, 980.8141, 690.0, 233.1966),
    *(-0.3728755, 0.2037299, 0.002219027, 0.001383707, -0.07233722),
)
KAIST = RadTanCamera(
    *(1280, 560, 816.90379, 811.56804, 608.50726, 263.476),
    *(-0.056143028, 0.13952563, -0.0012155907, -0.00097281390),
)
TUM_VI = EquidistantCamera(
    *(512, 512, 190.97847715128717, 190.9733070521226, 254.93170605935475, 256.8974428996504),
    *(0.0034823894, 0.0007150348, -0.0020532361, 0.00020293673),
)
PINHOLE = RadTanCamera(640, 480, 400.0, 410.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0)
CAMERAS = {
    "euroc": EUROC,
    "kitti": KITTI,
    "kaist": KAIST,
    "tum_vi": TUM_VI,
    "pinhole": PINHOLE,
}
each_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def all_pixels(camera: Camera) -> FloatArray:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    return np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)


def some_points(camera: Camera, n: int = 500) -> FloatArray:
    """Points in front of the camera, spread over its image."""
    rng = np.random.default_rng(3)
    pixels = rng.uniform(0, [camera.width - 1, camera.height - 1], (n, 2))
    rays = camera.undistort(pixels[camera.invertible(pixels)])
    depth = rng.uniform(0.3, 40.0, (len(rays), 1))
    return np.hstack([rays, np.ones((len(rays), 1))]) * depth


def opencv_pixels(camera: Camera, points: FloatArray) -> FloatArray:
    zero = np.zeros(3)
    if isinstance(camera, RadTanCamera):
        coefficients = np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])
        pixels, _ = cv2.projectPoints(points, zero, zero, camera.K, coefficients)
    else:
        assert isinstance(camera, EquidistantCamera)
        coefficients = np.array([camera.k1, camera.k2, camera.k3, camera.k4])
        pixels, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, camera.K, coefficients)
    return np.asarray(pixels.reshape(-1, 2), dtype=np.float64)


@each_camera
def test_projection_is_opencvs(camera: Camera) -> None:
    points = some_points(camera)
    np.testing.assert_allclose(camera.project(points), opencv_pixels(camera, points), atol=1e-9)


def test_undistortion_is_opencvs_radtan() -> None:
    # OpenCV's fixed-point iteration stops after 5 steps, so only the middle is comparable.
    for camera in (EUROC, KAIST):
        pixels = all_pixels(camera)[::97]
        pixels = pixels[np.hypot(*(pixels - [camera.cx, camera.cy]).T) < 0.25 * camera.fx]
        assert isinstance(camera, RadTanCamera)
        k = np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])
        expected = cv2.undistortPoints(pixels[:, None], camera.K, k)[:, 0]
        np.testing.assert_allclose(camera.undistort(pixels), expected, atol=1e-7)


def test_undistortion_is_opencvs_fisheye() -> None:
    pixels = all_pixels(TUM_VI)[::97]
    pixels = pixels[np.hypot(*(pixels - [TUM_VI.cx, TUM_VI.cy]).T) < 250.0]
    k = np.array([TUM_VI.k1, TUM_VI.k2, TUM_VI.k3, TUM_VI.k4])
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-14)
    expected = cv2.fisheye.undistortPoints(pixels[:, None], TUM_VI.K, k, criteria=criteria)[:, 0]
    np.testing.assert_allclose(TUM_VI.undistort(pixels), expected, atol=1e-9)


@each_camera
def test_round_trip_over_the_whole_image(camera: Camera) -> None:
    pixels = all_pixels(camera)
    rays = camera.undistort(pixels)
    assert np.isfinite(rays).all()
    invertible = camera.invertible(pixels)
    if camera is TUM_VI:  # corners of this fisheye look more than 90° sideways
        distance = np.hypot(*(pixels - [camera.cx, camera.cy]).T)
        assert invertible[distance < 280.0].all()
        assert not invertible[distance > 300.0].any()
    else:
        assert invertible.all()
    back = camera.distort(rays[invertible])
    np.testing.assert_allclose(back, pixels[invertible], atol=1e-9, rtol=0)
    again = camera.undistort(back)
    np.testing.assert_allclose(again, rays[invertible], atol=1e-9, rtol=1e-9)


@each_camera
def test_jacobians_are_the_derivatives(camera: Camera) -> None:
    points = some_points(camera, 60)
    points = points[np.hypot(points[:, 0], points[:, 1]) < 5.0 * points[:, 2]]
    h = 1e-6
    numeric = np.stack(
        [
            (camera.project(points + d) - camera.project(points - d)) / (2 * h)
            for d in h * np.eye(3)
        ],
        axis=2,
    )
    np.testing.assert_allclose(camera.project_jacobian(points), numeric, rtol=1e-6, atol=1e-4)
    rays = points[:, :2] / points[:, 2:]
    numeric = np.stack(
        [(camera.distort(rays + d) - camera.distort(rays - d)) / (2 * h) for d in h * np.eye(2)],
        axis=2,
    )
    np.testing.assert_allclose(camera.distort_jacobian(rays), numeric, rtol=1e-6, atol=1e-5)


@each_camera
def test_the_axis_lands_on_the_principal_point(camera: Camera) -> None:
    axis = np.zeros((1, 2))
    np.testing.assert_allclose(camera.distort(axis), [[camera.cx, camera.cy]])
    np.testing.assert_allclose(camera.undistort(np.array([[camera.cx, camera.cy]])), axis)
    J = camera.distort_jacobian(axis)[0]
    np.testing.assert_allclose(J, np.diag([camera.fx, camera.fy]), atol=1e-9)


@each_camera
def test_no_points(camera: Camera) -> None:
    none = np.zeros((0, 2))
    assert camera.distort(none).shape == camera.undistort(none).shape == (0, 2)
    assert camera.distort_jacobian(none).shape == (0, 2, 2)
    assert camera.project_jacobian(np.zeros((0, 3))).shape == (0, 2, 3)
    assert camera.visible(np.zeros((0, 3))).shape == camera.invertible(none).shape == (0,)


@each_camera
def test_pixels_far_outside_the_image_stay_finite(camera: Camera) -> None:
    pixels = np.random.default_rng(0).uniform(-1e5, 1e5, (2000, 2))
    rays = camera.undistort(pixels)
    assert np.isfinite(rays).all()
    assert (np.hypot(*rays.T) <= camera.max_radius * (1 + 1e-9)).all()
    invertible = camera.invertible(pixels)
    np.testing.assert_allclose(
        camera.distort(rays[invertible]), pixels[invertible], atol=1e-6, rtol=0
    )


def test_one_hopeless_pixel_leaves_the_others_exact() -> None:
    pixels = all_pixels(KITTI)[::5000]
    alone = KITTI.undistort(pixels)
    mixed = KITTI.undistort(np.vstack([pixels, [[9000.0, -4000.0]]]))
    np.testing.assert_allclose(mixed[:-1], alone, atol=1e-13)
    assert not KITTI.invertible(np.array([[9000.0, -4000.0]]))[0]


def test_a_folded_back_point_is_not_visible() -> None:
    folded = np.array([[1.6, 0.0, 1.0]])
    pixels = KITTI.project(folded)
    assert KITTI.inside(pixels)[0]  # 58° off the axis and yet "inside"
    assert not KITTI.visible(folded)[0]
    assert not KITTI.visible(folded, pixels)[0]
    r, h = KITTI.max_radius, 1e-4
    a, b, c = KITTI.distort(np.array([[r - h, 0.0], [r, 0.0], [r + h, 0.0]]))[:, 0]
    assert a == pytest.approx(b, abs=1.0)
    assert c == pytest.approx(b, abs=1.0)


def test_the_radius_grows_up_to_the_limit_and_not_beyond() -> None:
    camera = RadTanCamera(640, 480, 300.0, 300.0, 320.0, 240.0, -0.2, 0.0, 0.0, 0.0)
    assert camera.max_radius == pytest.approx(math.sqrt(1.0 / 0.6))
    r = np.linspace(0.0, 2.0, 2001)
    u = camera.distort(np.stack([r, np.zeros_like(r)], axis=1))[:, 0]
    np.testing.assert_array_equal(np.diff(u) > 0.0, (r[1:] + r[:-1]) / 2 < camera.max_radius)


def test_the_usable_angle_ends_at_89_degrees_without_a_fold() -> None:
    assert math.degrees(EUROC.max_angle) == pytest.approx(89.0)
    assert math.degrees(PINHOLE.max_angle) == pytest.approx(89.0)
    assert math.degrees(KITTI.max_angle) == pytest.approx(50.116, abs=1e-3)


def test_an_equidistant_fold_is_found() -> None:
    camera = EquidistantCamera(640, 480, 200.0, 200.0, 320.0, 240.0, -0.3, 0.0, 0.0, 0.0)
    assert camera.max_angle == pytest.approx(math.sqrt(1.0 / 0.9))


@each_camera
def test_visible_needs_depth_and_the_image(camera: Camera) -> None:
    points = np.array(
        [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, 0.06],
            [0.0, 0.0, 0.05],
            [0.0, 0.0, -1.0],
            [0.0, 0.0, 0.0],
            [1e6, 0.0, 1.0],
        ]
    )
    expected = [True, True, False, False, False, False]
    assert camera.visible(points).tolist() == expected
    pixels = np.full((len(points), 2), np.nan)
    pixels[:3] = camera.project(points[:3])
    assert camera.visible(points, pixels).tolist() == expected


def test_inside_counts_pixel_centres() -> None:
    pixels = np.array([[0.0, 0.0], [751.0, 479.0], [751.01, 0.0], [-0.01, 5.0], [4.9, 240.0]])
    assert EUROC.inside(pixels).tolist() == [True, True, False, False, True]
    assert EUROC.inside(pixels, border=4.95).tolist() == [False] * 5


def test_intrinsics_are_checked() -> None:
    with pytest.raises(DataError, match=r"fx is 0\.0.*positive"):
        RadTanCamera(640, 480, 0.0, 300.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(DataError, match="k2 is nan"):
        RadTanCamera(640, 480, 300.0, 300.0, 320.0, 240.0, 0.0, math.nan, 0.0, 0.0)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    k=st.tuples(st.floats(-0.4, 0.3), st.floats(-0.2, 0.3), st.floats(-0.2, 0.2)),
    p=st.tuples(st.floats(-3e-3, 3e-3), st.floats(-3e-3, 3e-3)),
    direction=st.floats(0.0, 2 * math.pi),
    share=st.floats(0.0, 0.9),
)
def test_any_radtan_lens_inverts_within_its_limit(
    k: tuple[float, float, float], p: tuple[float, float], direction: float, share: float
) -> None:
    camera = RadTanCamera(640, 480, 300.0, 300.0, 320.0, 240.0, k[0], k[1], *p, k[2])
    r = share * min(camera.max_radius, 2.0)
    ray = r * np.array([[math.cos(direction), math.sin(direction)]])
    np.testing.assert_allclose(camera.undistort(camera.distort(ray)), ray, atol=1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    k=st.tuples(*[st.floats(-0.05, 0.05)] * 4),
    direction=st.floats(0.0, 2 * math.pi),
    share=st.floats(0.0, 0.95),
)
def test_any_equidistant_lens_inverts_within_its_limit(
    k: tuple[float, float, float, float], direction: float, share: float
) -> None:
    camera = EquidistantCamera(640, 480, 300.0, 300.0, 320.0, 240.0, *k)
    r = math.tan(share * camera.max_angle)
    ray = r * np.array([[math.cos(direction), math.sin(direction)]])
    np.testing.assert_allclose(camera.undistort(camera.distort(ray)), ray, rtol=1e-9, atol=1e-9)
