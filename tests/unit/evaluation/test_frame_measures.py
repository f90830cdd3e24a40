"""What an image had to go on: counts by hand, far tracks by their distance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.frame_measures import far_tracks, read_frames
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.run_directory import RunDirectory
from p2gd_fgo.types import FloatArray, TrackRecord, Trajectory

T_IMU_CAM = from_rotation_translation(
    np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.1, 0.0, 0.2])
)


def drive(points: FloatArray, speed: float, frames: int = 14) -> tuple[TrackRecord, Trajectory]:
    """Straight on along x; every point (N, 3) in the world is seen in every image."""
    stamps = np.arange(frames) * 100_000_000
    p = np.stack([speed * stamps / 1e9, 0.0 * stamps, 0.0 * stamps], axis=1)
    poses = Trajectory(stamps, from_rotation_translation(np.eye(3), p))
    T = np.linalg.inv(poses.T_world_imu @ T_IMU_CAM)
    seen = np.einsum("fij,nj->fni", T[:, :3, :3], points) + T[:, None, :3, 3]
    ids = np.tile(np.arange(len(points)), frames)
    counts = np.full(frames, len(points))
    normalized = (seen[..., :2] / seen[..., 2:]).reshape(-1, 2)
    return TrackRecord(stamps, counts, counts + 3, ids, normalized), poses


@pytest.mark.parametrize("speed", [1.0, 10.0])
def test_far_is_a_distance_and_not_an_angle(speed: float) -> None:
    points = np.array([[40.0, 8.0, 1.0], [100.0, 40.0, 0.0], [50.0, -6.0, 3.0], [90.0, -30.0, 5.0]])
    record, poses = drive(points, speed)
    found = far_tracks(record, poses, T_IMU_CAM)
    assert found[:9].tolist() == [0.0] * 9  # nobody has been seen ten times
    assert found[9:].tolist() == [2.0] * 5
    assert far_tracks(record, poses, T_IMU_CAM, far_m=20.0)[9:].tolist() == [4.0] * 5


def test_who_stands_still_knows_no_distance() -> None:
    record, poses = drive(np.array([[100.0, 40.0, 0.0]]), 0.0)
    assert not far_tracks(record, poses, T_IMU_CAM).any()


def test_images_without_a_pose_are_unknown() -> None:
    record, poses = drive(np.array([[100.0, 40.0, 0.0]]), 5.0)
    late = Trajectory(poses.stamps_ns[3:], poses.T_world_imu[3:])
    found = far_tracks(record, late, T_IMU_CAM)
    assert np.isnan(found[:3]).all() and found[12:].tolist() == [1.0, 1.0]
    assert found[9:12].tolist() == [0.0] * 3  # nine sightings before, there was no pose
    nothing = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
    assert np.isnan(far_tracks(record, nothing, T_IMU_CAM)).all()


def test_a_table_survives_its_file(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "run", overwrite=False)
    stamps = np.array([1_700_000_000_000_000_001, 1_700_000_000_100_000_001])
    columns = {"features": np.array([3.0, 4.0]), "still": np.array([np.nan, 1.0])}
    directory.write_frames(stamps, columns)
    found, columns = read_frames(tmp_path / "run" / "frames.csv")
    assert found.tolist() == stamps.tolist()
    np.testing.assert_array_equal(columns["still"], [np.nan, 1.0])
    assert (tmp_path / "run" / "frames.csv").read_text().splitlines()[1].endswith(",3,")
    with pytest.raises(DataError, match="no such file"):
        read_frames(tmp_path / "none.csv")
    (tmp_path / "bad.csv").write_text("stamp_ns,features\nx,1\n")
    with pytest.raises(DataError, match="no table of images"):
        read_frames(tmp_path / "bad.csv")
