"""Faults in the middle of a run: survived by both back ends, and told."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from demo_variants import ate_m, kinds, opened, settings

from p2gd_fgo.datasets import Sequence
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.evaluation.alignment import align_yaw_pos
from p2gd_fgo.evaluation.consistency import nees
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.simulation import faults
from p2gd_fgo.types import NANOSECONDS, Trajectory

BEGIN_S = 3.5  # 1.5 s after the standstill's end; the clip lasts 7 s
LUCK_M = 0.02  # 0.5 % of the way: what the clip's clean runs have in the mean
SIGMA_TO_COVER = 16.3  # chi-square of 3 degrees of freedom, one in a thousand

FAULTS: dict[str, tuple[str, Callable[[Sequence], Sequence]]] = {
    "images missing for 0.5 s": ("image_gap", lambda s: faults.without_images(s, BEGIN_S, 0.5)),
    "images missing for 2.5 s": ("image_gap", lambda s: faults.without_images(s, BEGIN_S, 2.5)),
    "black images": ("image_blank", lambda s: faults.black_images(s, BEGIN_S, 1.0)),
    "frozen image": ("image_frozen", lambda s: faults.frozen_image(s, BEGIN_S, 2.0)),
    "imu hole": ("imu_gap_bridged", lambda s: faults.imu_hole(s, BEGIN_S, 1.0)),
    "duplicates": (
        "imu_duplicates",
        lambda s: faults.doubled_stamps(s, 0.3, np.random.default_rng(0)),
    ),
    "brighter": ("brightness_jump", lambda s: faults.brightness_jump(s, BEGIN_S, 1.0, 1.8)),
    "truck": ("many_tracks_rejected", lambda s: faults.passing_truck(s, BEGIN_S, 2.0)),
}


@pytest.fixture(scope="module")
def demo(short_demo: Path) -> AslSequence:
    return opened(short_demo)


@pytest.fixture(scope="module")
def truth(demo: AslSequence) -> Trajectory:
    assert demo.truth is not None
    return demo.truth.trajectory


@pytest.fixture(scope="module", params=["smoother", "msckf"])
def clean(request: pytest.FixtureRequest, demo: AslSequence) -> RunResult:
    return run_sequence(demo, settings(backend__kind=request.param))


def position_nees(result: RunResult, truth: Trajectory) -> float:
    """The worst of the run, first poses brought together."""
    T, reference = result.estimate.T_world_imu, interpolate(truth, result.estimate.stamps_ns)
    aligned = align_yaw_pos(T[:1], reference[:1]).apply(T)
    errors = (aligned - reference)[:, :3, 3]
    return float(nees(errors, result.covariances[:, 3:6, 3:6]).max())


def test_a_healthy_run_has_no_trouble(clean: RunResult) -> None:
    assert set(kinds(clean)) == {"started", "standstill"}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_survived_and_told(
    name: str, clean: RunResult, demo: AslSequence, truth: Trajectory
) -> None:
    kind, spoil = FAULTS[name]
    faulty = spoil(demo)
    result = run_sequence(faulty, clean.config)
    assert result.status == "done"
    assert len(result.estimate) > 0.5 * len(clean.estimate)
    for values in (result.estimate.T_world_imu, result.covariances, result.smoothed.T_world_imu):
        assert np.isfinite(values).all()
    (event, *_) = [e for e in result.events if e.kind == kind]
    begin_ns = int(demo.image_stamps_ns[0]) + round(BEGIN_S * NANOSECONDS)
    if kind not in ("imu_duplicates", "many_tracks_rejected"):
        late_s = (event.stamp_ns - begin_ns) / NANOSECONDS
        assert 0.0 <= late_s < (2.8 if kind == "image_gap" else 0.2)
    assert ate_m(result, truth) < 3.0 * max(ate_m(clean, truth), LUCK_M)
    assert position_nees(result, truth) < SIGMA_TO_COVER


def test_a_frozen_image_is_no_standstill(clean: RunResult, demo: AslSequence) -> None:
    result = run_sequence(faults.frozen_image(demo, BEGIN_S, 2.0), clean.config)
    assert kinds(result).count("standstill") == kinds(clean).count("standstill") == 1
    frozen = np.flatnonzero(result.tracks.counts == 0)
    assert len(frozen) == 20  # all but the first of them were used for nothing


def test_a_standstill_outlives_blank_images(demo: AslSequence, clean: RunResult) -> None:
    """The IMU notices no departure, so there was none."""
    result = run_sequence(faults.black_images(demo, 1.3, 0.4), clean.config)
    (still,) = [e for e in result.events if e.kind == "standstill"]
    (expected,) = [e for e in clean.events if e.kind == "standstill"]
    assert still.stamp_ns == expected.stamp_ns
    assert still.data["duration_s"] == pytest.approx(float(expected.data["duration_s"]), abs=0.11)


def test_the_covariance_grows_over_an_imu_hole(
    clean: RunResult, demo: AslSequence, truth: Trajectory
) -> None:
    """Without images inside, so that nothing but the policy covers the error."""
    blind = faults.black_images(faults.imu_hole(demo, BEGIN_S, 1.0), BEGIN_S - 0.05, 1.1)
    result = run_sequence(blind, clean.config)
    end_ns = int(demo.image_stamps_ns[0]) + round((BEGIN_S + 1.0) * NANOSECONDS)
    k = int(np.searchsorted(result.estimate.stamps_ns, end_ns))
    sigma = np.sqrt(np.diagonal(result.covariances, axis1=1, axis2=2))
    assert sigma[k, 3:6].max() > 1.0  # 2 m/s² for 1 s
    assert position_nees(result, truth) < SIGMA_TO_COVER


@pytest.fixture(scope="module")
def filtered(demo: AslSequence) -> RunResult:
    return run_sequence(demo, settings(backend__kind="msckf"))


@pytest.mark.parametrize("offset_s", [0.06, -0.06])
def test_a_time_offset_is_taken_out_with_its_sign(
    offset_s: float, demo: AslSequence, truth: Trajectory, filtered: RunResult
) -> None:
    """t_imu = t_cam + offset: images stamped too early have a positive one."""
    calibrated = settings(dataset__time_offset_s=offset_s, backend__kind="msckf")
    wrong = settings(dataset__time_offset_s=-offset_s, backend__kind="msckf")
    shifted = faults.shifted_stamps(demo, -offset_s)
    right = run_sequence(shifted, calibrated)
    np.testing.assert_array_equal(right.estimate.T_world_imu, filtered.estimate.T_world_imu)
    # Everything that a run says is on the IMU's clock, whatever the camera's says.
    for name in ("timing_stamps_ns", "estimate.stamps_ns", "tracks.stamps_ns"):
        one, other = (attrgetter(name)(result) for result in (right, filtered))
        np.testing.assert_array_equal(one, other)
    assert [e.stamp_ns for e in right.events] == [e.stamp_ns for e in filtered.events]
    assert ate_m(run_sequence(shifted, wrong), truth) > 2.0 * ate_m(filtered, truth)
