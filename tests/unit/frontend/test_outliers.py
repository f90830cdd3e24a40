from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.frontend.outliers import motion_inliers
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import EquidistantCamera, RadTanCamera
from p2gd_fgo.types import BoolArray, FloatArray

FOCAL = 450.0
CAMERA = RadTanCamera(752, 480, FOCAL, FOCAL, 376.0, 240.0, 0.0, 0.0, 0.0, 0.0)
FISHEYE = EquidistantCamera(512, 512, 191.0, 191.0, 255.0, 257.0, 3.5e-3, 7e-4, -2e-3, 2e-4)
TURN = np.asarray(so3.exp(np.array([0.02, -0.05, 0.03])))


def _two_views(
    t: tuple[float, float, float],
    R: FloatArray = TURN,
    count: int = 150,
    noise_px: float = 0.2,
    depth: tuple[float, float] = (2.0, 15.0),
) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(5)
    previous = rng.uniform([-0.7, -0.5], [0.7, 0.5], (count, 2))
    points = np.column_stack([previous, np.ones(count)]) * rng.uniform(*depth, (count, 1))
    moved = points @ R.T + np.array(t)
    current = moved[:, :2] / moved[:, 2:]
    return previous, current + rng.normal(0.0, noise_px / FOCAL, current.shape)


def _judge(
    previous: FloatArray, current: FloatArray, R: FloatArray | None, seed: int = 0
) -> BoolArray:
    return motion_inliers(previous, current, R, CAMERA, 2.0, np.random.default_rng(seed))


MOTIONS = [(0.3, 0.0, 0.02), (0.0, 0.1, -0.6), (-0.2, 0.1, 0.4)]


@pytest.mark.parametrize("t", MOTIONS)
@pytest.mark.parametrize("known_rotation", [True, False])
def test_planted_outliers_go_and_the_others_stay(
    t: tuple[float, float, float], known_rotation: bool
) -> None:
    previous, current = _two_views(t)
    rng = np.random.default_rng(7)
    bad = rng.permutation(150) < 45
    angle = rng.uniform(0, 2 * np.pi, 150)
    step = np.column_stack([np.cos(angle), np.sin(angle)]) * 40 / FOCAL
    current = current + np.where(bad[:, None], step, 0.0)
    good = _judge(previous, current, TURN if known_rotation else None)
    assert good[~bad].mean() > (0.99 if known_rotation else 0.9)
    assert good[bad].mean() < 0.2  # some of them happen to lie along their epipolar line


def test_a_point_that_moves_the_wrong_way_along_its_line_goes() -> None:
    previous, current = _two_views((0.4, 0.0, 0.0), R=np.eye(3))
    current[:5] = previous[:5] - (current[:5] - previous[:5])
    good = _judge(previous, current, np.eye(3))
    assert not good[:5].any()
    assert good[5:].all()


@pytest.mark.parametrize("R", [np.eye(3), TURN])
def test_without_translation_all_stay(R: FloatArray) -> None:
    previous, current = _two_views((0.0, 0.0, 0.0), R=R, noise_px=0.3)
    assert _judge(previous, current, R).all()


def test_standing_still_without_a_rotation_all_stay() -> None:
    previous, current = _two_views((0.0, 0.0, 0.0), R=np.eye(3), noise_px=0.3)
    assert _judge(previous, current, None).all()


def test_standing_still_a_single_mover_goes() -> None:
    previous, current = _two_views((0.0, 0.0, 0.0), R=np.eye(3))
    current[17] += 20 / FOCAL
    good = _judge(previous, current, np.eye(3))
    assert good.sum() == 149
    assert not good[17]


def test_a_wrong_rotation_does_not_take_the_features_with_it() -> None:
    previous, current = _two_views((0.3, 0.1, 0.1), depth=(1.0, 6.0))
    wrong = np.asarray(so3.exp(np.array([0.15, 0.1, -0.2])) @ TURN)
    assert _judge(previous, current, wrong).mean() > 0.8


def test_few_points_are_not_judged() -> None:
    previous, current = _two_views((0.3, 0.0, 0.0), count=7)
    current[0] += 1.0
    assert _judge(previous, current, TURN).all()
    assert len(_judge(previous[:0], current[:0], None)) == 0


def test_the_answer_does_not_depend_on_the_order_of_the_points() -> None:
    previous, current = _two_views((0.3, 0.1, 0.0))
    current[::10] += 30 / FOCAL
    reverse = slice(None, None, -1)
    forward = _judge(previous, current, TURN)
    np.testing.assert_array_equal(
        forward, _judge(previous[reverse], current[reverse], TURN)[reverse]
    )


def _fisheye_views(noise_px: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Two views through the fisheye, and the angles (N,) to its axis in the second, degrees."""
    rng = np.random.default_rng(8)
    pixels = rng.uniform(0.0, 511.0, (900, 2))
    rays = np.column_stack([FISHEYE.undistort(pixels), np.ones(len(pixels))])
    points = rays / np.linalg.norm(rays, axis=1)[:, None] * rng.uniform(2.0, 12.0, (900, 1))
    moved = points @ TURN.T + np.array([0.2, 0.05, 0.1])
    pixels = FISHEYE.distort(moved[:, :2] / moved[:, 2:]) + rng.normal(0.0, noise_px, (900, 2))
    seen = FISHEYE.visible(points) & FISHEYE.visible(moved) & FISHEYE.inside(pixels)
    seen[seen] = FISHEYE.invertible(pixels[seen])
    current = FISHEYE.undistort(pixels[seen])
    angles = np.degrees(np.arctan(np.linalg.norm(current, axis=1)))
    return rays[seen, :2], current, angles


def test_far_from_the_axis_of_a_fisheye_a_pixel_is_still_a_pixel() -> None:
    previous, current, angles = _fisheye_views(0.5)
    good = motion_inliers(previous, current, TURN, FISHEYE, 2.0, np.random.default_rng(0))
    assert good[angles < 40.0].mean() > 0.99
    assert good[(angles > 60.0) & (angles < 80.0)].mean() > 0.99


def test_far_from_the_axis_of_a_fisheye_outliers_go() -> None:
    previous, current, angles = _fisheye_views(0.0)
    far = np.flatnonzero((angles > 60.0) & (angles < 75.0))[::8]
    toward = FISHEYE.distort(current[far]) - np.array([FISHEYE.cx, FISHEYE.cy])
    across = np.column_stack([-toward[:, 1], toward[:, 0]])
    across *= 12.0 / np.linalg.norm(across, axis=1)[:, None]
    current[far] = FISHEYE.undistort(FISHEYE.distort(current[far]) + across)
    good = motion_inliers(previous, current, TURN, FISHEYE, 2.0, np.random.default_rng(0))
    assert good[far].mean() < 0.35  # some stay near their epipolar line
    assert np.delete(good, far).all()


def test_points_where_the_lens_has_no_inverse_are_no_inliers() -> None:
    camera = RadTanCamera(640, 480, 200.0, 200.0, 320.0, 240.0, -0.3, 0.0, 0.0, 0.0)
    pixels = np.random.default_rng(0).uniform([0.0, 0.0], [639.0, 479.0], (400, 2))
    clear = camera.invertible(pixels)
    assert 50 < clear.sum() < 350
    points = camera.undistort(pixels)
    good = motion_inliers(points, points, np.eye(3), camera, 2.0, np.random.default_rng(0))
    assert good[clear].all()
    assert not good[~clear].any()
