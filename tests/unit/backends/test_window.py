"""The window's chart and its covariances."""

from __future__ import annotations

import gtsam
import numpy as np
from backend_samples import random_information, random_window
from gtsam.symbol_shorthand import B, V, X

from p2gd_fgo.backends.smoother.window import error_covariance, window_covariance
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray


def test_local_undoes_retract() -> None:
    rng = np.random.default_rng(0)
    states = random_window(rng, 4)
    delta = 0.3 * rng.normal(size=60)
    moved = states.retract(delta)
    np.testing.assert_allclose(states.local(moved).ravel(), delta, atol=1e-12)
    assert states.equals(states.retract(np.zeros(60)))
    assert not states.equals(moved)


def test_chart_is_gtsams_to_first_order() -> None:
    rng = np.random.default_rng(1)
    states = random_window(rng, 2)
    delta = 1e-5 * rng.normal(size=(2, 15))
    anchor = np.array([1.0, -2.0, 0.5])
    vectors = gtsam.VectorValues()
    for k in range(2):
        for key, part in ((X(k), slice(0, 6)), (V(k), slice(6, 9)), (B(k), slice(9, 15))):
            vectors.insert(key, delta[k, part])
    theirs = states.values(anchor).retract(vectors)
    ours = states.retract(delta.ravel())
    for k in range(2):
        pose = theirs.atPose3(X(k))
        np.testing.assert_allclose(pose.translation() + anchor, ours.p[k], atol=1e-9)
        np.testing.assert_allclose(pose.rotation().matrix(), ours.R[k], atol=1e-9)
        np.testing.assert_allclose(theirs.atVector(V(k)), ours.v[k], atol=1e-12)
        np.testing.assert_allclose(theirs.atConstantBias(B(k)).vector(), ours.bias[k], atol=1e-12)


def test_newest_state_comes_back_as_it_went_in() -> None:
    states = random_window(np.random.default_rng(2), 3)
    newest = states.newest()
    np.testing.assert_array_equal(newest.gyro_bias, states.bias[-1, 3:])
    np.testing.assert_array_equal(newest.accel_bias, states.bias[-1, :3])
    again = states.append(3, newest)
    assert again.part(slice(3, 4)).equals(states.part(slice(2, 3)))
    assert again.trajectory().stamps_ns.tolist() == [0, 100, 200, 200]


def test_error_covariance_is_that_of_drawn_errors() -> None:
    """Through the Jacobian of (chart → error of an estimate), taken numerically."""
    rng = np.random.default_rng(3)
    states = random_window(rng, 1)
    covariance = random_information(rng, 15)

    def error(delta: FloatArray) -> FloatArray:
        truth, estimate = states.retract(delta).newest(), states.newest()
        turn = estimate.T_world_imu[:3, :3].T @ truth.T_world_imu[:3, :3]
        return np.concatenate(
            [
                so3.log(turn),
                truth.T_world_imu[:3, 3] - estimate.T_world_imu[:3, 3],
                truth.velocity - estimate.velocity,
                truth.gyro_bias - estimate.gyro_bias,
                truth.accel_bias - estimate.accel_bias,
            ]
        )

    step = 1e-6
    J = np.column_stack([(error(step * e) - error(-step * e)) / (2 * step) for e in np.eye(15)])
    ours = error_covariance(covariance, states.R[0])
    np.testing.assert_allclose(ours, J @ covariance @ J.T, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(window_covariance(ours, states.R[0]), covariance, atol=1e-9)
