"""The derivatives of the start's bundle adjustment against numbers, and its bookkeeping."""

from __future__ import annotations

import numpy as np
import pytest
from start_windows import drive, true_states, window

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.beginnings import first_points
from p2gd_fgo.initialization.bundle import Beliefs, Bundle, WindowStates
from p2gd_fgo.initialization.inertial import inertial_residuals
from p2gd_fgo.initialization.preintegration import Intervals, intervals, preintegrate
from p2gd_fgo.initialization.visual import Points, Views
from p2gd_fgo.types import FloatArray

NOISE = ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4)
STEP = 1e-6
IMAGES = 6


@pytest.fixture(scope="module")
def setting() -> tuple[Intervals, Views, WindowStates, Points]:
    """A noisy window, and states and points somewhere near the truth."""
    recording = drive(3, duration_s=4.0)
    sightings = window(recording, 20, 34, IMAGES)
    pieces = intervals(recording.imu, sightings.stamps_ns)
    rng = np.random.default_rng(1)
    scale = np.tile(np.repeat([0.01, 0.05, 0.05, 0.01, 0.1], 3), IMAGES)
    scale = np.append(scale, np.full(3, 0.01))
    states = true_states(recording, sightings).retract(scale * rng.standard_normal(len(scale)))
    T_imu_cam = recording.calibration.T_imu_cam
    views = Views(sightings, recording.calibration.camera, T_imu_cam, 1.0)
    points = first_points(sightings, states, T_imu_cam)
    return pieces, views, states, points


def numerical(function: object, size: int) -> FloatArray:
    columns = []
    for k in range(size):
        delta = np.zeros(size)
        delta[k] = STEP
        columns.append((function(delta) - function(-delta)) / (2.0 * STEP))  # type: ignore[operator]
    return np.stack(columns, axis=-1)


def test_preintegration_follows_the_biases() -> None:
    recording = drive(5, duration_s=3.0)
    stamps = recording.image_stamps_ns[5:9]
    pieces = intervals(recording.imu, stamps)
    at = np.array([0.01, -0.02, 0.03, 0.1, -0.2, 0.3])
    base = preintegrate(pieces, at[:3], at[3:], NOISE)

    def moved(delta: FloatArray) -> FloatArray:
        m = preintegrate(pieces, at[:3] + delta[:3], at[3:] + delta[3:], NOISE)
        theta = so3.log(np.swapaxes(base.R, -1, -2) @ m.R)
        return np.concatenate([theta, m.v, m.p], axis=1)

    np.testing.assert_allclose(base.by_bias, numerical(moved, 6), atol=2e-5)


def test_preintegrated_noise_is_what_many_draws_show() -> None:
    recording = drive(5, duration_s=3.0, noise=False)
    stamps = recording.image_stamps_ns[5:7]
    pieces = intervals(recording.imu, stamps)
    rng = np.random.default_rng(0)
    draws = 4000
    dt = np.sqrt(np.maximum(pieces.dt_s, 1e-12))[..., None]
    many = Intervals(
        np.repeat(pieces.dt_s, draws, 0),
        pieces.gyro
        + NOISE.gyro_noise_density / dt * rng.standard_normal((draws, *pieces.gyro.shape[1:])),
        pieces.accel
        + NOISE.accel_noise_density / dt * rng.standard_normal((draws, *pieces.accel.shape[1:])),
        np.repeat(pieces.duration_s, draws),
    )
    zero = np.zeros(3)
    exact, noisy = preintegrate(pieces, zero, zero, NOISE), preintegrate(many, zero, zero, NOISE)
    errors = np.concatenate(
        [so3.log(exact.R[0].T @ noisy.R), noisy.v - exact.v[0], noisy.p - exact.p[0]], axis=1
    )
    seen = np.sqrt((errors**2).mean(0))
    np.testing.assert_allclose(seen, np.sqrt(np.diag(exact.covariance[0])), rtol=0.06)


def test_inertial_derivatives(setting: tuple[Intervals, Views, WindowStates, Points]) -> None:
    pieces, _, states, _ = setting
    _, J, _ = inertial_residuals(states, pieces, NOISE, 9.81)
    size = 15 * IMAGES + 3
    all_of_it = numerical(
        lambda d: inertial_residuals(states.retract(d), pieces, NOISE, 9.81)[0], size
    )
    for n in range(IMAGES - 1):
        own = slice(15 * n, 15 * n + 30)
        np.testing.assert_allclose(J[n], all_of_it[n, :, own], atol=5e-5)
        rest = np.delete(all_of_it[n], np.r_[own], axis=1)
        np.testing.assert_allclose(rest, 0.0, atol=1e-9)


def test_visual_derivatives(setting: tuple[Intervals, Views, WindowStates, Points]) -> None:
    _, views, states, points = setting
    r, J_x, J_l, J_c = views.jacobians(states.R, states.p, points)
    seen = np.isfinite(r).all(axis=1)
    assert seen.mean() > 0.95

    def by_pose(d: FloatArray) -> FloatArray:
        all_alike = np.tile(np.concatenate([d, np.zeros(9)]), IMAGES)
        moved = states.retract(np.append(all_alike, np.zeros(3)))
        return views.residuals(moved.R, moved.p, points)[seen]

    def by_point(d: FloatArray) -> FloatArray:
        return views.residuals(states.R, states.p, points.moved(d))[seen]

    np.testing.assert_allclose(J_x[seen], numerical(by_pose, 6), rtol=2e-3, atol=2e-2)

    def by_camera(d: FloatArray) -> FloatArray:
        return views.turned(so3.exp(d)).residuals(states.R, states.p, points)[seen]

    np.testing.assert_allclose(J_l[seen], numerical(by_point, 3), rtol=2e-3, atol=2e-2)
    np.testing.assert_allclose(J_c[seen], numerical(by_camera, 3), rtol=2e-3, atol=2e-2)


def test_the_points_are_eliminated_as_the_whole_system_would(
    setting: tuple[Intervals, Views, WindowStates, Points],
) -> None:
    """The reduced system's step is that of all unknowns at once."""
    pieces, views, states, points = setting
    views = views.turned(states.camera_turn)
    r = views.residuals(states.R, states.p, points)
    keep = np.logical_and.reduceat(np.isfinite(r).all(axis=1), views.sightings.starts)
    views, points = views.only(keep), points.only(keep)
    uncalibrated = views.turned(states.camera_turn.T)  # the bundle turns it itself
    bundle = Bundle(pieces, uncalibrated, NOISE, 9.81, Beliefs(0.1, 0.1, 0.002, 0.01, 0.01))
    H, g, gain, shift = bundle.linearize(states, points, robust=False)
    step = np.linalg.solve(H, g)
    r, J_x, J_l, J_c = views.jacobians(states.R, states.p, points)
    poses = (np.arange(IMAGES)[:, None] * 15 + np.arange(6)).ravel()
    poses = np.append(poses, 15 * IMAGES + np.arange(3))
    point_step = shift - gain @ step[poses]
    # Where the points stand after it, their gradient must have vanished.
    k, m = views.sightings.image, views.sightings.track
    moved = r + (J_x @ step[:-3].reshape(-1, 15)[k, :6, None])[..., 0] + J_c @ step[-3:]
    moved += (J_l @ point_step[m][..., None])[..., 0]
    gradient = np.add.reduceat(
        (np.swapaxes(J_l, -1, -2) @ moved[..., None])[..., 0], views.sightings.starts
    )
    scale = np.abs(np.add.reduceat((np.swapaxes(J_l, -1, -2) @ r[..., None])[..., 0],
                                   views.sightings.starts)).max()  # fmt: skip
    assert np.abs(gradient).max() < 1e-3 * scale
