"""The camera's rotation in the body as an unknown of the start's bundle adjustment."""

from __future__ import annotations

import numpy as np
from start_windows import drive, true_states, window

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.beginnings import first_points
from p2gd_fgo.initialization.bundle import Beliefs, Bundle
from p2gd_fgo.initialization.preintegration import intervals
from p2gd_fgo.initialization.visual import Views
from p2gd_fgo.simulation.feature_recording import ROBOT_PLATFORM

NOISE = ImuNoise(1.7e-4, 1e-5, 5.9e-3, 1e-4)


def test_a_turn_shows_how_the_camera_is_turned_in_the_body() -> None:
    """Held, a wrong rotation bends tilt and velocity; as an unknown it is found."""
    recording = drive(3, duration_s=8.0, noise=False, platform=ROBOT_PLATFORM)
    sightings = window(recording, 35, 65, 16)
    truth = true_states(recording, sightings)
    heading = np.arctan2(truth.R[:, 1, 0], truth.R[:, 0, 0])
    assert np.degrees(np.ptp(np.unwrap(heading))) > 45.0  # the window turns
    wrong = so3.exp(np.radians([0.4, -0.6, 0.3]))
    T_imu_cam = recording.calibration.T_imu_cam.copy()
    T_imu_cam[:3, :3] = T_imu_cam[:3, :3] @ wrong
    left, tilt, velocity = [], [], []
    for sigma_deg in (1e-3, 1.0):
        views = Views(sightings, recording.calibration.camera, T_imu_cam, 0.1)
        points = first_points(sightings, truth, T_imu_cam)
        seen = np.isfinite(views.residuals(truth.R, truth.p, points)).all(axis=1)
        seen = np.logical_and.reduceat(seen, sightings.starts)
        beliefs = Beliefs(0.1, 0.1, 0.002, 0.01, np.radians(sigma_deg))
        bundle = Bundle(
            intervals(recording.imu, sightings.stamps_ns), views.only(seen), NOISE, 9.81, beliefs
        )
        found, _, _, converged = bundle.minimize(truth, points.only(seen), 30, robust=False)
        assert converged
        left.append(float(np.linalg.norm(so3.log(wrong @ found.camera_turn))))
        tilt.append(float(np.linalg.norm(np.cross(found.R[-1, 2], truth.R[-1, 2]))))
        body = found.R[-1].T @ found.v[-1]
        velocity.append(float(np.linalg.norm(body - truth.R[-1].T @ truth.v[-1])))
    assert np.degrees(left[0]) > 0.7 and np.degrees(left[1]) < 0.15
    assert tilt[1] < 0.3 * tilt[0] and velocity[1] < 0.3 * velocity[0]
