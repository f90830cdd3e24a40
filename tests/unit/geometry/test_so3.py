"""Rotations: inverses, Jacobians against differences, integrals against quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray

ANGLES = [0.0, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 0.99e-2, 1.01e-2, 0.3, 1.5, 3.0, 3.14]

coordinate = st.floats(-1.0, 1.0)
axes = (
    st.tuples(coordinate, coordinate, coordinate)
    .map(np.array)
    .filter(lambda v: float(np.linalg.norm(v)) > 0.1)
    .map(lambda v: v / np.linalg.norm(v))
)
exponents = st.floats(-14.0, 0.0)


def vectors(angle: float, count: int = 20) -> FloatArray:
    rng = np.random.default_rng(3)
    v = rng.standard_normal((count, 3))
    return np.asarray(angle * v / np.linalg.norm(v, axis=1, keepdims=True))


def test_hat_is_the_cross_product() -> None:
    v, w = np.random.default_rng(0).standard_normal((2, 4, 5, 3))
    np.testing.assert_allclose((so3.hat(v) @ w[..., None])[..., 0], np.cross(v, w), atol=1e-15)


@given(axes, st.floats(0.0, np.pi - 1e-9))
@example(np.array([0.0, 0.0, 1.0]), 0.0)
@example(np.array([0.6, 0.0, -0.8]), 1e-4)
@example(np.array([0.6, 0.0, -0.8]), np.pi - 1e-9)
def test_log_undoes_exp(axis: FloatArray, angle: float) -> None:
    R = so3.exp(angle * axis)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(so3.log(R), angle * axis, atol=2e-14)


@given(axes, exponents)
def test_log_undoes_exp_for_small_and_nearly_half_turns(axis: FloatArray, exponent: float) -> None:
    small = 10.0**exponent
    np.testing.assert_allclose(so3.log(so3.exp(small * axis)), small * axis, rtol=1e-8, atol=1e-16)
    angle = np.pi - small
    R = so3.exp(angle * axis)
    np.testing.assert_allclose(so3.exp(so3.log(R)), R, atol=1e-14)
    assert np.linalg.norm(so3.log(R)) <= np.pi + 1e-12


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), np.array([0.6, -0.8, 0.0])])
def test_a_half_turn_has_an_angle_of_pi(axis: FloatArray) -> None:
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    phi = so3.log(R)
    assert np.linalg.norm(phi) == pytest.approx(np.pi)
    np.testing.assert_allclose(np.abs(phi @ axis), np.pi)
    assert so3.angle_deg(R) == pytest.approx(180.0)


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_and_quaternions_agree_with_scipy(angle: float) -> None:
    phi = vectors(angle)
    rotation = Rotation.from_rotvec(phi)
    R, q = so3.exp(phi), rotation.as_quat(canonical=True)
    np.testing.assert_allclose(R, rotation.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(so3.log(R), phi, atol=1e-13)
    np.testing.assert_allclose(so3.to_quaternion(R), q, atol=1e-14)
    np.testing.assert_allclose(so3.from_quaternion(q), R, atol=1e-14)
    np.testing.assert_allclose(so3.from_quaternion(-3.0 * q), R, atol=1e-14)
    first = np.concatenate([q[:, 3:], q[:, :3]], axis=1)
    np.testing.assert_allclose(so3.from_quaternion(first, w_first=True), R, atol=1e-14)
    np.testing.assert_allclose(so3.angle_deg(R), np.degrees(angle), atol=1e-10)


def test_quaternions_of_all_kinds_of_rotations() -> None:
    """Every branch of the largest component, w near zero included."""
    rotations = Rotation.random(2000, rng=np.random.default_rng(5))
    q = so3.to_quaternion(rotations.as_matrix())
    assert (q[:, 3] >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0)
    np.testing.assert_allclose(so3.from_quaternion(q), rotations.as_matrix(), atol=1e-14)
    assert set(np.argmax(np.abs(q), axis=1)) == {0, 1, 2, 3}


@pytest.mark.parametrize("angle", ANGLES)
def test_the_right_jacobian_is_the_derivative_of_exp(angle: float) -> None:
    phi, h = vectors(angle), 1e-5
    numerical = np.zeros((len(phi), 3, 3))
    inverse = np.swapaxes(so3.exp(phi), -1, -2)
    for k, step in enumerate(h * np.eye(3)):
        plus, minus = so3.log(inverse @ so3.exp(phi + step)), so3.log(inverse @ so3.exp(phi - step))
        numerical[:, :, k] = (plus - minus) / (2.0 * h)
    np.testing.assert_allclose(so3.right_jacobian(phi), numerical, atol=1e-9)


@pytest.mark.parametrize("angle", [*ANGLES, 4.0])
def test_the_inverse_right_jacobian_is_its_inverse(angle: float) -> None:
    phi = vectors(angle)
    product = so3.right_jacobian_inverse(phi) @ so3.right_jacobian(phi)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-9)


@pytest.mark.parametrize("angle", ANGLES)
def test_integrals_of_the_rotation_against_quadrature(angle: float) -> None:
    """∫₀¹ Exp(sφ) ds is the left Jacobian; ∫₀¹∫₀ˢ Exp(τφ) dτ ds = ∫₀¹ (1 − τ) Exp(τφ) dτ."""
    phi = vectors(angle, 4)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    tau, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    R = so3.exp(tau[:, None, None] * phi)
    once = np.einsum("s,snij->nij", weights, R)
    twice = np.einsum("s,snij->nij", weights * (1.0 - tau), R)
    np.testing.assert_allclose(so3.right_jacobian(-phi), once, atol=1e-11)
    np.testing.assert_allclose(so3.second_integral(phi), twice, atol=1e-11)


def test_a_batch_is_the_sum_of_its_parts() -> None:
    phi = np.random.default_rng(1).standard_normal((2, 3, 3))
    phi[0, 0] = 0.0
    for function in (
        so3.exp, so3.right_jacobian, so3.right_jacobian_inverse, so3.second_integral,
    ):  # fmt: skip
        batch = function(phi)
        assert batch.shape == (2, 3, 3, 3)
        np.testing.assert_array_equal(batch[1, 2], function(phi[1, 2]))
