"""Trajectory files: exact stamps, exact bytes, and one sentence for every malformed row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.trajectory_files import format_tum, read_trajectory, read_tum, write_tum
from p2gd_fgo.types import Trajectory

GOOD = "1.5 1 2 3 0 0 0 1"


def random_trajectory(count: int = 50) -> Trajectory:
    rng = np.random.default_rng(3)
    stamps = 1403636584763555527 + np.cumsum(rng.integers(1, 10**8, count))
    return Trajectory(
        stamps.astype(np.int64),
        from_rotation_translation(
            so3.exp(rng.normal(size=(count, 3))), rng.normal(size=(count, 3))
        ),
    )


def test_tum_round_trip_keeps_nanoseconds(tmp_path: Path) -> None:
    trajectory = random_trajectory()
    write_tum(tmp_path / "a.tum", trajectory)
    back = read_tum(tmp_path / "a.tum")
    np.testing.assert_array_equal(back.stamps_ns, trajectory.stamps_ns)
    np.testing.assert_allclose(back.T_world_imu, trajectory.T_world_imu, atol=1e-8)


def test_tum_text_is_exact_and_repeats() -> None:
    T = from_rotation_translation(np.eye(3), np.array([[1.0, -0.5, 1234.567891234]]))
    text = format_tum(Trajectory(np.array([1403636584763555527]), T))
    assert text == "1403636584.763555527 1 -0.5 1234.56789 0 0 0 1\n"
    assert format_tum(Trajectory(np.array([-1]), T)).startswith("-0.000000001 ")
    assert format_tum(random_trajectory()) == format_tum(random_trajectory())


def test_written_bytes_are_identical_and_no_temporary_stays(tmp_path: Path) -> None:
    for name in ("a.tum", "b.tum"):
        write_tum(tmp_path / name, random_trajectory())
    assert (tmp_path / "a.tum").read_bytes() == (tmp_path / "b.tum").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.tum", "b.tum"]


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("1403636584.763555527", 1403636584763555527),
        ("1403636584.7635", 1403636584763500000),
        ("1.403636584763555527e+09", 1403636584763555527),
        ("7", 7 * 10**9),
        ("-0.25", -250_000_000),
    ],
)
def test_stamp_forms(tmp_path: Path, text: str, stamp_ns: int) -> None:
    path = tmp_path / "a.tum"
    path.write_text(f"# comment\n\n  {text}\t0 0 0 0 0 0 2\r\n")
    assert read_trajectory(path).stamps_ns.tolist() == [stamp_ns]


def test_euroc_csv_is_recognised_by_content(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text(
        "#timestamp [ns],x,y,z,w,x,y,z,vx,vy,vz\n"
        "1403636584763555527,1,2,3,0,0,0,1,9,9,9\n"
        "1403636584763555528,1,2,4,0,0,0,1,9,9,9\n"
    )
    trajectory = read_trajectory(path)
    assert trajectory.stamps_ns.tolist() == [1403636584763555527, 1403636584763555528]
    np.testing.assert_allclose(trajectory.T_world_imu[0, :3, :3], np.diag([-1.0, -1.0, 1.0]))
    np.testing.assert_allclose(trajectory.T_world_imu[1, :3, 3], [1, 2, 4])


def test_kaist_poses_are_recognised_and_begin_at_zero(tmp_path: Path) -> None:
    path = tmp_path / "global_pose.csv"
    path.write_text(
        "1544590798000000001,0,-1,0,332000.5,1,0,0,4140000.25,0,0,1,20\n"
        "1544590798100000001,1,0,0,332001.5,0,1,0,4140002.25,0,0,1,20\n"
    )
    trajectory = read_trajectory(path)
    assert trajectory.stamps_ns.tolist() == [1544590798000000001, 1544590798100000001]
    np.testing.assert_allclose(trajectory.T_world_imu[0, :2, :2], [[0, -1], [1, 0]])
    np.testing.assert_allclose(trajectory.T_world_imu[:, :3, 3], [[0, 0, 0], [1, 2, 0]])


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("", "no poses"),
        ("# only a comment\n", "no poses"),
        (f"{GOOD}\n2.5 1 2 3 0 0 0\n", "line 2: 7 columns"),
        (f"{GOOD}\n2.5 1 2 3 0 0 0 1 5\n", "line 2: 9 columns"),
        (f"{GOOD}\n2.5 1 2 x 0 0 0 1\n", "line 2: .*'x'"),
        (f"{GOOD}\nsoon 1 2 3 0 0 0 1\n", "line 2: .*'soon' is no time"),
        (f"{GOOD}\nnan 1 2 3 0 0 0 1\n", "line 2: .*'nan' is no time"),
        (f"{GOOD}\n1e9999999 1 2 3 0 0 0 1\n", "line 2: .*'1e9999999' is no time"),
        (f"{GOOD}\n2.5 1 2 nan 0 0 0 1\n", "line 2: .*NaN"),
        (f"# c\n{GOOD}\n2.5 1 2 3 0 0 0 0\n", "line 3: the quaternion is zero"),
        (f"{GOOD}\n1.5 1 2 3 0 0 0 1\n", "line 2: .*doesn't come after"),
        ("1403636584763555527 1 2 3 0 0 0 1\n", "line 1: .*seconds, not nanoseconds"),
        ("1403636584763555527,1,2,3,0,0,0,0\n", "line 1: the quaternion is zero"),
        ("1403636584763555527,1,2\n", "line 1: 3 columns"),
        ("2,1,0,0,1,0,1,0,1,0,0,2,1\n", "line 1: .*no rotation"),
        ("2,1,0,0,1,0,1,0,1,0,0,1,1\n1,1,0,0,1,0,1,0,1,0,0,1,1\n", "line 2: .*doesn't come after"),
        ("2,1,2,3,0,0,0,1\n1,1,2,3,0,0,0,1\n", "line 2: .*doesn't come after"),
    ],
)
def test_malformed_files_name_file_and_line(tmp_path: Path, rows: str, said: str) -> None:
    path = tmp_path / "bad.tum"
    path.write_text(rows)
    with pytest.raises(DataError, match=f"bad.tum.*{said}") as caught:
        read_trajectory(path)
    assert "\n" not in str(caught.value)


def test_unreadable_paths_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such trajectory file"):
        read_trajectory(tmp_path / "absent.tum")
    with pytest.raises(DataError, match="a folder"):
        read_trajectory(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DataError, match="not a text file"):
        read_trajectory(tmp_path / "binary")
