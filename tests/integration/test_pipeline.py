"""Whole recordings through ``run_sequence``: what is survived, what ends a run, what repeats."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from demo_variants import IMU, TRUTH, Rows, ate_m, kinds, opened, settings, spoilt

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.errors import DataError
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.simulation.demo import DemoParameters, demo_trajectory
from p2gd_fgo.simulation.imu import synthesize_imu
from p2gd_fgo.types import NANOSECONDS, Estimate, Image, ImuBatch, Trajectory, Truth, Waiting

GIVEN = {"initialization__kind": "given"}


@pytest.fixture(scope="module")
def demo(short_demo: Path) -> AslSequence:
    return opened(short_demo)


@pytest.fixture(scope="module")
def truth(demo: AslSequence) -> Trajectory:
    assert demo.truth is not None
    return demo.truth.trajectory


class Watcher:
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.begun: list[Config] = []
        self.frames: list[tuple[int, type, int]] = []

    def begin(self, sequence: Sequence, config: Config) -> None:
        self.begun.append(config)

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        self.frames.append((index, type(outcome), odometry.features))


@pytest.fixture(scope="module")
def watched(demo: AslSequence) -> tuple[RunResult, Watcher]:
    watcher = Watcher()
    return run_sequence(demo, settings(), watcher), watcher


def assert_same(a: RunResult, b: RunResult) -> None:
    np.testing.assert_array_equal(a.estimate.stamps_ns, b.estimate.stamps_ns)
    np.testing.assert_array_equal(a.estimate.T_world_imu, b.estimate.T_world_imu)
    np.testing.assert_array_equal(a.covariances, b.covariances)
    np.testing.assert_array_equal(a.smoothed.T_world_imu, b.smoothed.T_world_imu)
    assert a.counts == b.counts


# -- a run ---------------------------------------------------------------------------------------


def test_a_run_from_its_first_image_to_its_last(
    watched: tuple[RunResult, Watcher], truth: Trajectory
) -> None:
    result, _ = watched
    assert (result.status, result.reason) == ("done", None)
    assert (len(result.estimate), result.frames_total) == (61, 71)
    assert ate_m(result, truth) < 0.04
    np.testing.assert_array_equal(result.smoothed.stamps_ns, result.estimate.stamps_ns)
    assert result.covariances.shape == (61, 15, 15)
    for values in (result.velocities, result.gyro_biases, result.accel_biases):
        assert values.shape == (61, 3)
    assert kinds(result)[0] == "started" and set(kinds(result)[1:]) == {"standstill"}
    assert result.counts["images"] == 71
    assert result.counts["features"] > 71 * 80
    assert result.config.frontend.max_track_length == 20


def test_every_image_is_timed_decoding_apart(watched: tuple[RunResult, Watcher]) -> None:
    result, _ = watched
    assert len(result.timing) == len(result.timing_stamps_ns) == 71
    inside = {"propagate", "track", "distribute", "extract"}
    for row in result.timing:
        assert row.keys() >= {"decode", "frame"} | inside
        assert sum(row[name][0] for name in inside) <= row["frame"][0] + 0.1
    assert "update" not in result.timing[0]
    later = result.timing[-1]
    parts = {"update.linearize", "update.solve", "update.marginalize"}
    assert later.keys() >= {"update"} | parts
    assert later["update"][0] <= later["frame"][0]
    assert 0.0 < sum(later[name][0] for name in parts) <= later["update"][0] + 0.1


def test_the_observer_sees_every_image(watched: tuple[RunResult, Watcher]) -> None:
    result, watcher = watched
    assert watcher.begun == [result.config]
    assert [index for index, _, _ in watcher.frames] == list(range(71))
    assert [kind for _, kind, _ in watcher.frames] == [Waiting] * 10 + [Estimate] * 61
    assert min(features for _, _, features in watcher.frames) > 50


def test_a_rerun_is_the_same_to_the_bit_and_another_seed_is_not(
    demo: AslSequence, watched: tuple[RunResult, Watcher]
) -> None:
    result, _ = watched
    assert_same(run_sequence(demo, settings()), result)
    other = run_sequence(demo, settings(runtime__seed=1))
    assert np.abs(other.estimate.T_world_imu - result.estimate.T_world_imu).max() > 1e-6


def test_the_given_start_begins_at_the_first_image(demo: AslSequence, truth: Trajectory) -> None:
    result = run_sequence(demo, settings(**GIVEN))
    assert len(result.estimate) == result.frames_total == 71
    assert ate_m(result, truth) < 0.04
    noisy = run_sequence(demo, settings(**GIVEN, initialization__given__noise=True))
    assert np.abs(noisy.estimate.T_world_imu[0] - result.estimate.T_world_imu[0]).max() > 1e-4


# -- survived ------------------------------------------------------------------------------------


def test_images_that_are_missing_or_broken(
    short_demo: Path, truth: Trajectory, tmp_path: Path
) -> None:
    folder = spoilt(short_demo, tmp_path)
    paths = opened(folder).image_paths
    paths[0].unlink()
    paths[30].write_bytes(paths[30].read_bytes()[:1000])
    paths[40].write_bytes(b"")
    paths[41].write_text("no image")
    for path in paths[50:55]:  # half a second
        path.unlink()
    sequence = opened(folder)
    result = run_sequence(sequence, settings())
    assert result.status == "done"
    # The first image is among the missing, so the second of standstill ends an image later.
    assert (len(result.estimate), result.frames_total) == (71 - 11 - 8, 71)
    assert kinds(result).count("image_unreadable") == result.counts["images_unreadable"] == 9
    assert all(path.name in str(result.events) for path in (paths[0], paths[30], paths[54]))
    assert result.counts["images"] == len(result.timing) == 62
    lost = sequence.image_stamps_ns[[30, 40, 41, 50, 54]]
    assert not np.isin(lost, result.estimate.stamps_ns).any()
    assert ate_m(result, truth) < 0.06


def test_images_before_and_after_the_imu_and_repeated_samples(
    short_demo: Path, truth: Trajectory, tmp_path: Path
) -> None:
    def shorten(rows: Rows) -> Rows:
        kept = rows[110:-90]  # 0.45 s after the first image to 0.35 s before the last
        return [*kept[:500], kept[499], *kept[500:]]

    sequence = opened(spoilt(short_demo, tmp_path, {IMU: shorten}))
    watcher = Watcher()
    result = run_sequence(sequence, settings(), watcher)
    assert result.status == "done"
    assert {"imu_duplicates", "images_outside_imu"} <= set(kinds(result))
    assert [index for index, _, _ in watcher.frames] == list(range(5, 67))
    assert (len(result.estimate), result.frames_total) == (62 - 10, 71)
    assert ate_m(result, truth) < 0.06


def test_truth_that_covers_a_part(short_demo: Path, truth: Trajectory, tmp_path: Path) -> None:
    def late(rows: Rows) -> Rows:
        return rows[620:]  # from 3 s on

    sequence = opened(spoilt(short_demo, tmp_path, {TRUTH: late}))
    result = run_sequence(sequence, settings(**GIVEN))
    assert "truth_partial" in kinds(result)
    assert result.status == "done"
    assert (len(result.estimate), len(result.timing)) == (41, 71)
    at_start = truth.T_world_imu[np.searchsorted(truth.stamps_ns, result.estimate.stamps_ns[0])]
    np.testing.assert_allclose(result.estimate.T_world_imu[0], at_start, atol=2e-3)
    # In motion from the first image on: over other routes of the demo 0.01 to 0.08 m.
    assert ate_m(result, truth) < 0.06


def test_without_truth_the_static_start_runs(
    short_demo: Path, watched: tuple[RunResult, Watcher], tmp_path: Path
) -> None:
    sequence = opened(spoilt(short_demo, tmp_path, {TRUTH: None}))
    assert sequence.truth is None
    result = run_sequence(sequence, settings())
    assert "truth_missing" in kinds(result)
    assert_same(result, watched[0])


def test_images_off_the_grid_of_a_slow_imu(demo: AslSequence, truth: Trajectory) -> None:
    """100 Hz, each image some 3 to 5 ms away from the nearest sample."""
    trajectory = demo_trajectory(DemoParameters(duration_s=7.0))
    first, last = int(demo.image_stamps_ns[0]), int(demo.image_stamps_ns[-1])
    stamps = np.arange(first - 106_700_000, last + 100_000_000, 9_987_654)
    nearest = np.abs(stamps[:, None] - demo.image_stamps_ns).min(axis=0)
    assert nearest.max() > 4_000_000
    imu = synthesize_imu(
        trajectory, stamps, demo.calibration.imu_noise, np.random.default_rng(0)
    ).batch
    result = run_sequence(replace(demo, imu=imu), settings())
    assert result.status == "done"
    np.testing.assert_array_equal(result.estimate.stamps_ns, demo.image_stamps_ns[10:])
    assert ate_m(result, truth) < 0.06


@pytest.mark.parametrize("rate_hz", [20, 40])
def test_the_static_start_of_a_fast_camera(demo: AslSequence, rate_hz: int) -> None:
    """20 images of the window span less than the second that the start asks for."""
    factor = rate_hz // 10
    first = int(demo.image_stamps_ns[0])
    sequence = replace(
        demo,
        image_stamps_ns=first + NANOSECONDS // rate_hz * np.arange(2 * rate_hz),
        image_paths=tuple(np.repeat(np.array(demo.image_paths), factor)),
    )
    result = run_sequence(sequence, settings())
    assert result.status == "done", result.reason
    started = int(result.estimate.stamps_ns[0]) - first
    assert 0.9 * NANOSECONDS <= started <= 1.6 * NANOSECONDS
    assert np.abs(result.estimate.T_world_imu[:, :3, 3]).max() < 5e-3


# -- ended ---------------------------------------------------------------------------------------


def test_a_back_end_that_diverges_keeps_what_it_has(demo: AslSequence) -> None:
    imu = demo.imu
    broken = imu.stamps_ns > demo.image_stamps_ns[40]
    accel = np.where(broken[:, None], 60.0 * imu.accel, imu.accel)
    watcher = Watcher()
    sequence = replace(demo, imu=ImuBatch(imu.stamps_ns, imu.gyro, accel))
    result = run_sequence(sequence, settings(), watcher)
    assert result.status == "failed"
    assert result.reason is not None and "diverged" in result.reason
    assert kinds(result).count("diverged") == 1
    kept = len(result.estimate)
    assert 31 <= kept < 61
    assert len(result.covariances) == len(result.velocities) == kept
    assert np.isfinite(result.estimate.T_world_imu).all()
    assert watcher.frames[-1][0] == len(result.timing) - 1 == kept + 9


def test_a_static_start_in_motion_is_refused(short_demo: Path) -> None:
    sequence = opened(short_demo, start_s=4.0)
    result = run_sequence(sequence, settings(initialization__static__max_wait_s=2.0))
    assert result.status == "failed"
    assert result.reason is not None
    for part in ("no standstill of 1 s in 2.1 s", "image motion", "(threshold 0.5 px"):
        assert part in result.reason
    assert "start_refused" in kinds(result)
    assert len(result.estimate) == len(result.smoothed) == len(result.covariances) == 0
    assert result.start_note is None
    assert result.covariances.shape == (0, 15, 15)


def test_a_recording_too_short_to_start_is_refused_at_its_end(short_demo: Path) -> None:
    result = run_sequence(opened(short_demo, duration_s=0.5), settings())
    assert result.status == "failed" and "start_refused" in kinds(result)
    assert len(result.timing) == 6


def test_a_given_start_without_overlapping_truth_is_refused_before_the_run(
    demo: AslSequence, truth: Trajectory
) -> None:
    watcher = Watcher()
    later = Truth(Trajectory(truth.stamps_ns + 3600 * NANOSECONDS, truth.T_world_imu))
    with pytest.raises(DataError, match=r"no image of .* within the truth's time, 3592\.9 s apart"):
        run_sequence(replace(demo, truth=later), settings(**GIVEN), watcher)
    with pytest.raises(DataError, match="no truth"):
        run_sequence(replace(demo, truth=None), settings(**GIVEN), watcher)
    assert not watcher.begun


def test_a_mask_of_another_size_is_refused_before_the_run(demo: AslSequence) -> None:
    mask = demo.image_paths[0].parent.parent.parent / "none.png"
    watcher = Watcher()
    with pytest.raises(DataError, match=r"none\.png: no such image"):
        run_sequence(demo, settings(dataset__mask=str(mask)), watcher)
    assert not watcher.begun
