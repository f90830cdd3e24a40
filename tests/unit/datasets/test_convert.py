"""Converted to an ASL folder, every format opens as it did before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from asl_folder import AslFolder
from typer.testing import CliRunner
from written_recordings import (
    Content,
    content,
    write_bag,
    write_chain,
    write_image,
    write_kaist_folder,
    write_kitti_folder,
    write_tum_folder,
)

from p2gd_fgo.cli.main import app
from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.datasets.convert import convert_to_asl
from p2gd_fgo.errors import DataError
from p2gd_fgo.trajectory_files import read_tum


@pytest.fixture(scope="module")
def made() -> Content:
    return content()


def opened(path: Path, **settings: Any) -> Sequence:
    return open_sequence(DatasetConfig(path=str(path), **settings))


def bag(images: str, kind: str) -> Callable[[Path, Content], Path]:
    def write(folder: Path, made: Content) -> Path:
        folder.parent.mkdir(parents=True)
        return write_bag(folder.with_suffix(".bag"), made, kind=kind, images=images)

    return write


@pytest.mark.parametrize(
    ("write", "copied"),
    [
        (write_tum_folder, 6),
        (write_kaist_folder, 0),  # Bayer: decoded
        (write_kitti_folder, 6),
        (bag("mono8", "ros1"), 0),
        (bag("jpeg", "mcap"), 6),
    ],
    ids=["tum", "kaist", "kitti", "bag", "compressed"],
)
def test_round_trip(
    tmp_path: Path, made: Content, write: Callable[[Path, Content], Path], copied: int
) -> None:
    path = write(tmp_path / "day" / "drive", made)
    calibration = str(write_chain(tmp_path / "chain")) if path.suffix == ".bag" else None
    before = opened(path, calibration=calibration)
    steps: list[tuple[int, int]] = []
    done = convert_to_asl(before, tmp_path / "out", progress=lambda *step: steps.append(step))
    assert (done.images, done.copied, done.masks, done.notes) == (6, copied, 0, ())
    assert steps == [(k, 6) for k in range(1, 7)]
    assert {p.name for p in tmp_path.iterdir()} <= {"out", "day", "chain"}  # nothing half-written
    check_same(before, opened(tmp_path / "out"))


def check_same(before: Sequence, after: Sequence) -> None:
    assert after.image_stamps_ns.tolist() == before.image_stamps_ns.tolist()
    for k in range(len(before.image_stamps_ns)):
        np.testing.assert_array_equal(after.image(k), before.image(k))
    assert after.imu.stamps_ns.tolist() == before.imu.stamps_ns.tolist()
    np.testing.assert_allclose(after.imu.gyro, before.imu.gyro, rtol=1e-11)
    np.testing.assert_allclose(after.imu.accel, before.imu.accel, rtol=1e-11)
    a, b = after.calibration, before.calibration
    assert (a.camera, a.imu_noise, a.time_offset_s) == (b.camera, b.imu_noise, b.time_offset_s)
    np.testing.assert_allclose(a.T_imu_cam, b.T_imu_cam, atol=1e-12)
    assert after.truth is not None and before.truth is not None
    poses, expected = after.truth.trajectory, before.truth.trajectory
    assert poses.stamps_ns.tolist() == expected.stamps_ns.tolist()
    np.testing.assert_allclose(poses.T_world_imu, expected.T_world_imu, atol=1e-9)
    assert (after.truth.velocity is None) == (before.truth.velocity is None)


def test_from_asl_with_masks_and_a_part(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap").write()
    masks = folder.mav0 / "mask0" / "data"
    for k in (1, 2):
        mask = np.zeros((48, 64), np.uint8)
        mask[:20] = 255
        write_image(masks / folder.image(k).name, mask)
    before = folder.open(masks="mav0/mask0/data", start_s=0.1, duration_s=0.3)
    done = convert_to_asl(before, tmp_path / "out")
    assert (done.images, done.copied, done.masks) == (4, 4, 2)
    after = opened(tmp_path / "out", masks="mav0/mask0/data")
    check_same(before, after)
    for k in range(4):
        np.testing.assert_array_equal(after.mask(k), before.mask(k))
    assert after.truth is not None and after.truth.accel_bias is not None


def test_what_cannot_be_read_is_left_out_and_said(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap").write()
    folder.image(2).write_bytes(folder.image(2).read_bytes()[:60])
    wide = cv2.imread(str(folder.image(3)), cv2.IMREAD_GRAYSCALE)
    assert wide is not None
    write_image(folder.image(3), wide.astype(np.uint16) * 256 + 9)
    done = convert_to_asl(folder.open(), tmp_path / "out")
    assert (done.images, done.copied) == (5, 5)
    assert "1 images were left out" in done.notes[0] and "truncated" in done.notes[0]
    data = tmp_path / "out" / "mav0" / "cam0" / "data"
    assert (data / folder.image(3).name).read_bytes() == folder.image(3).read_bytes()
    for k in range(6):
        folder.image(k).write_bytes(b"")
    sequence = folder.open()
    with pytest.raises(DataError, match="none of its 6 images can be read"):
        convert_to_asl(sequence, tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()


def test_biases_without_velocity_are_said(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap")
    assert folder.imu_sensor is not None
    T = np.eye(4)
    T[0, 3] = 0.2  # another point than the truth's: its velocity isn't the IMU's
    folder.imu_sensor["T_BS"] = T.tolist()
    done = convert_to_asl(folder.write().open(), tmp_path / "out")
    assert done.notes == (
        "the truth's biases were left out: the format has them only with a velocity",
    )


def test_what_is_there_is_kept_unless_told(tmp_path: Path, made: Content) -> None:
    sequence = opened(write_tum_folder(tmp_path / "desk", made))
    out = tmp_path / "out"
    out.mkdir()
    convert_to_asl(sequence, out)  # empty: welcome
    with pytest.raises(DataError, match="exists already: give a new folder, or --overwrite"):
        convert_to_asl(sequence, out)
    (out / "mav0" / "cam0" / "old").touch()
    convert_to_asl(sequence, out, overwrite=True)
    assert not (out / "mav0" / "cam0" / "old").exists()
    with pytest.raises(DataError, match=r"holds groundtruth\.txt, which no conversion writes"):
        convert_to_asl(sequence, tmp_path / "desk", overwrite=True)
    assert (tmp_path / "desk" / "imu.txt").exists()
    (out / "mav0" / "cam1").mkdir()  # of a recording with two cameras
    with pytest.raises(DataError, match="holds mav0/cam1, which no conversion writes"):
        convert_to_asl(sequence, out, overwrite=True)


def test_the_recording_itself_is_never_replaced(tmp_path: Path, made: Content) -> None:
    assert run(write_tum_folder(tmp_path / "desk", made), tmp_path / "a" / "out")[0] == 0
    for place in (tmp_path / "a" / "out", tmp_path / "a"):
        code, said = run(tmp_path / "a" / "out", place, "--overwrite")
        assert code == 2 and "the recording itself lies there" in said
    code, said = run(tmp_path / "desk", tmp_path / "b", "--set", "dataset.mask=m.png")
    assert code == 2 and said.startswith("dataset.mask: an ASL folder holds no mask")


def test_into_the_working_directory_and_names_that_look_like_markup(
    tmp_path: Path, made: Content, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk = write_tum_folder(tmp_path / "desk", made)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert run(desk, ".")[0] == 0
    assert (tmp_path / "here" / "mav0" / "cam0" / "data.csv").is_file()
    code, said = run(desk, tmp_path / "out[v1]")
    assert code == 0 and "out[v1]: 6 images" in said


def test_a_bad_mask_leaves_its_image_out(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap").write()
    masks = folder.mav0 / "mask0" / "data"
    for k in range(6):
        write_image(masks / folder.image(k).name, np.full((48, 64), 255, np.uint8))
    (masks / folder.image(2).name).write_bytes(b"no picture")
    done = convert_to_asl(folder.open(masks="mav0/mask0/data"), tmp_path / "out")
    assert (done.images, done.masks) == (5, 5)
    for sensor in ("cam0", "mask0"):
        assert len(list((tmp_path / "out" / "mav0" / sensor / "data").iterdir())) == 5


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["convert", *map(str, arguments)])
    if isinstance(result.exception, DataError):
        return 2, str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout


def test_the_command(tmp_path: Path, made: Content) -> None:
    path = write_bag(tmp_path / "run.bag", made, kind="ros1")
    setting = f"dataset.calibration={write_chain(tmp_path / 'chain')}"
    code, text = run(path, tmp_path / "out", "--set", setting)
    assert code == 0
    assert "6 images (0 copied, 6 as PNG), 130 IMU samples, 32 poses of truth" in text
    assert "note: /truth is taken as the truth" in text
    check_same(opened(path, calibration=str(tmp_path / "chain")), opened(tmp_path / "out"))
    assert run(path, tmp_path / "out", "--set", setting)[0] == 2
    assert run(path, tmp_path / "new")[1].startswith(f"{path}: a bag holds no calibration")


def test_a_topic_as_a_trajectory_file(tmp_path: Path, made: Content) -> None:
    topics = ("/plan", "/odom")
    path = write_bag(tmp_path / "run", made, kind="mcap", truth_topics=topics)
    setting = "dataset.truth_topic=/plan"
    assert run(path, tmp_path / "plan.tum", "--set", setting)[0] == 0  # without a calibration
    plan = read_tum(tmp_path / "plan.tum")
    assert plan.stamps_ns.tolist() == made.truth.stamps_ns.tolist()
    np.testing.assert_allclose(plan.T_world_imu, made.truth.T_world_imu, atol=1e-7)
    assert run(path, tmp_path / "plan.tum", "--set", setting)[0] == 2
    assert run(write_tum_folder(tmp_path / "desk", made), tmp_path / "truth.tum")[0] == 0
    assert len(read_tum(tmp_path / "truth.tum")) == len(made.truth)
    (tmp_path / "desk" / "groundtruth.txt").unlink()
    assert "no truth to write" in run(tmp_path / "desk", tmp_path / "none.tum")[1]


@pytest.mark.realdata
def test_a_shared_recording(tmp_path: Path, recordings: Path) -> None:
    before = opened(recordings / "kitti_0039", duration_s=2.0)
    done = convert_to_asl(before, tmp_path / "out")
    assert done.copied == done.images == len(before.image_stamps_ns)
    check_same(before, opened(tmp_path / "out"))
