"""Trajectories of other programs as records of runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.evaluation.external import external_path, external_record
from p2gd_fgo.evaluation.measures import measure
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.trajectory_files import read_trajectory, write_tum
from p2gd_fgo.types import Trajectory


def straight(hz: float, seconds: float, scale: float = 1.0, start_s: float = 0.0) -> Trajectory:
    t = start_s + np.arange(round(hz * seconds)) / hz
    p = scale * np.stack([5.0 * t, np.sin(t), 0 * t], axis=1)
    return Trajectory(np.round(t * 1e9).astype(np.int64), from_rotation_translation(np.eye(3), p))


def test_it_is_judged_as_a_run_and_survives_the_file_of_records(tmp_path: Path) -> None:
    write_tum(tmp_path / "peer.tum", straight(10, 20, 1.05))
    record = external_record(
        "Peer", tmp_path / "peer.tum", straight(100, 30), sequence="s", frames_total=250,
        axes={"backend": "Peer", "distribution": "its own"}, group="cars",
    )  # fmt: skip
    assert record.status == "done" and record.route == "s" and record.group == "cars"
    assert record.metrics["completeness"] == pytest.approx(0.8)
    assert record.metrics["scale"] == pytest.approx(1 / 1.05, rel=1e-3)
    assert RunRecord.from_json(record.to_json()) == record
    assert np.isnan(measure("ate").of(record))  # 80 % of the images: not whole
    whole = external_record("Peer", tmp_path / "peer.tum", straight(100, 30), sequence="s")
    assert measure("rte_10").of(whole) == pytest.approx(5.0, rel=0.02)
    assert (
        whole.key != external_record("B", tmp_path / "peer.tum", straight(9, 30), sequence="s").key
    )


def test_more_poses_than_images_say_nothing_of_completeness(tmp_path: Path) -> None:
    write_tum(tmp_path / "peer.tum", straight(100, 20))
    record = external_record(
        "Peer", tmp_path / "peer.tum", straight(100, 30), sequence="s", frames_total=200
    )
    assert record.metrics["completeness"] is None


def test_a_pose_for_every_imu_sample_does_not_hide_an_early_end(tmp_path: Path) -> None:
    write_tum(tmp_path / "peer.tum", straight(100, 20))
    write_tum(tmp_path / "slow.tum", straight(5, 40))
    truth, images = straight(100, 40), straight(10, 40).stamps_ns
    found = [
        external_record(
            "Peer", tmp_path / name, truth, sequence="s", image_stamps_ns=images
        )
        for name in ("peer.tum", "slow.tum")
    ]  # fmt: skip
    early, slow = (record.metrics["completeness"] for record in found)
    assert early == pytest.approx(0.5, abs=0.01) and np.isnan(measure("ate").of(found[0]))
    assert slow == 1.0 and measure("ate").of(found[1]) == pytest.approx(0.0, abs=1e-6)


def test_another_time_is_a_failed_run_and_no_file_an_error(tmp_path: Path) -> None:
    write_tum(tmp_path / "peer.tum", straight(10, 20, start_s=1000.0))
    record = external_record("Peer", tmp_path / "peer.tum", straight(100, 30), sequence="s")
    assert record.status == "failed" and "truth at their time" in str(record.reason)
    assert RunRecord.from_json(record.to_json()) == record
    with pytest.raises(DataError, match=r"no such trajectory"):
        external_record("Peer", tmp_path / "none.tum", straight(100, 30), sequence="s")


def test_places_are_filled_in() -> None:
    assert external_path("a/{sequence}_{seed}.tum", sequence="kitti", seed=3) == Path(
        "a/kitti_3.tum"
    )
    for template in ("{nothing}.tum", "{", "{sequence.x}"):
        with pytest.raises(ConfigError, match=r"\{sequence\}"):
            external_path(template, sequence="kitti")


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("euroc_mh01", {"ate": 0.00778, "ate_origin": 0.0132, "ate_sim3": 0.00746, "are": 0.452}),
        ("kitti_0039", {"ate": 5.348, "ate_origin": 8.764, "ate_sim3": 1.412, "are": 1.506}),
    ],
)
def test_a_peer_gets_its_known_figures(
    recordings: Path, name: str, expected: dict[str, float]
) -> None:
    truth = read_trajectory(recordings / name / "mav0" / "state_groundtruth_estimate0" / "data.csv")
    template = str(recordings / "peers" / "openvins" / "{sequence}.tum")
    record = external_record(
        "OpenVINS", external_path(template, sequence=name), truth, sequence=name
    )
    found = {key: measure(key).of(record) for key in expected}
    assert found == pytest.approx(expected, rel=1e-3)
