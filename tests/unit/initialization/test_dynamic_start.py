"""The start in motion: exact without noise, honest with it, and a refusal that says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from start_windows import buffer_of, drive, error_of, true_states, window

from p2gd_fgo.config import Config, DynamicStartConfig, load_config, override
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.errors import ConfigError, DataError, InitializationError
from p2gd_fgo.imu import whole_since
from p2gd_fgo.initialization import (
    AutoStart,
    DynamicStart,
    GivenStart,
    Start,
    StaticStart,
    imu_history_s,
    make_initializer,
)
from p2gd_fgo.initialization.dynamic import uncertain
from p2gd_fgo.initialization.gyro_alignment import align_gyro
from p2gd_fgo.initialization.linear import solve_linear
from p2gd_fgo.initialization.preintegration import intervals, preintegrate
from p2gd_fgo.initialization.window import WindowMotion, WindowSolver
from p2gd_fgo.simulation.feature_recording import FeatureRecording
from p2gd_fgo.types import NANOSECONDS, ImuBatch, NavState, Trajectory, Truth, Waiting

GRAVITY = 9.81


def solver(recording: FeatureRecording) -> WindowSolver:
    noise = recording.calibration.imu_noise
    assert noise is not None
    return WindowSolver(recording.calibration, noise, GRAVITY, 1.0, DynamicStartConfig())


def test_without_noise_the_steps_are_exact() -> None:
    recording = drive(1, noise=False)
    sightings = window(recording, 30, 50)
    truth = true_states(recording, sightings)
    noise = recording.calibration.imu_noise
    assert noise is not None
    pieces = intervals(recording.imu, sightings.stamps_ns)
    T_imu_cam = recording.calibration.T_imu_cam
    bias = align_gyro(sightings, pieces, T_imu_cam[:3, :3], noise, 0.1, 1e-3)
    assert bias is not None
    np.testing.assert_allclose(bias, 0.0, atol=1e-5)
    motion = preintegrate(pieces, np.zeros(3), np.zeros(3), noise)
    linear = solve_linear(sightings, motion, T_imu_cam, GRAVITY, 0.1, 1e-6)
    up = linear.R[-1].T @ -linear.gravity / GRAVITY
    np.testing.assert_allclose(up, truth.R[-1, 2], atol=0.02)  # the bias' prior leaves a little
    body_velocity = linear.R[-1].T @ linear.v[-1]
    np.testing.assert_allclose(body_velocity, truth.R[-1].T @ truth.v[-1], atol=0.2)

    found = solver(recording).solve(sightings, recording.imu)
    assert found is not None and found.converged
    error = error_of(found.state, truth)
    assert np.degrees(np.abs(error[:3])).max() < 0.02
    np.testing.assert_allclose(error[6:9], 0.0, atol=0.01)
    np.testing.assert_allclose(error[9:12], 0.0, atol=2e-5)


def test_a_large_gyro_bias_is_found_before_anything_else() -> None:
    recording = drive(2, noise=True)
    sightings = window(recording, 20, 40)
    truth = recording.gyro_bias[40]
    noise = recording.calibration.imu_noise
    assert noise is not None
    shifted = np.array([0.03, -0.06, 0.08])
    pieces = intervals(recording.imu, sightings.stamps_ns)
    pieces.gyro[:] += np.where(pieces.dt_s[..., None] > 0.0, shifted, 0.0)
    T_imu_cam = recording.calibration.T_imu_cam
    bias = align_gyro(sightings, pieces, T_imu_cam[:3, :3], noise, 0.1, 1.0 / 800.0)
    assert bias is not None
    np.testing.assert_allclose(bias, truth + shifted, atol=0.006)


def test_with_noise_the_covariance_says_how_far_off_the_state_is() -> None:
    """NEES of tilt, velocity and biases (11), over windows of different drives."""
    nees, sure = [], 0
    for seed in range(6):
        recording = drive(seed, duration_s=8.0)
        sightings = window(recording, 20, 60)
        truth = true_states(recording, sightings)
        guess = NavState(
            int(sightings.stamps_ns[-1]),
            np.block([[truth.R[-1], np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]),
            truth.v[-1],
            truth.gyro_bias[-1],
            truth.accel_bias[-1],
        )
        found = solver(recording).solve(sightings, recording.imu, guess)
        assert found is not None
        error, P = error_of(found.state, truth), found.covariance
        np.testing.assert_allclose(P, P.T, atol=1e-12)
        assert np.linalg.eigvalsh(P).min() > 0.0
        basis = np.linalg.svd(found.state.T_world_imu[2, :3][None])[2][1:]
        pick = np.zeros((11, 15))
        pick[:2, :3], pick[2:, 6:] = basis, np.eye(9)
        e = pick @ error
        nees.append(float(e @ np.linalg.solve(pick @ P @ pick.T, e)))
        sure += found.speed_sigma < 0.1 * found.speed
    # The prior of the accelerometer's bias is three times what the simulation draws: a low value
    # is right, and the upper bound is what the test is for.
    assert np.mean(nees) < chi2.ppf(0.999, 11 * len(nees)) / len(nees), nees
    assert sure >= 2  # the others say that they don't know the speed


def attempts(initializer: object, recording: FeatureRecording, first: int) -> Start | None:
    for k in range(first, len(recording.observations)):
        observations = recording.observations[k]
        answer = initializer.attempt(  # type: ignore[attr-defined]
            observations.stamp_ns, recording.imu, buffer_of(observations)
        )
        if isinstance(answer, Start):
            return answer
        assert isinstance(answer, Waiting)
    return None


def test_it_starts_in_motion_and_reports_time_and_images() -> None:
    recording = drive(4, duration_s=12.0)
    noise = recording.calibration.imu_noise
    assert noise is not None
    config = DynamicStartConfig(every_s=1.5)
    initializer = DynamicStart(config, recording.calibration, noise, GRAVITY, 1.0)
    start = attempts(initializer, recording, 20)
    assert start is not None
    k = int(np.searchsorted(recording.image_stamps_ns, start.state.stamp_ns))
    true_speed = float(np.linalg.norm(recording.velocity[k]))
    speed = float(np.linalg.norm(start.state.velocity))
    assert abs(speed - true_speed) < 0.15 * true_speed
    up = start.state.T_world_imu[2, :3] @ recording.T_world_imu[k, 2, :3]
    assert np.degrees(np.arccos(up)) < 2.0
    np.testing.assert_allclose(start.state.T_world_imu[:2, 3], 0.0, atol=1e-3)
    after = (k - 20) / 10
    assert start.note.startswith(f"dynamic, after {after:.1f} s: ")
    assert " images, " in start.note and " tracks, speed " in start.note


def test_what_was_seen_before_a_hole_in_the_imu_is_in_no_window() -> None:
    """Else the samples would be joined over the hole, and the start be as sure as without one."""
    recording = drive(4, duration_s=12.0)
    noise = recording.calibration.imu_noise
    assert noise is not None
    stamps = recording.imu.stamps_ns
    begin, end = recording.image_stamps_ns[30] + 7, recording.image_stamps_ns[37] - 7
    kept = (stamps <= begin) | (stamps >= end)
    imu = ImuBatch(stamps[kept], recording.imu.gyro[kept], recording.imu.accel[kept])
    initializer = DynamicStart(DynamicStartConfig(), recording.calibration, noise, GRAVITY, 1.0)
    start = attempts(initializer, replace(recording, imu=imu), 20)
    assert start is not None
    k = int(np.searchsorted(recording.image_stamps_ns, start.state.stamp_ns))
    least_s = DynamicStartConfig().min_window_s
    assert start.state.stamp_ns - end >= least_s * NANOSECONDS
    speed = float(np.linalg.norm(start.state.velocity))
    assert abs(speed / np.linalg.norm(recording.velocity[k]) - 1.0) < 0.15
    assert whole_since(imu, int(recording.image_stamps_ns[30]), 0.1) == stamps[0]
    assert whole_since(imu, int(recording.image_stamps_ns[33]), 0.1) >= end


def test_a_start_that_is_not_sure_enough_waits_and_the_refusal_says_by_how_much() -> None:
    recording = drive(4, duration_s=6.0)
    noise = recording.calibration.imu_noise
    assert noise is not None
    config = DynamicStartConfig(
        max_speed_sigma=1e-4, still_speed_sigma=1e-4, min_window_s=2.0, max_wait_s=2.5
    )
    initializer = DynamicStart(config, recording.calibration, noise, GRAVITY, 1.0)
    with pytest.raises(InitializationError) as caught:
        attempts(initializer, recording, 20)
    text = str(caught.value)
    assert text.startswith("the dynamic start found no motion to start from in 2.6 s: at best ")
    assert "speed and scale are uncertain by" in text and "(threshold 0%" in text
    assert "\n" not in text


def test_what_is_sure_enough_depends_on_how_long_it_has_waited() -> None:
    state = NavState(0, np.eye(4), np.array([10.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    covariance = np.diag(np.r_[np.full(6, 1e-6), np.full(9, 1e-4)])
    covariance[6, 6] = 1.5**2
    motion = WindowMotion(state, covariance, 25, 300, 1.0, 0.3, 0.3, True)
    config = DynamicStartConfig(max_speed_sigma=0.05, patience_s=4.5, late_speed_sigma=0.3)
    early, text = uncertain(motion, config, 4.4)
    assert early == pytest.approx(3.0) and "uncertain by 15% (threshold 5%; " in text
    assert uncertain(motion, config, 4.5)[0] == pytest.approx(0.5)


def test_a_doubted_extrinsic_widens_the_velocity_across_the_way() -> None:
    recording = drive(3, duration_s=5.0)
    sightings = window(recording, 10, 40)
    noise = recording.calibration.imu_noise
    assert noise is not None
    found = []
    for degrees in (1e-3, 0.5):
        config = DynamicStartConfig(sigma_extrinsic_deg=degrees)
        solver = WindowSolver(recording.calibration, noise, GRAVITY, 1.0, config)
        found.append(solver.solve(sightings, recording.imu))
    sure, doubting = found
    assert sure is not None and doubting is not None
    more = doubting.covariance[6:9, 6:9] - sure.covariance[6:9, 6:9]
    across = np.cross(sure.state.velocity / sure.speed, [0.0, 0.0, 1.0])
    sigma = np.sqrt(across @ more @ across)
    # A camera that is turned in the body turns the way in the body by as much.
    assert sigma == pytest.approx(np.radians(0.5) * sure.speed, rel=0.3)


def test_a_bias_that_its_prior_cannot_explain_widens_everything() -> None:
    recording = drive(3, duration_s=5.0)
    sightings = window(recording, 10, 40)
    noise = recording.calibration.imu_noise
    assert noise is not None
    solver = WindowSolver(recording.calibration, noise, GRAVITY, 1.0, DynamicStartConfig())
    honest = solver.solve(sightings, recording.imu)
    shifted = replace(recording.imu, accel=recording.imu.accel + np.array([0.0, 0.0, 0.6]))
    bent = solver.solve(sightings, shifted)
    assert honest is not None and bent is not None
    bias = np.linalg.norm(bent.state.accel_bias) / 0.1
    assert bias > 4.0
    assert bent.tilt_sigma_deg > 0.8 * bias / np.sqrt(3.0) * honest.tilt_sigma_deg


def test_tracks_on_moving_things_are_left_out() -> None:
    honest = drive(5, duration_s=6.0)
    noise = honest.calibration.imu_noise
    assert noise is not None
    recording = drive(5, duration_s=6.0, outlier_share=0.1)
    found = solver(recording).solve(window(recording, 15, 50), recording.imu)
    assert found is not None and found.inliers < 0.97
    true_speed = float(np.linalg.norm(recording.velocity[50]))
    assert abs(found.speed - true_speed) < 3.0 * found.speed_sigma


def test_without_tracks_the_refusal_says_so() -> None:
    recording = drive(4, duration_s=2.0)
    noise = recording.calibration.imu_noise
    assert noise is not None
    config = DynamicStartConfig(min_tracks=5000)
    initializer = DynamicStart(config, recording.calibration, noise, GRAVITY, 1.0)
    assert attempts(initializer, recording, 0) is None
    assert "fewer than 5000 tracks" in str(initializer.refusal())


def test_auto_starts_static_when_standing_and_dynamic_when_moving() -> None:
    noise = ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4)
    soon = {"min_window_s": "2", "max_speed_sigma": "9", "max_tilt_sigma_deg": "9"}
    config = override(
        load_config(),
        {"initialization.kind": "auto"}
        | {f"initialization.dynamic.{field}": value for field, value in soon.items()},
    )

    recording = drive(4, duration_s=12.0)
    moving = make_initializer(config, recording.calibration, noise, None)
    assert isinstance(moving, AutoStart)
    start = attempts(moving, recording, 20)
    assert start is not None and start.note.startswith("dynamic")

    from test_static_start import Recording

    standing = Recording(0.01)
    initializer = make_initializer(config, recording.calibration, noise, None)
    for k in range(11):
        answer = initializer.attempt(standing.advance(k), standing.imu, standing.buffer)
    assert isinstance(answer, Start) and answer.note == "static, after 1.0 s"


def test_auto_refuses_only_when_both_do_and_gives_both_reasons() -> None:
    from test_static_start import Recording

    recording, shaking = drive(4, duration_s=2.0), Recording(0.4)
    noise = recording.calibration.imu_noise
    assert noise is not None
    config: Config = override(
        load_config(),
        {
            "initialization.kind": "auto",
            "initialization.static.max_wait_s": "1.5",
            "initialization.dynamic.max_wait_s": "2.5",
            "initialization.dynamic.min_window_s": "2.0",
        },
    )
    initializer = make_initializer(config, recording.calibration, noise, None)
    for k in range(26):
        assert isinstance(
            initializer.attempt(shaking.advance(k), shaking.imu, shaking.buffer), Waiting
        )
    with pytest.raises(InitializationError, match=r"no standstill.*; the dynamic start found no"):
        initializer.attempt(shaking.advance(26), shaking.imu, shaking.buffer)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("static", StaticStart), ("given", GivenStart), ("dynamic", DynamicStart)],
)
def test_the_configuration_names_the_kind(kind: str, expected: type) -> None:
    recording = drive(4, duration_s=2.0, noise=False)
    config = override(load_config(), {"initialization.kind": kind})
    noise = ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4)
    stamps, T = recording.image_stamps_ns, recording.T_world_imu
    truth = Truth(Trajectory(stamps, T), None, None, None)
    made = make_initializer(config, recording.calibration, noise, truth)
    assert isinstance(made, expected)
    longest = config.initialization.dynamic.max_window_s
    needed = longest if kind == "dynamic" else config.initialization.static.window_s
    assert imu_history_s(config) == needed
    if kind == "given":
        with pytest.raises(DataError, match="but the recording has no truth"):
            make_initializer(config, recording.calibration, noise, None)


def test_a_window_longer_than_it_may_be_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"min_window_s is 6, but max_window_s 5"):
        override(load_config(), {"initialization.dynamic.min_window_s": "6"})
