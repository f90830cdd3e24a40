"""The whole judgement: errors with known answers, evo's numbers, holes, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from evo.core import metrics
from evo.core.trajectory import PosePath3D
from evo.tools import file_interface

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.association import common_poses
from p2gd_fgo.evaluation.evaluate import error_series, evaluate
from p2gd_fgo.evaluation.evo_bridge import write_result
from p2gd_fgo.evaluation.trajectory_errors import relative
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.trajectory_files import read_trajectory
from p2gd_fgo.types import FloatArray, IntArray, Trajectory

CONFIG = EvaluationConfig()
START_NS = 1_403_636_584_000_000_000


def circle(stamps_ns: IntArray, scale: float = 1.0) -> Trajectory:
    """1 m/s round a circle of 10 m radius that climbs and falls by 1 m."""
    s = (stamps_ns - START_NS) * 1e-9
    p = np.stack([10 * np.cos(s / 10), 10 * np.sin(s / 10), np.sin(s / 5)], axis=1)
    yaw = np.stack([np.zeros_like(s), np.zeros_like(s), s / 10], axis=1)
    return Trajectory(stamps_ns, from_rotation_translation(so3.exp(yaw), scale * p))


def stamps(hz: float, seconds: float, offset_ns: int = 0) -> IntArray:
    count = round(hz * seconds) + 1
    return START_NS + offset_ns + np.round(np.arange(count) * 1e9 / hz).astype(np.int64)


TRUTH = circle(stamps(100, 62, -1_000_000_000))


def test_truth_is_interpolated_so_a_perfect_estimate_is_perfect() -> None:
    result = evaluate(circle(stamps(10, 60, 1234)), TRUTH, frames_total=601, config=CONFIG)
    accuracy = result.accuracy
    assert accuracy is not None
    for kind in ("yaw_pos", "se3", "sim3", "origin"):
        ate, are = accuracy.ate_m[kind], accuracy.are_deg[kind]
        assert ate is not None and ate.max < 5e-5
        assert are is not None and are.max < 5e-3
    assert accuracy.scale == pytest.approx(1.0, abs=1e-5)
    assert [entry.length_m for entry in accuracy.rte] == [1, 2, 10, 50]
    assert result.completeness == 1.0
    assert result.duration_s == pytest.approx(60.0)
    assert accuracy.path_length_m == pytest.approx(60.6, abs=0.1)


def test_a_scale_error_has_its_known_consequences() -> None:
    result = evaluate(circle(stamps(10, 60), 1.1), TRUTH, frames_total=None, config=CONFIG)
    accuracy = result.accuracy
    assert accuracy is not None
    assert accuracy.scale == pytest.approx(1 / 1.1, rel=1e-4)
    sim3 = accuracy.ate_m["sim3"]
    assert sim3 is not None and sim3.rmse < 1e-3
    # Chords of pieces of 1 and 2 m are as good as their arcs: 10 % scale is 10 % of length.
    assert [entry.percent for entry in accuracy.rte[:2]] == pytest.approx([10.0, 10.0], rel=0.02)
    assert accuracy.final_drift.position_m == pytest.approx(
        0.1 * np.linalg.norm(np.diff(circle(stamps(1 / 60, 60)).T_world_imu[:, :3, 3], axis=0)),
        rel=1e-3,
    )


def test_relative_errors_equal_those_of_evo() -> None:
    rng = np.random.default_rng(5)
    reference = circle(stamps(10, 60)).T_world_imu
    twist = so3.exp(np.cumsum(rng.normal(scale=2e-3, size=(len(reference), 3)), axis=0))
    drift = np.cumsum(rng.normal(scale=5e-3, size=(len(reference), 3)), axis=0)
    estimate = from_rotation_translation(reference[:, :3, :3] @ twist, reference[:, :3, 3] + drift)
    ours = relative(estimate, reference, (1.0, 10.0, 50.0), 0.1)
    pair = (PosePath3D(poses_se3=list(reference)), PosePath3D(poses_se3=list(estimate)))
    assert len(ours) == 3
    for entry in ours:
        for relation, value in (
            (metrics.PoseRelation.translation_part, entry.rmse_m),
            (metrics.PoseRelation.rotation_angle_deg, entry.rre_deg),
        ):
            rpe = metrics.RPE(
                relation, entry.length_m, metrics.Unit.meters, 0.1, True, pairs_from_reference=True
            )
            rpe.process_data(pair)
            assert value == pytest.approx(rpe.get_statistic(metrics.StatisticsType.rmse), abs=1e-9)
            assert entry.pairs == len(rpe.error)
        assert entry.percent == pytest.approx(100 * entry.rmse_m / entry.length_m)


def test_lengths_that_do_not_fit_are_absent() -> None:
    reference = circle(stamps(1, 9)).T_world_imu
    # A path of 9.5 m misses 10 m by less than the tolerance, but isn't 10 m long; and of poses
    # 1 m apart none are 0.3 m apart.
    assert relative(reference, reference, (0.3, 10.0, 100.0), 0.1) == ()


def test_holes_and_ends_of_truth_are_left_out() -> None:
    hole = (TRUTH.stamps_ns < START_NS + 20e9) | (TRUTH.stamps_ns >= START_NS + 22e9)
    partial = Trajectory(TRUTH.stamps_ns[hole], TRUTH.T_world_imu[hole])
    estimate = circle(stamps(10, 80, -5_000_000_000))
    common = common_poses(estimate, partial)
    seconds = (common.stamps_ns - START_NS) / 1e9
    assert seconds.min() >= -1.0 and seconds.max() <= 61.0
    assert not ((seconds > 19.99) & (seconds < 22.0)).any()
    assert (seconds == 22.0).any()
    result = evaluate(estimate, partial, frames_total=1000, config=CONFIG)
    assert result.completeness == pytest.approx(0.801)
    assert result.truth_coverage == pytest.approx(len(common) / 801)


@pytest.mark.parametrize(
    ("estimate_stamps", "said"),
    [
        (stamps(10, 0.1), "only 2 of 2 estimated poses"),
        (stamps(10, 5, 10**12), "only 0 of 51 .* spans"),
        (stamps(10, 0)[:0], "only 0 of 0 .* no time"),
    ],
)
def test_too_few_common_poses_are_refused(estimate_stamps: IntArray, said: str) -> None:
    with pytest.raises(DataError, match=said):
        evaluate(circle(estimate_stamps), TRUTH, frames_total=10, config=CONFIG)


def test_standing_still_divides_by_nothing() -> None:
    still = np.tile(np.eye(4), (50, 1, 1))
    known = stamps(10, 4.9)
    noisy = still.copy()
    noisy[:, :3, 3] += 1e-3 * np.random.default_rng(0).normal(size=(50, 3))
    result = evaluate(
        Trajectory(known, noisy), Trajectory(known, still), frames_total=50, config=CONFIG
    )
    assert result.accuracy is not None
    ate = result.accuracy.ate_m["yaw_pos"]
    assert ate is not None and 5e-4 < ate.rmse < 3e-3
    assert result.accuracy.ate_m["se3"] is None and result.accuracy.scale is None
    assert result.accuracy.rte == () and result.ate_percent is None
    assert "NaN" not in json.dumps(result.to_json())
    with pytest.raises(DataError, match="sim3"):
        error_series(Trajectory(known, noisy), Trajectory(known, still), "sim3")


def test_json_has_the_same_keys_with_and_without_truth() -> None:
    estimate = circle(stamps(10, 60))
    full = evaluate(estimate, TRUTH, frames_total=700, config=CONFIG).to_json()
    bare = evaluate(estimate, None, frames_total=700, config=CONFIG).to_json()
    assert full.keys() == bare.keys()
    assert full["ate_m"].keys() == {"yaw_pos", "se3", "sim3", "origin"}
    assert full["ate_m"]["yaw_pos"].keys() == {"rmse", "mean", "median", "max"}
    assert full["rte"][0].keys() == {"length_m", "rmse_m", "percent", "rre_deg", "pairs"}
    assert bare["completeness"] == pytest.approx(601 / 700)
    assert bare["ate_m"] is None and bare["rte"] == []
    empty = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    none = evaluate(empty, None, frames_total=700, config=CONFIG)
    assert none.completeness == 0.0 and none.duration_s == 0.0


def test_series_agree_with_the_metrics_and_evo_reads_the_result(tmp_path: Path) -> None:
    estimate = circle(stamps(10, 60), 1.1)
    series = error_series(estimate, TRUTH, "yaw_pos")
    accuracy = evaluate(estimate, TRUTH, frames_total=601, config=CONFIG).accuracy
    assert accuracy is not None
    ate = accuracy.ate_m["yaw_pos"]
    assert ate is not None
    assert np.sqrt(np.mean(series.position_m**2)) == pytest.approx(ate.rmse)
    write_result(
        tmp_path / "r.zip", series.estimate, series.reference, alignment="yaw_pos", name="run"
    )
    loaded = file_interface.load_res_file(tmp_path / "r.zip", load_trajectories=True)
    assert loaded.stats["rmse"] == pytest.approx(ate.rmse, rel=1e-9)
    assert "yaw_pos" in loaded.info["title"] and loaded.info["est_name"] == "run"
    np.testing.assert_allclose(loaded.np_arrays["error_array"], series.position_m, atol=1e-9)
    assert loaded.trajectories["estimate"].num_poses == 601


def _peer(recordings: Path, name: str) -> tuple[Trajectory, Trajectory]:
    truth = recordings / name / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    estimate = recordings / "peers" / "openvins" / f"{name}.tum"
    return read_trajectory(estimate), read_trajectory(truth)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("euroc_mh01", [0.00778, 0.0132, 0.00746, 0.9925, 0.452]),
        ("kitti_0039", [5.348, 8.764, 1.412, 0.9462, 1.506]),
    ],
)
def test_peer_gets_its_known_absolute_errors(
    recordings: Path, name: str, expected: list[float]
) -> None:
    estimate, truth = _peer(recordings, name)
    found = evaluate(estimate, truth, frames_total=len(estimate), config=CONFIG).to_json()
    values = [found["ate_m"][kind]["rmse"] for kind in ("yaw_pos", "origin", "sim3")]
    values += [found["scale"], found["are_deg"]["yaw_pos"]["rmse"]]
    assert values == pytest.approx(expected, rel=1e-3)
    assert found["truth_coverage"] == 1.0


@pytest.mark.realdata
def test_peer_gets_its_known_relative_errors(recordings: Path) -> None:
    estimate, truth = _peer(recordings, "kitti_0039")
    common = common_poses(estimate, truth)
    lengths, expected = (10.0, 50.0, 100.0, 200.0), [10.4, 7.21, 6.88, 6.78]
    # The known values pair each pose with the first one beyond the length; evo takes the nearest.
    found = relative(common.estimate, common.reference, lengths, 0.1)
    assert [entry.percent for entry in found] == pytest.approx(expected, rel=0.02)
    beyond = [_percent_beyond(common.estimate, common.reference, length) for length in lengths]
    assert beyond == pytest.approx(expected, rel=1e-3)


def _percent_beyond(estimate: FloatArray, reference: FloatArray, length: float) -> float:
    steps = np.linalg.norm(np.diff(reference[:, :3, 3], axis=0), axis=1)
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    i = np.flatnonzero(distance + length <= distance[-1])
    j = np.searchsorted(distance, distance[i] + length)
    true, found = (np.linalg.inv(T[i]) @ T[j] for T in (reference, estimate))
    error = (np.linalg.inv(true) @ found)[:, :3, 3]
    return float(100 * np.sqrt(np.mean(np.sum(error**2, axis=1))) / length)
