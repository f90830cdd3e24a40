"""Without noise the filter is exact, with noise consistent, and it learns what can be learnt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from msckf_runs import least_free_sigma, msckf
from smoother_runs import SETTLED, record, run

from p2gd_fgo.backends.msckf.msckf import Msckf
from p2gd_fgo.backends.msckf.propagation import propagate
from p2gd_fgo.backends.msckf.state import Poses
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.imu import UnknownMotion
from p2gd_fgo.types import FloatArray, ImuBatch, NavState

NO_NOISE = ImuNoise(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("name", "fej"), [("car", False), ("robot", True)])
def test_exact_measurements_give_the_exact_route(name: str, fej: bool) -> None:
    recording = record(name, 0, 30.0, noise=False)
    result = run(msckf(recording, fej=fej), recording, None)
    assert len(result.estimates) == 300
    assert result.position_error.max() < 1e-3


def test_exact_when_images_lie_off_the_imu_samples() -> None:
    """Half a sample off, at up to 12 m/s."""
    recording = record("car", 1, 15.0, noise=False, image_offset_ns=5_000_000)
    result = run(msckf(recording), recording, None)
    assert result.position_error.max() < 1e-3


@pytest.mark.parametrize(("name", "fej"), [("car", False), ("robot", True)])
def test_covariance_says_how_large_the_errors_are(name: str, fej: bool) -> None:
    """Pose NEES of five drives with errors drawn from the covariances, 6 degrees of freedom."""
    means = []
    for seed in range(5):
        recording = record(name, seed, 14.0)
        result = run(msckf(recording, fej=fej), recording, seed)
        means.append(result.nees[SETTLED:].mean())
    assert 3.5 < np.mean(means) < 9.0, means


def test_yaw_and_position_are_never_known_better_than_at_the_start() -> None:
    recording = record("robot", 1, 60.0)
    result = run(msckf(recording, fej=True), recording, 1)
    assert least_free_sigma(result) > 0.99


def gauge(poses: Poses, velocity: FloatArray) -> FloatArray:
    """(6 N + 9, 4): a shift of the world and its turn about z, as errors at these states."""
    up = np.array([0.0, 0.0, 1.0])
    shift = np.concatenate(
        [np.zeros((len(poses), 3, 3)), np.tile(np.eye(3), (len(poses), 1, 1))], 1
    )
    turn = np.concatenate([poses.R[:, 2, :], np.cross(up, poses.p)], axis=1)
    rows = np.concatenate([shift.reshape(-1, 3), turn.reshape(-1, 1)], axis=1)
    motion = np.zeros((9, 4))
    motion[:3, 3] = np.cross(up, velocity)
    return np.concatenate([rows.reshape(-1, 4), motion])


class Watched(Msckf):
    """Keeps what each transition and each update say of the gauge of the first estimates."""

    carried_wrong: list[float]
    learnt: list[float]

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        before = gauge(self._state.first_poses, self._state.first_velocity)
        # A covariance of nothing but a turn of the world must become just that of the turn later.
        probe = replace(self._state, covariance=np.outer(before[:, 3], before[:, 3]))
        moved = propagate(probe, imu, NO_NOISE, 9.81, fej=self._config.fej)
        after = gauge(moved.first_poses, moved.first_velocity)[:, 3]
        off = moved.covariance - np.outer(after, after)
        self.carried_wrong.append(float(np.abs(off).max() / np.abs(after).max()))
        return super().propagate(imu, unknown)

    def _posterior(
        self, L: FloatArray, Z: FloatArray, r: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        state = self._state
        N = np.linalg.solve(L, gauge(state.first_poses, state.first_velocity))
        self.learnt.append(float(np.abs(Z @ N).max() / (np.linalg.norm(Z) * np.abs(N).max())))
        return super()._posterior(L, Z, r)


@pytest.mark.parametrize("fej", [True, False])
def test_linearised_system_keeps_its_null_space_with_first_estimates(fej: bool) -> None:
    """Over a noisy drive with a stop: an error along the gauge is carried to the gauge, unseen."""
    recording = record("robot", 2, 14.0, stops_s=((6.0, 9.0),))
    backend = msckf(recording, Watched, fej=fej)
    assert isinstance(backend, Watched)
    backend.carried_wrong, backend.learnt = [], []
    run(backend, recording, 2, delay_s=0.5)
    assert len(backend.learnt) > 100 and len(backend.carried_wrong) == 139
    if fej:
        assert max(backend.learnt) < 1e-12
        assert max(backend.carried_wrong) < 1e-10
    else:
        assert max(backend.learnt) > 1e-6
        assert max(backend.carried_wrong) > 1e-4


def test_corrupted_tracks_do_little_harm() -> None:
    """A fifth of the tracks slide off their landmark."""
    errors = {0.0: [], 0.2: []}  # type: dict[float, list[float]]
    for seed in range(2):
        for share, found in errors.items():
            recording = record("robot", seed, 14.0, outlier_share=share)
            backend = msckf(recording)
            found.append(run(backend, recording, seed).position_rmse)
            if share:
                assert backend.counts["rejected_outlier"] > 500
    assert np.median(errors[0.2]) < 2.0 * np.median(errors[0.0])
