"""The spline passes its knots, and its derivatives are those of its poses."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.geometry import so3
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray

EPOCH_NS = 1_300_000_000_123_456_789


def knots(start_ns: int) -> tuple[IntArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 4.0, 0.1)
    phase = rng.uniform(0.0, 6.0, (2, 3))
    positions = np.sin(1.3 * t[:, None] + phase[0]) * [3.0, 2.0, 0.5]
    rotations = so3.exp(np.sin(0.9 * t[:, None] + phase[1]) * [0.3, 0.2, 2.0])
    return start_ns + np.round(t * NANOSECONDS).astype(np.int64), positions, rotations


@pytest.fixture
def spline() -> SplineTrajectory:
    return SplineTrajectory(*knots(EPOCH_NS))


def test_the_knots_are_passed(spline: SplineTrajectory) -> None:
    stamps, positions, rotations = knots(EPOCH_NS)
    T = spline.sample(stamps).T_world_imu
    np.testing.assert_allclose(T[:, :3, 3], positions, atol=1e-12)
    np.testing.assert_allclose(T[:, :3, :3], rotations, atol=1e-12)
    assert spline.span_ns == (stamps[0], stamps[-1])


def test_derivatives_are_those_of_the_poses(spline: SplineTrajectory) -> None:
    h_ns = 100_000
    h = h_ns / NANOSECONDS
    t = EPOCH_NS + np.arange(50_000_000, 3_800_000_000, 37_123_457)
    before, now, after = (spline.sample(t + k * h_ns) for k in (-1, 0, 1))
    p = [s.T_world_imu[:, :3, 3] for s in (before, now, after)]
    np.testing.assert_allclose(now.velocity, (p[2] - p[0]) / (2 * h), atol=1e-6)
    slope = (after.velocity - before.velocity) / (2 * h)
    np.testing.assert_allclose(now.acceleration, slope, atol=1e-6)
    R_before, R_after = before.T_world_imu[:, :3, :3], after.T_world_imu[:, :3, :3]
    turn = so3.log(np.swapaxes(R_before, -1, -2) @ R_after) / (2 * h)
    np.testing.assert_allclose(now.angular_rate, turn, atol=1e-6)


def test_large_stamps_lose_nothing() -> None:
    early, late = SplineTrajectory(*knots(0)), SplineTrajectory(*knots(EPOCH_NS))
    t = np.arange(0, 3_900_000_000, 12_345_679)
    a, b = early.sample(t), late.sample(EPOCH_NS + t)
    for name in ("T_world_imu", "velocity", "acceleration", "angular_rate"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@pytest.mark.parametrize("miss_ns", [-1, 3_900_000_001])
def test_outside_the_span_is_refused(spline: SplineTrajectory, miss_ns: int) -> None:
    with pytest.raises(ValueError, match="outside"):
        spline.sample(np.array([EPOCH_NS, EPOCH_NS + miss_ns]))


def test_truth_is_pose_and_velocity(spline: SplineTrajectory) -> None:
    t = EPOCH_NS + np.array([0, 1, 10**9])
    truth, state = spline.truth(t), spline.sample(t)
    np.testing.assert_array_equal(truth.trajectory.stamps_ns, t)
    np.testing.assert_array_equal(truth.trajectory.T_world_imu, state.T_world_imu)
    assert truth.velocity is not None and truth.gyro_bias is None
    np.testing.assert_array_equal(truth.velocity, state.velocity)
