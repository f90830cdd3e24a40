"""The update in white coordinates is the Kalman update."""

from __future__ import annotations

import numpy as np
import pytest
from msckf_samples import SENSOR, filter_state, sightings
from scipy.linalg import null_space, qr
from scipy.stats import chi2
from test_msckf_measurement import SPANS, dense

from p2gd_fgo.backends.msckf.measurement import (
    jacobians,
    orthonormal_columns,
    residuals,
    times_root,
    without_point,
)
from p2gd_fgo.backends.msckf.update import gate, root, updated


def test_the_textbook_update_gives_the_same() -> None:
    """Null space by SVD, QR compression, gain, Joseph form."""
    rng = np.random.default_rng(0)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS, noise=1e-3)
    H_x, H_f = jacobians(seen, points, state.poses, SENSOR)
    r = residuals(seen, points, state.poses, SENSOR)
    P, n = state.covariance, len(state.covariance)
    H_all = dense(H_x, seen, 5, n)
    parts = []
    for k in range(len(seen)):
        mine = np.repeat(seen.track == k, 2)
        N = null_space(H_f.reshape(-1, 3)[mine].T)
        parts.append(np.column_stack([N.T @ H_all[mine], N.T @ r.ravel()[mine]]))
    compressed = qr(np.concatenate(parts), mode="r")[0][: n + 1]
    H, z = compressed[:, :n], compressed[:, n]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.eye(len(H)))
    left = np.eye(n) - K @ H
    joseph = left @ P @ left.T + K @ K.T

    L = root(P)
    Q = orthonormal_columns(H_f, seen)
    rows = without_point(times_root(H_x, seen, L), Q, seen).reshape(-1, n)
    rest = without_point(r[..., None], Q, seen).ravel()
    error, covariance = updated(L, rows, rest)
    np.testing.assert_allclose(error, K @ z, atol=1e-9)
    np.testing.assert_allclose(covariance, joseph, atol=1e-10)
    np.testing.assert_array_equal(covariance, covariance.T)


def test_gate_is_the_innovations_distance_and_passes_the_share_it_says() -> None:
    rng = np.random.default_rng(1)
    state = filter_state(rng, 5)
    spans = SPANS * 60
    seen, points = sightings(rng, state.poses, spans)
    H_x, H_f = jacobians(seen, points, state.poses, SENSOR)
    L = root(state.covariance)
    Q = orthonormal_columns(H_f, seen)
    rows = without_point(times_root(H_x, seen, L), Q, seen)
    # A state and noise as the filter believes them, to first order.
    passes = np.zeros(len(seen))
    trials = 40
    for _ in range(trials):
        drawn = dense(H_x, seen, 5, len(L)) @ (L @ rng.standard_normal(len(L)))
        noisy = (drawn + rng.standard_normal(len(drawn))).reshape(-1, 2)
        r = without_point(noisy[..., None], Q, seen)[..., 0]
        passes += gate(rows, r, seen, 0.9)
    assert passes.mean() / trials == pytest.approx(0.9, abs=0.03)

    track = 3
    mine = seen.track == track
    N = null_space(H_f[mine].reshape(-1, 3).T)
    H = N.T @ dense(H_x, seen, 5, len(L))[np.repeat(mine, 2)]
    z = N.T @ noisy[mine].ravel()
    distance = z @ np.linalg.solve(H @ state.covariance @ H.T + np.eye(len(H)), z)
    probability = float(chi2.cdf(distance, len(z)))
    lower, upper = max(probability - 1e-6, 1e-9), min(probability + 1e-6, 1 - 1e-12)
    assert not gate(rows, r, seen, lower)[track]
    assert gate(rows, r, seen, upper)[track]


def test_neighbouring_poses_tied_together_by_an_excellent_imu_have_a_root() -> None:
    rng = np.random.default_rng(2)
    shared = 100.0 * rng.normal(size=(3, 40))
    P = shared.T @ shared + 1e-11 * np.eye(40)
    L = root(P)
    np.testing.assert_allclose(L @ L.T, P, rtol=1e-9, atol=1e-6)
    with pytest.raises(np.linalg.LinAlgError):
        root(P - 10.0 * np.eye(40))
