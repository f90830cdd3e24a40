"""Jacobians against differences, and the projection against a null space by the book."""

from __future__ import annotations

import numpy as np
from msckf_samples import SENSOR, filter_state, gauge, numerical_jacobian, sightings
from scipy.linalg import null_space

from p2gd_fgo.backends.msckf.measurement import (
    carried,
    jacobians,
    orthonormal_columns,
    residuals,
    times_root,
    without_point,
)
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.backends.msckf.update import root
from p2gd_fgo.types import FloatArray

SPANS = [(0, 5), (1, 4), (2, 5), (0, 3), (3, 5)]


def dense(blocks: FloatArray, seen: Sightings, images: int, size: int) -> FloatArray:
    """H_x (2 O, size) of blocks (O, 2, 6)."""
    H = np.zeros((len(blocks), 2, size))
    for row, view in enumerate(seen.view):
        assert view < images
        H[row, :, 6 * view : 6 * view + 6] = blocks[row]
    return H.reshape(-1, size)


def test_jacobians_are_those_of_the_residuals() -> None:
    rng = np.random.default_rng(0)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS, noise=1e-3)
    H_x, H_f = jacobians(seen, points, state.poses, SENSOR)
    size = len(state.covariance)

    def by_state(error: FloatArray) -> FloatArray:
        moved = state.corrected(error, state.covariance)
        return np.asarray(-residuals(seen, points, moved.poses, SENSOR).ravel())

    np.testing.assert_allclose(
        dense(H_x, seen, 5, size), numerical_jacobian(by_state, size), atol=1e-5
    )
    for k in range(len(seen)):
        rows = seen.track == k

        def by_point(error: FloatArray, k: int = k, rows: FloatArray = rows) -> FloatArray:
            moved = points.copy()
            moved[k] += error
            return np.asarray(-residuals(seen, moved, state.poses, SENSOR)[rows].ravel())

        expected = numerical_jacobian(by_point, 3)
        np.testing.assert_allclose(H_f[rows].reshape(-1, 3), expected, atol=1e-5)


def test_projection_keeps_what_a_null_space_by_the_book_keeps() -> None:
    rng = np.random.default_rng(1)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS, noise=1e-3)
    H_x, H_f = jacobians(seen, points, state.poses, SENSOR)
    L = root(state.covariance)
    Q = orthonormal_columns(H_f, seen)
    rows = without_point(times_root(H_x, seen, L), Q, seen)
    full = dense(H_x, seen, 5, len(L)) @ L
    for k in range(len(seen)):
        mine = seen.track == k
        Qk = Q[mine].reshape(-1, 3)
        np.testing.assert_allclose(Qk.T @ Qk, np.eye(3), atol=1e-14)
        N = null_space(H_f[mine].reshape(-1, 3).T)
        assert N.shape[1] == 2 * seen.lengths[k] - 3
        theirs = N.T @ full[np.repeat(mine, 2)]
        ours = rows[mine].reshape(-1, len(L))
        np.testing.assert_allclose(ours.T @ ours, theirs.T @ theirs, atol=1e-9)


def test_nothing_is_learnt_of_where_the_world_is_and_how_it_is_turned() -> None:
    """Rows without the point have the gauge of their linearisation point as null space."""
    rng = np.random.default_rng(2)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS, noise=1e-3)
    at = state.first_poses
    H_x, H_f = jacobians(seen, carried(points, seen, state.poses, at), at, SENSOR)
    H = dense(H_x, seen, 5, 30).reshape(-1, 2, 30)
    rows = without_point(H, orthonormal_columns(H_f, seen), seen).reshape(-1, 30)
    scale = np.abs(rows).max()
    assert np.abs(rows @ gauge(at)).max() < 1e-12 * scale
    assert np.abs(rows @ gauge(state.poses)).max() > 1e-4 * scale


def test_carried_points_are_seen_alike_by_the_last_image() -> None:
    rng = np.random.default_rng(3)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS)
    there = carried(points, seen, state.poses, state.first_poses)
    last = seen.starts + seen.lengths - 1
    off = residuals(seen, there, state.first_poses, SENSOR)
    assert np.abs(off[last]).max() < 1e-9
    assert np.abs(off).max() > 1e-2
    assert carried(points, seen, state.poses, state.poses) is points
