"""The prior against numerical derivatives, the Schur complement against the joint solution."""

from __future__ import annotations

import numpy as np
import pytest
from backend_samples import random_information, random_window
from numpy.linalg import LinAlgError

from p2gd_fgo.backends.smoother.marginalization import Prior, marginalize_oldest
from p2gd_fgo.backends.smoother.window import WindowStates
from p2gd_fgo.types import FloatArray


@pytest.mark.parametrize("displacement", [0.0, 0.4])
def test_recentred_prior_has_the_energys_derivatives(displacement: float) -> None:
    rng = np.random.default_rng(0)
    states = random_window(rng, 3)
    prior = Prior(states.part(slice(0, 2)), random_information(rng, 30), rng.normal(size=30))
    now = states.retract(displacement * rng.normal(size=45))

    def difference(delta: FloatArray) -> FloatArray:
        moved: WindowStates = now.retract(np.concatenate([delta, np.zeros(15)]))
        return prior.states.local(moved.part(slice(0, 2))).ravel()

    H, b = np.zeros((45, 45)), np.zeros(45)
    prior.add_to(H, b, now)

    step = 1e-6
    J = np.column_stack(
        [(difference(step * e) - difference(-step * e)) / (2 * step) for e in np.eye(30)]
    )
    d = difference(np.zeros(30))
    gradient = J.T @ (prior.H @ d - prior.b)
    np.testing.assert_allclose(b[:30], -gradient, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(H[:30, :30], J.T @ prior.H @ J, rtol=1e-6, atol=1e-6)
    assert not H[30:].any()
    assert not H[:, 30:].any()
    assert not b[30:].any()


def test_prior_is_added_to_what_is_there() -> None:
    rng = np.random.default_rng(1)
    states = random_window(rng, 2)
    prior = Prior(states, random_information(rng, 30), rng.normal(size=30))
    H, b = np.ones((30, 30)), np.ones(30)
    prior.add_to(H, b, states)
    np.testing.assert_allclose(H, prior.H + 1.0)
    np.testing.assert_allclose(b, prior.b + 1.0)


def test_marginalising_keeps_solution_and_covariance_of_the_rest() -> None:
    rng = np.random.default_rng(2)
    states = random_window(rng, 4)
    old_H, old_b = random_information(rng, 60), rng.normal(size=60)
    new_H, new_b = random_information(rng, 45), rng.normal(size=45)
    joint_H, joint_b = old_H.copy(), old_b.copy()
    joint_H[15:, 15:] += new_H
    joint_b[15:] += new_b

    prior = marginalize_oldest(old_H, old_b, states)
    assert prior.states.frames == (1, 2, 3)
    H, b = new_H.copy(), new_b.copy()
    prior.add_to(H, b, states.part(slice(1, None)))

    np.testing.assert_allclose(
        np.linalg.solve(H, b), np.linalg.solve(joint_H, joint_b)[15:], atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.inv(H), np.linalg.inv(joint_H)[15:, 15:], atol=1e-12)


def test_undetermined_state_is_refused() -> None:
    states = random_window(np.random.default_rng(3), 2)
    H = np.eye(30)
    H[4, 4] = 0.0
    with pytest.raises(LinAlgError):
        marginalize_oldest(H, np.zeros(30), states)
