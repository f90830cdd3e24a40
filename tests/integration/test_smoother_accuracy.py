"""Without noise the smoother is exact, with noise it is consistent, and a fault shows."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from smoother_runs import SETTLED, record, run, smoother

from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.backends.smoother.tracks import Track


class Dropping(Smoother):
    """The fault: tracks that see the oldest image are dropped instead of folded."""

    def _fold(self, tracks: list[Track], values: gtsam.Values) -> list[Track]:
        return []


@pytest.mark.parametrize("name", ["car", "robot"])
def test_exact_measurements_give_the_exact_route(name: str) -> None:
    recording = record(name, 0, 30.0, noise=False)
    result = run(smoother(recording), recording, None)
    assert len(result.estimates) == 300
    assert result.position_error.max() < 1e-3


def test_exact_when_images_lie_off_the_imu_samples() -> None:
    """Half a sample off, at up to 12 m/s."""
    recording = record("car", 1, 15.0, noise=False, image_offset_ns=5_000_000)
    result = run(smoother(recording), recording, None)
    assert result.position_error.max() < 1e-3


@pytest.mark.parametrize("name", ["car", "robot"])
def test_covariance_says_how_large_the_errors_are(name: str) -> None:
    """Pose NEES of five drives with errors drawn from the covariances, 6 degrees of freedom."""
    means = []
    for seed in range(5):
        recording = record(name, seed, 14.0)
        result = run(smoother(recording), recording, seed)
        means.append(result.nees[SETTLED:].mean())
    assert 4.0 < np.mean(means) < 9.0, means


def test_observations_dropped_instead_of_folded_are_noticed() -> None:
    errors = {Smoother: 0.0, Dropping: 0.0}
    recording = record("car", 0, 20.0)
    for kind in errors:
        backend = smoother(recording, kind)
        errors[kind] = run(backend, recording, 0).position_rmse
        assert (backend.counts.get("marginalized", 0) > 0) == (kind is Smoother)
    assert errors[Dropping] > 3.0 * errors[Smoother]
