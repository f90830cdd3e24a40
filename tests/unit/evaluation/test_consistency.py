"""Errors in the estimator's tangent space and their normalised squares."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.consistency import free_sigmas, nees, pose_error
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation


def test_pose_error_finds_the_perturbation() -> None:
    rng = np.random.default_rng(0)
    R_hat, p_hat = so3.exp(rng.normal(size=(40, 3))), rng.normal(size=(40, 3))
    errors = rng.normal(scale=0.3, size=(40, 6))
    truth = from_rotation_translation(R_hat @ so3.exp(errors[:, :3]), p_hat + errors[:, 3:])
    found = pose_error(from_rotation_translation(R_hat, p_hat), truth)
    np.testing.assert_allclose(found, errors, atol=1e-12)


def test_nees_of_drawn_errors_is_chi_square() -> None:
    rng = np.random.default_rng(1)
    A = rng.normal(size=(4000, 6, 6))
    covariances = A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(6)
    errors = (np.linalg.cholesky(covariances) @ rng.normal(size=(4000, 6, 1)))[..., 0]
    values = nees(errors, covariances)
    assert values.mean() == pytest.approx(6.0, abs=0.2)
    assert values.var() == pytest.approx(12.0, rel=0.1)
    direct = errors[0] @ np.linalg.inv(covariances[0]) @ errors[0]
    assert values[0] == pytest.approx(direct, rel=1e-6)


def test_indefinite_covariance_is_named() -> None:
    covariances = np.stack([np.eye(2), np.diag([1.0, -0.5])])
    with pytest.raises(DataError, match=r"covariance 1 .* -0\.5"):
        nees(np.ones((2, 2)), covariances)


def test_free_sigmas_are_those_of_drawn_errors() -> None:
    rng = np.random.default_rng(2)
    A = 0.01 * rng.normal(size=(6, 6))
    T = from_rotation_translation(so3.exp(rng.normal(size=3)), rng.normal(size=3))
    drawn = rng.normal(size=(20000, 6)) @ A.T
    turned = T[:3, :3] @ so3.exp(drawn[:, :3]) @ T[:3, :3].T
    yaw = so3.log(turned)[:, 2]
    found = free_sigmas(T[None], (A @ A.T)[None])[0]
    np.testing.assert_allclose(found, [*drawn[:, 3:].std(axis=0), yaw.std()], rtol=0.02)
