"""The static start: tilt and biases of samples at rest, an honest covariance, clear refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from p2gd_fgo.config import StaticStartConfig, StationaryConfig
from p2gd_fgo.errors import InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization import Start, StaticStart
from p2gd_fgo.initialization.static import level_state
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, Waiting

GRAVITY = 9.81
UP = np.array([0.0, 0.0, 1.0])
FRAME_NS = 100_000_000
START_NS = 10**18


def at_rest(R_world_imu: FloatArray, gyro_bias: FloatArray, accel_bias: FloatArray) -> ImuBatch:
    """1 s at 200 Hz without noise."""
    accel = R_world_imu.T @ (GRAVITY * UP) + accel_bias
    stamps = START_NS + 5_000_000 * np.arange(201)
    return ImuBatch(stamps, np.tile(gyro_bias, (201, 1)), np.tile(accel, (201, 1)))


@pytest.mark.parametrize("roll_deg", [0.0, 30.0, -170.0])
@pytest.mark.parametrize("pitch_deg", [0.0, 20.0, 89.0, -89.0])
def test_tilt_and_gyro_bias_come_out_exactly(roll_deg: float, pitch_deg: float) -> None:
    R = so3.exp(np.array([0.0, np.radians(pitch_deg), 0.0])) @ so3.exp(
        np.array([np.radians(roll_deg), 0.0, 0.0])
    )
    bias = np.array([0.08, -0.02, 0.3])
    state, P = level_state(at_rest(R, bias, np.zeros(3)), StaticStartConfig(), GRAVITY)
    got = state.T_world_imu[:3, :3]
    np.testing.assert_allclose(got.T @ got, np.eye(3), atol=1e-12)
    assert np.linalg.det(got) == pytest.approx(1.0)
    np.testing.assert_allclose(got.T @ UP, R.T @ UP, atol=1e-12)
    if abs(pitch_deg) < 60.0:  # the world's x axis points where the body's does
        assert got[1, 0] == pytest.approx(0.0, abs=1e-12) and got[0, 0] > 0.0
    np.testing.assert_allclose(state.gyro_bias, bias, atol=1e-12)
    np.testing.assert_allclose(state.accel_bias, 0.0, atol=1e-9)
    np.testing.assert_array_equal(state.T_world_imu[:3, 3], 0.0)
    assert state.stamp_ns == START_NS + NANOSECONDS
    np.testing.assert_allclose(P, P.T, atol=1e-15)
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_the_covariance_says_how_far_off_tilt_and_biases_are() -> None:
    """Errors of tilt (2), gyro bias (3) and accelerometer bias (3) over 600 draws."""
    config = StaticStartConfig()
    rng = np.random.default_rng(7)
    nees = []
    for _ in range(600):
        R = so3.exp(rng.uniform(-1.5, 1.5, 3))
        gyro_bias = rng.uniform(-0.1, 0.1, 3)
        accel_bias = config.sigma_accel_bias * rng.standard_normal(3)
        gyro_error = config.sigma_gyro_bias * rng.standard_normal(3)
        mean_error = config.sigma_gravity * rng.standard_normal(3)
        state, P = level_state(
            at_rest(R, gyro_bias + gyro_error, accel_bias + mean_error), config, GRAVITY
        )
        up_hat, up = state.T_world_imu[:3, :3].T @ UP, R.T @ UP
        # R = R̂ Exp(δθ) up to the free yaw, so up = Exp(−δθ) up_hat with δθ across up_hat.
        across = np.cross(up, up_hat)
        tilt = across / np.linalg.norm(across) * np.arcsin(np.linalg.norm(across))
        basis = np.linalg.svd(up_hat[None])[2][1:]
        pick = np.zeros((8, 15))
        pick[:2, :3] = basis
        pick[2:, 9:] = np.eye(6)
        error = np.concatenate(
            [basis @ tilt, gyro_bias - state.gyro_bias, accel_bias - state.accel_bias]
        )
        nees.append(error @ np.linalg.solve(pick @ P @ pick.T, error))
    low, high = (float(chi2.ppf(p, 8 * 600)) / 600 for p in (0.001, 0.999))
    assert low < np.mean(nees) < high


def test_tilt_and_accelerometer_bias_hang_together() -> None:
    c = StaticStartConfig()
    _, P = level_state(at_rest(np.eye(3), np.zeros(3), np.zeros(3)), c, GRAVITY)
    expected = np.hypot(c.sigma_accel_bias, c.sigma_gravity) / GRAVITY
    np.testing.assert_allclose(np.sqrt(np.diag(P)[:2]), expected, rtol=0.02)
    assert np.sqrt(P[2, 2]) == pytest.approx(np.radians(c.sigma_yaw_deg), rel=1e-6)
    correlation = P[0:3, 12:15] / np.sqrt(np.outer(np.diag(P)[:3], np.diag(P)[12:15]))
    # Leaning by +δ about x, a body feels g δ along y, as if its accelerometer had a bias there.
    assert correlation[0, 1] < -0.9 and correlation[1, 0] > 0.9
    assert np.sqrt(P[14, 14]) == pytest.approx(c.sigma_gravity, rel=0.05)


def test_a_force_that_is_not_gravity_is_refused() -> None:
    imu = at_rest(np.eye(3), np.zeros(3), np.zeros(3))
    in_g = ImuBatch(imu.stamps_ns, imu.gyro, imu.accel / GRAVITY)
    with pytest.raises(InitializationError, match=r"reads 1 m/s².*imu\.gravity = 9\.81.*unit"):
        level_state(in_g, StaticStartConfig(), GRAVITY)


class Recording:
    """A body that shakes or not, seen by a camera at 10 Hz."""

    def __init__(self, accel_noise: float) -> None:
        rng = np.random.default_rng(2)
        stamps = START_NS + 5_000_000 * np.arange(-200, 4001)
        accel = GRAVITY * UP + accel_noise * rng.standard_normal((len(stamps), 3))
        self.imu = ImuBatch(stamps, 1e-3 * rng.standard_normal((len(stamps), 3)), accel)
        self.buffer = FeatureBuffer(20)
        self.pixels = rng.uniform(0.0, 400.0, (50, 2))

    def advance(self, k: int) -> int:
        stamp = START_NS + k * FRAME_NS
        if k == 0:
            self.buffer.advance(stamp, np.zeros((0, 2)), np.zeros((0, 2)))
            self.buffer.add(self.pixels, self.pixels)
        else:
            self.buffer.advance(stamp, self.pixels, self.pixels)
        return stamp


def test_it_starts_as_soon_as_the_window_is_still() -> None:
    recording, initializer = (
        Recording(0.01),
        StaticStart(StaticStartConfig(), StationaryConfig(), GRAVITY),
    )
    for k in range(10):
        answer = initializer.attempt(recording.advance(k), recording.imu, recording.buffer)
        assert isinstance(answer, Waiting)
        assert answer.reason == "waiting for 1 s of standstill"
    start = initializer.attempt(recording.advance(10), recording.imu, recording.buffer)
    assert isinstance(start, Start)
    assert start.state.stamp_ns == START_NS + NANOSECONDS
    assert start.note == "static, after 1.0 s"
    assert start.covariance.shape == (15, 15)


def test_the_refusal_comes_in_time_and_names_values_and_thresholds() -> None:
    recording = Recording(0.4)
    config = StaticStartConfig(max_wait_s=3.0)
    initializer = StaticStart(config, StationaryConfig(), GRAVITY)
    for k in range(31):
        answer = initializer.attempt(recording.advance(k), recording.imu, recording.buffer)
        assert isinstance(answer, Waiting)
    with pytest.raises(InitializationError) as caught:
        initializer.attempt(recording.advance(31), recording.imu, recording.buffer)
    text = str(caught.value)
    assert "no standstill of 1 s in 3.1 s" in text
    assert "accelerometer deviation 0.3" in text and "(threshold 0.15)" in text
    assert "image motion 0 px over 50 features (threshold 0.5 px, at least 10 features)" in text
    assert "initialization.kind=given" in text
    assert "\n" not in text


def test_a_recording_shorter_than_the_window_is_refused_with_a_reason() -> None:
    recording, initializer = (
        Recording(0.01),
        StaticStart(StaticStartConfig(), StationaryConfig(), GRAVITY),
    )
    for k in range(5):
        initializer.attempt(recording.advance(k), recording.imu, recording.buffer)
    assert "no 1 s of IMU data and images in 0.4 s" in str(initializer.refusal())
