"""Where the filter linearises: what all tracks say, and what comes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msckf_samples import SENSOR, filter_state, sightings
from test_msckf_measurement import SPANS

from p2gd_fgo.backends.msckf import Msckf
from p2gd_fgo.backends.msckf.look_ahead import pose_information
from p2gd_fgo.backends.msckf.measurement import (
    jacobians,
    orthonormal_columns,
    residuals,
    times_root,
    without_point,
)
from p2gd_fgo.backends.msckf.update import most_likely, root, updated
from p2gd_fgo.config import load_config, override
from p2gd_fgo.imu import between
from p2gd_fgo.simulation.feature_recording import ROBOT_PLATFORM, record_features
from p2gd_fgo.simulation.imu import MEMS_NOISE
from p2gd_fgo.types import NavState


def test_information_says_what_the_rows_say() -> None:
    rng = np.random.default_rng(0)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, SPANS, noise=1e-3)
    H_x, H_f = jacobians(seen, points, state.poses, SENSOR)
    Q = orthonormal_columns(H_f, seen)
    L = root(state.covariance)
    Z = without_point(times_root(H_x, seen, L), Q, seen).reshape(-1, len(L))
    r = without_point(residuals(seen, points, state.poses, SENSOR)[..., None], Q, seen).ravel()

    A, b = pose_information(seen, points, state.poses, SENSOR)
    np.testing.assert_allclose(L[:30].T @ A @ L[:30], Z.T @ Z, atol=1e-9 * np.abs(Z.T @ Z).max())
    np.testing.assert_allclose(L[:30].T @ b, Z.T @ r, atol=1e-9 * np.abs(Z.T @ r).max())
    np.testing.assert_allclose(most_likely(L, A, b), updated(L, Z, r)[0], atol=1e-9)


def test_an_image_that_no_track_has_seen_has_no_information() -> None:
    rng = np.random.default_rng(0)
    state = filter_state(rng, 5)
    seen, points = sightings(rng, state.poses, [(1, 4), (1, 4), (2, 4)])
    A, b = pose_information(seen, points, state.poses, SENSOR)
    assert not A[:6].any() and not A[24:].any() and not b[:6].any() and not b[24:].any()
    assert A[6:24].any()


def test_scale_is_not_learnt_from_what_the_accelerometer_got_wrong() -> None:
    """The mean of two drives whose accelerometers err by the same to either side.

    What is odd in the error cancels. What is left has the same sign whatever the error: a scale
    from nothing. See docs/msckf.md for its size.
    """
    even = {look: np.mean([scale_error(look, push) for push in (0.2, -0.2)]) for look in (0, 1)}
    assert even[0] > 1e-3
    assert abs(even[1]) < even[0] / 3


def scale_error(look_ahead: int, push: float) -> float:
    """Of the way in 1.5 s at 1 m/s, speed known to 10 %, all tracks exact and due at the end."""
    recording = record_features(ROBOT_PLATFORM, 2.0, np.random.default_rng(3), noise=False)
    config = override(
        load_config(),
        {"backend.msckf.look_ahead": bool(look_ahead), "backend.msckf.outlier_px": 50.0},
    )
    noise = replace(MEMS_NOISE, accel_noise_density=100.0 * MEMS_NOISE.accel_noise_density)
    backend = Msckf(recording.calibration, noise, 9.81, config.backend)
    stamps = recording.image_stamps_ns[:16].tolist()
    true = recording.T_world_imu[:16]
    still = np.zeros(3)
    backend.start(
        NavState(stamps[0], true[0], recording.velocity[0], still, still),
        np.diag(np.repeat([1e-3, 1e-3, 0.1, 1e-5, 1e-5], 3) ** 2),
    )
    backend.update(recording.observations[0], False)
    for k in range(1, 16):
        imu = between(recording.imu, stamps[k - 1], stamps[k])
        backend.propagate(replace(imu, accel=imu.accel + np.array([push, 0.0, 0.0])))
        seen = recording.observations[k]
        if k == 15:  # all tracks are lost
            seen = replace(
                seen, ids=seen.ids[:0], pixels=seen.pixels[:0], normalized=seen.normalized[:0]
            )
        backend.update(seen, False)
    found = backend.finish().T_world_imu[[0, -1], :3, 3]
    way, true_way = np.diff(found, axis=0), np.diff(true[[0, -1], :3, 3], axis=0)
    return float(np.linalg.norm(way) / np.linalg.norm(true_way)) - 1.0
