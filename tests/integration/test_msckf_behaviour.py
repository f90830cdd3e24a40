"""Standing still, the account of observations, gaps, invariance, repeatability, refusals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msckf_runs import msckf
from smoother_runs import fates, record, run

from p2gd_fgo.backends.msckf.msckf import Msckf
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.config import load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import EstimatorError
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.types import BoolArray, ImuBatch, Observations


@pytest.mark.parametrize(
    ("name", "drift_m", "jump_m"), [("robot", 0.10, 0.02), ("car", 0.25, 0.03)]
)
def test_standing_still_for_15_s(name: str, drift_m: float, jump_m: float) -> None:
    recording = record(name, 1, 30.0, stops_s=((10.0, 25.0),))
    backend = msckf(recording)
    result = run(backend, recording, 1, delay_s=0.5)
    positions = np.array([e.state.T_world_imu[:3, 3] for e in result.estimates])
    still = np.flatnonzero(recording.still)
    assert np.linalg.norm(positions[still[-1]] - positions[still[0]]) < drift_m
    assert np.linalg.norm(positions[still[-1]] - positions[still[30]]) < 2.0 * jump_m
    error_steps = np.linalg.norm(np.diff(result.errors[:, 3:], axis=0), axis=1)
    assert error_steps[still[-1] :][:20].max() < jump_m
    assert result.nees[still[-1] :].mean() < 20.0
    muted = sum(len(recording.observations[k]) for k in still[5:])
    assert backend.counts["muted_standing_still"] == pytest.approx(muted, rel=0.02)
    assert fates(backend.counts) == backend.counts["observations"]


@pytest.mark.parametrize("name", ["robot", "car"])
def test_slowing_down_without_a_detector_of_standstill_does_not_diverge(name: str) -> None:
    recording = record(name, 0, 14.0, stops_s=((9.0, 14.0),))
    result = run(msckf(recording), recording, 0)
    assert result.position_error[-1] < 1.0


@pytest.mark.parametrize(("window", "share"), [(3, 0.0), (12, 0.4)])
def test_every_observation_has_one_fate(window: int, share: float) -> None:
    class Spy(Msckf):
        used = 0

        def _count(self, sightings: Sightings, tracks: BoolArray, fate: str) -> None:
            super()._count(sightings, tracks, fate)
            assert sightings.view.max(initial=0) < len(self._state)
            if fate == "used":
                self.used += int(sightings.lengths[tracks].sum())

    recording = record("robot", 2, 12.0, outlier_share=0.1)
    backend = msckf(recording, Spy, window=window)
    result = run(backend, recording, 2)
    counts = backend.counts
    assert counts["observations"] == sum(len(o) for o in recording.observations)
    assert fates(counts) == counts["observations"]
    assert isinstance(backend, Spy)
    assert counts["used"] == backend.used > share * counts["observations"]
    assert counts["rejected_outlier"] + counts.get("rejected_chi_square", 0) > 50
    assert window == 3 or result.position_error.max() < 1.0
    np.testing.assert_array_equal(result.smoothed.stamps_ns, recording.image_stamps_ns)
    assert {len(e.window) for e in result.estimates[window:]} == {window}


def test_poses_that_leave_the_window_are_better_than_the_newest() -> None:
    recording = record("robot", 2, 20.0)
    result = run(msckf(recording), recording, 2)
    smoothed = result.smoothed.T_world_imu[:, :3, 3] - recording.T_world_imu[:, :3, 3]
    assert np.sqrt((smoothed**2).sum(axis=1).mean()) < 1.1 * result.position_rmse


def test_images_without_features_and_broken_tracks_are_survived() -> None:
    recording = record("robot", 3, 12.0)
    clean = run(msckf(recording), recording, 3)
    rng = np.random.default_rng(0)

    def holed(k: int, seen: Observations) -> Observations:
        keep = rng.random(len(seen)) < (0.0 if 40 <= k < 46 or k == 70 else 0.9)
        return replace(
            seen, ids=seen.ids[keep], pixels=seen.pixels[keep], normalized=seen.normalized[keep]
        )

    observations = [holed(k, seen) for k, seen in enumerate(recording.observations)]
    broken = replace(recording, observations=observations)
    backend = msckf(broken)
    result = run(backend, broken, 3)
    assert result.position_error.max() < 2.0 * clean.position_error.max() + 0.1
    assert fates(backend.counts) == backend.counts["observations"]


@pytest.mark.parametrize(("gap", "at_once"), [(8, False), (15, True)])
def test_tracks_that_bridge_more_than_a_second_are_used_at_once(gap: int, at_once: bool) -> None:
    class Spy(Msckf):
        ending_now = 0

        def _correct(self, due: Sightings, *, still: bool) -> None:
            stamps = self._state.stamps_ns
            if len(stamps) > 1 and stamps[-1] - stamps[-2] > 5 * 10**8:
                last = np.maximum.reduceat(due.view, due.starts)
                self.ending_now = int((last == len(stamps) - 1).sum())
            super()._correct(due, still=still)

    whole = record("robot", 3, 12.0)
    kept = np.r_[0:60, 60 + gap : len(whole.observations)]
    recording = replace(
        whole,
        image_stamps_ns=whole.image_stamps_ns[kept],
        observations=[whole.observations[k] for k in kept],
        T_world_imu=whole.T_world_imu[kept],
        velocity=whole.velocity[kept],
        gyro_bias=whole.gyro_bias[kept],
        accel_bias=whole.accel_bias[kept],
        still=whole.still[kept],
    )
    backend = msckf(recording, Spy)
    result = run(backend, recording, 3)
    bridging = np.intersect1d(recording.observations[59].ids, recording.observations[60].ids)
    assert len(bridging) > 5
    assert isinstance(backend, Spy)
    assert (backend.ending_now >= len(bridging)) == at_once
    assert fates(backend.counts) == backend.counts["observations"]
    assert result.position_error.max() < 1.0


@pytest.mark.parametrize("fej", [False, True])
def test_result_does_not_depend_on_where_the_world_begins(fej: bool) -> None:
    recording = record("robot", 3, 12.0)
    moved = recording.T_world_imu.copy()
    moved[:, :3, 3] += [1000.0, -700.0, 30.0]
    far = replace(recording, T_world_imu=moved)
    here = run(msckf(recording, fej=fej), recording, 3)
    there = run(msckf(far, fej=fej), far, 3)
    np.testing.assert_allclose(there.errors, here.errors, atol=1e-6)


def test_two_runs_are_the_same_to_the_last_bit() -> None:
    recording = record("car", 4, 8.0)
    first, second = (run(msckf(recording), recording, 4) for _ in range(2))
    for a, b in zip(first.estimates, second.estimates, strict=True):
        np.testing.assert_array_equal(a.state.T_world_imu, b.state.T_world_imu)
        np.testing.assert_array_equal(a.covariance, b.covariance)
    np.testing.assert_array_equal(first.smoothed.T_world_imu, second.smoothed.T_world_imu)


def everything_behind(seen: Observations) -> Observations:
    return replace(seen, normalized=-5.0 * seen.normalized)


def everything_at_one_place(seen: Observations) -> Observations:
    return replace(seen, normalized=np.zeros_like(seen.normalized))


@pytest.mark.parametrize("fault", [everything_behind, everything_at_one_place])
def test_absurd_tracks_are_counted_and_harmless(
    fault: Callable[[Observations], Observations],
) -> None:
    recording = record("robot", 5, 6.0)
    broken = replace(recording, observations=[fault(o) for o in recording.observations])
    backend = msckf(broken)
    result = run(backend, broken, 5)
    assert len(result.estimates) == 60
    assert backend.counts.get("used", 0) < 0.05 * backend.counts["observations"]
    assert fates(backend.counts) == backend.counts["observations"]


@pytest.mark.parametrize("value", [1e5, np.nan])
def test_absurd_imu_ends_the_run_with_the_contracts_error(value: float) -> None:
    recording = record("car", 5, 5.0)
    accel = recording.imu.accel.copy()
    accel[250:] = value
    broken = replace(recording, imu=ImuBatch(recording.imu.stamps_ns, recording.imu.gyro, accel))
    with pytest.raises(EstimatorError, match="diverged") as caught:
        run(msckf(broken), broken, 5)
    assert recording.image_stamps_ns[20] <= caught.value.stamp_ns <= recording.image_stamps_ns[-1]


def test_images_of_the_demo_from_standstill_to_the_end(short_demo: Path) -> None:
    config = override(load_config(), {"dataset.path": str(short_demo), "backend.kind": "msckf"})
    sequence = open_sequence(config.dataset)
    result = run_sequence(sequence, config)
    assert result.status == "done"
    assert sequence.truth is not None
    found = evaluate(
        result.estimate, sequence.truth.trajectory,
        frames_total=result.frames_total, config=config.evaluation,
    )  # fmt: skip
    assert found.accuracy is not None
    ate = found.accuracy.ate_m["yaw_pos"]
    assert ate is not None and ate.rmse < 0.08  # of 3.9 m; the scale is not yet known well
    stages = {name for row in result.timing for name in row}
    inner = {"triangulate", "linearize", "gate", "solve"}
    assert {f"update.{name}" for name in inner} | {"propagate", "update"} <= stages
