"""A hole in the IMU: how much the estimators say they don't know, and whether that is enough."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from p2gd_fgo.backends.base import Backend
from p2gd_fgo.backends.dead_reckoning import DeadReckoning
from p2gd_fgo.backends.msckf import Msckf
from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.config import BackendConfig
from p2gd_fgo.imu import UnknownMotion, across_holes, between
from p2gd_fgo.simulation.demo import DemoParameters, demo_calibration
from p2gd_fgo.simulation.imu import MEMS_NOISE
from p2gd_fgo.types import FloatArray, ImuBatch, NavState, Observations

GRAVITY = 9.81
SIGMA_RATE, SIGMA_ACCEL = 0.3, 2.0
START = np.diag(np.repeat([1e-3, 1e-2, 1e-2, 1e-4, 1e-2], 3) ** 2)
NOTHING = Observations(0, np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)))


def at_rest(hole_ms: tuple[int, int] | None) -> ImuBatch:
    t = np.arange(0, 2001, 10)
    if hole_ms is not None:
        t = t[(t <= hole_ms[0]) | (t >= hole_ms[1])]
    n = len(t)
    return ImuBatch(t * 1_000_000, np.zeros((n, 3)), np.tile([0.0, 0.0, GRAVITY], (n, 1)))


def bridged(imu: ImuBatch, begin_ms: int, end_ms: int) -> tuple[ImuBatch, UnknownMotion | None]:
    part = between(imu, begin_ms * 1_000_000, end_ms * 1_000_000)
    return across_holes(imu, part, 0.1, SIGMA_RATE, SIGMA_ACCEL)


def test_only_steps_inside_a_hole_are_unknown() -> None:
    imu = at_rest((500, 900))
    for whole in (bridged(imu, 0, 450), bridged(imu, 900, 1300)):
        assert whole[1] is None
    shorter = at_rest((500, 600))  # as long as imu.max_gap_s, not longer
    part, unknown = bridged(shorter, 0, 1000)
    assert unknown is None
    np.testing.assert_array_equal(part.stamps_ns, shorter.stamps_ns[shorter.stamps_ns <= 10**9])
    part, unknown = bridged(imu, 600, 700)
    assert unknown is not None and unknown.longest_s == 0.4
    np.testing.assert_allclose(unknown.accel, np.full(10, SIGMA_ACCEL * np.sqrt(0.4)))
    np.testing.assert_allclose(unknown.gyro, np.full(10, SIGMA_RATE * np.sqrt(0.4)))
    part, unknown = bridged(imu, 483, 922)
    assert unknown is not None and len(unknown.accel) == len(part) - 1
    missing = (part.stamps_ns[:-1] >= 500_000_000) & (part.stamps_ns[:-1] < 900_000_000)
    np.testing.assert_array_equal(unknown.accel > 0.0, missing)
    np.testing.assert_array_equal(part.stamps_ns[[0, 1, -1]] // 1_000_000, [483, 490, 922])
    assert np.diff(part.stamps_ns).max() == 10_000_000


def test_the_bridge_is_the_straight_line() -> None:
    plain = at_rest((500, 900))
    ramp = plain.stamps_ns[:, None] * 1e-9 * np.array([1.0, -2.0, 3.0])
    part, _ = bridged(ImuBatch(plain.stamps_ns, ramp, 2.0 * ramp), 300, 1000)
    expected = part.stamps_ns[:, None] * 1e-9 * np.array([1.0, -2.0, 3.0])
    np.testing.assert_allclose(part.gyro, expected, atol=1e-12)
    np.testing.assert_allclose(part.accel, 2.0 * expected, atol=1e-12)
    assert (np.diff(part.stamps_ns) > 0).all()


def backends() -> list[Backend]:
    calibration = demo_calibration(DemoParameters())
    config = BackendConfig()
    return [
        DeadReckoning(MEMS_NOISE, GRAVITY),
        Msckf(calibration, MEMS_NOISE, GRAVITY, config),
        Smoother(calibration, MEMS_NOISE, GRAVITY, config),
    ]


def covariance_after(backend: Backend, imu: ImuBatch, images_ms: list[int]) -> FloatArray:
    backend.start(NavState(0, np.eye(4), np.zeros(3)), START)
    estimate = backend.update(NOTHING, False)
    for a, b in pairwise(images_ms):
        backend.propagate(*bridged(imu, a, b))
        estimate = backend.update(NOTHING, False)
    return estimate.covariance


IMAGES_MS = list(range(0, 1601, 100))


def test_all_back_ends_know_alike_how_little_they_know() -> None:
    imu = at_rest((500, 1500))
    reckoned, filtered, smoothed = (covariance_after(b, imu, IMAGES_MS) for b in backends())
    scale = np.sqrt(np.outer(np.diagonal(reckoned), np.diagonal(reckoned)))
    np.testing.assert_allclose(filtered / scale, reckoned / scale, atol=0.1)
    np.testing.assert_allclose(smoothed / scale, reckoned / scale, atol=0.1)


@pytest.mark.parametrize("index", [0, 1, 2], ids=["dead reckoning", "msckf", "smoother"])
@pytest.mark.parametrize("images_ms", [IMAGES_MS, [0, 400, 1600]], ids=["images", "none inside"])
def test_a_constant_push_in_the_hole_is_covered(index: int, images_ms: list[int]) -> None:
    """As long as 1 s: a push of one sigma moves by no more than one sigma says."""
    P = covariance_after(backends()[index], at_rest((500, 1500)), images_ms)
    moved = 0.5 * SIGMA_ACCEL * 1.0**2 + SIGMA_ACCEL * 0.1
    assert moved < np.sqrt(P[3, 3]) < 1.5 * moved
    assert SIGMA_ACCEL * 0.99 < np.sqrt(P[6, 6]) < 1.5 * SIGMA_ACCEL
    assert SIGMA_RATE * 0.99 < np.sqrt(P[2, 2]) < 1.2 * SIGMA_RATE


@pytest.mark.parametrize("index", [1, 2], ids=["msckf", "smoother"])
def test_long_without_images_the_covariance_grows_and_stays_positive(index: int) -> None:
    """A hundred images without a single observation, five windows long."""
    imu = at_rest(None)
    backend = backends()[index]
    backend.start(NavState(0, np.eye(4), np.zeros(3)), START)
    sigmas = []
    for k in range(100):
        if k:
            backend.propagate(between(imu, (k - 1) * 20_000_000, k * 20_000_000))
        P = backend.update(NOTHING, False).covariance
        assert np.linalg.eigvalsh(P)[0] > 0.0
        sigmas.append(np.sqrt(np.diagonal(P)[3:6]).max())
    assert (np.diff(sigmas) > 0.0).all()
