"""Standing still, the account of observations, invariance, repeatability, refusals."""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from smoother_runs import fates, record, run, smoother

from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.backends.smoother.tracks import Track
from p2gd_fgo.errors import EstimatorError
from p2gd_fgo.evaluation import feature_runs
from p2gd_fgo.simulation.feature_recording import ROBOT_PLATFORM, record_features
from p2gd_fgo.types import ImuBatch


@pytest.mark.parametrize(
    ("name", "drift_m", "jump_m"), [("robot", 0.05, 0.02), ("car", 0.25, 0.03)]
)
def test_standing_still_for_15_s(name: str, drift_m: float, jump_m: float) -> None:
    recording = record(name, 1, 30.0, stops_s=((10.0, 25.0),))
    backend = smoother(recording)
    result = run(backend, recording, 1, delay_s=0.5)
    positions = np.array([e.state.T_world_imu[:3, 3] for e in result.estimates])
    still = np.flatnonzero(recording.still)
    assert np.linalg.norm(positions[still[-1]] - positions[still[0]]) < drift_m
    # What moves is the correction that the standstill brings; once it is made, nothing does.
    assert np.linalg.norm(positions[still[-1]] - positions[still[30]]) < 2.0 * jump_m
    # Nothing jumps when the tracks begin anew: the error goes on from where it was.
    error_steps = np.linalg.norm(np.diff(result.errors[:, 3:], axis=0), axis=1)
    assert error_steps[still[0] : still[-1]].max() < drift_m
    assert error_steps[still[-1] :][:20].max() < jump_m
    assert result.nees[still[-1] :].mean() < 20.0
    muted = sum(len(recording.observations[k]) for k in still[5:])
    assert backend.counts["muted_standing_still"] == pytest.approx(muted, rel=0.02)
    assert fates(backend.counts) == backend.counts["observations"]


@pytest.mark.parametrize("name", ["robot", "car"])
def test_slowing_down_without_a_detector_of_standstill_does_not_diverge(name: str) -> None:
    """Pixel noise must not pass for parallax."""
    recording = record(name, 0, 14.0, stops_s=((9.0, 14.0),))
    result = run(smoother(recording), recording, 0)
    assert result.position_error[-1] < 1.0


def test_an_uncertain_start_does_not_lock_vision_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """All tracks fail a gate that doesn't know how uncertain the speed is, and all are right."""
    sigmas = np.repeat([0.01, 0.25, 0.01, 0.1], 3)  # m, m/s, rad/s, m/s²
    sigmas = np.concatenate([np.radians([0.2, 0.2, 0.1]), sigmas])
    monkeypatch.setattr(feature_runs, "START_COVARIANCE", np.diag(sigmas**2))
    quiet = replace(ROBOT_PLATFORM, features=replace(ROBOT_PLATFORM.features, pixel_noise_px=0.3))
    recording = record_features(quiet, 5.0, np.random.default_rng(0))
    backend = smoother(recording, pixel_noise_px=0.3)
    result = run(backend, recording, 0)
    assert backend.counts["gate_opened"] in (1, 2)
    assert result.position_rmse < 1.0  # locked out it is 2.9 m
    assert fates(backend.counts) == backend.counts["observations"]


def test_every_observation_has_one_fate() -> None:
    class Spy(Smoother):
        folded = 0

        def _fold(self, tracks: list[Track], values: gtsam.Values) -> list[Track]:
            accepted = super()._fold(tracks, values)
            self.folded += sum(len(t.frames) for t in accepted)
            oldest = self._states.frames[0]
            assert all(t.frames[0] == oldest for t in tracks)
            live, settled = self._tracks.usable(self._frame, values)
            live.push_back(settled)
            in_prior = {id(t.factor) for t in accepted}
            assert all(id(live.at(i)) not in in_prior for i in range(live.size()))
            begins = {live.at(i).keys()[0] for i in range(live.size())}
            assert gtsam.symbol("x", oldest) not in begins
            return accepted

    recording = record("robot", 2, 12.0, outlier_share=0.1)
    backend = smoother(recording, Spy, window=12)
    result = run(backend, recording, 2)
    counts = backend.counts
    assert counts["observations"] == sum(len(o) for o in recording.observations)
    assert fates(counts) == counts["observations"]
    assert isinstance(backend, Spy)
    assert counts["marginalized"] == backend.folded > 0.6 * counts["observations"]
    assert counts["rejected_outlier"] + counts["rejected_chi_square"] > 100
    assert counts["in_window"] > 0
    assert result.position_error.max() < 1.0
    np.testing.assert_array_equal(result.smoothed.stamps_ns, recording.image_stamps_ns)
    # Lag-smoothed: the window's later images have improved the poses.
    smoothed = result.smoothed.T_world_imu[:, :3, 3] - recording.T_world_imu[:, :3, 3]
    assert np.sqrt((smoothed**2).sum(axis=1).mean()) < 1.2 * result.position_rmse


def test_result_does_not_depend_on_where_the_world_begins() -> None:
    recording = record("robot", 3, 12.0)
    moved = recording.T_world_imu.copy()
    moved[:, :3, 3] += [1000.0, -700.0, 30.0]
    far = replace(recording, T_world_imu=moved)
    here = run(smoother(recording), recording, 3)
    there = run(smoother(far), far, 3)
    np.testing.assert_allclose(there.errors, here.errors, atol=5e-3)  # a track on a gate


def test_exact_result_does_not_depend_on_the_anchor() -> None:
    class Elsewhere(Smoother):
        def _move_anchor(self) -> None:
            self._anchor = self._states.p[-1] + np.array([3.0, -2.0, 1.0])

    recording = record("robot", 3, 12.0, noise=False)
    result = run(smoother(recording, Elsewhere), recording, None)
    assert result.position_error.max() < 1e-4


def test_two_runs_are_the_same_to_the_last_bit() -> None:
    first, second = (
        run(smoother(recording), recording, 4)
        for recording in (record("car", 4, 8.0), record("car", 4, 8.0))
    )
    for a, b in zip(first.estimates, second.estimates, strict=True):
        np.testing.assert_array_equal(a.state.T_world_imu, b.state.T_world_imu)
        np.testing.assert_array_equal(a.covariance, b.covariance)
    np.testing.assert_array_equal(first.smoothed.T_world_imu, second.smoothed.T_world_imu)


@pytest.mark.parametrize("value", [1e5, np.nan])
def test_absurd_imu_ends_the_run_with_the_contracts_error(value: float) -> None:
    recording = record("car", 5, 5.0)
    accel = recording.imu.accel.copy()
    accel[250:] = value
    broken = replace(recording, imu=ImuBatch(recording.imu.stamps_ns, recording.imu.gyro, accel))
    with pytest.raises(EstimatorError, match="diverged") as caught:
        run(smoother(broken), broken, 5)
    assert recording.image_stamps_ns[20] <= caught.value.stamp_ns <= recording.image_stamps_ns[-1]
