"""Every format's reader gives back what was written in that format."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import written_recordings
from written_recordings import (
    LATITUDE,
    NOISE,
    P_RECT,
    R_RECT,
    START_NS,
    T_CAM1_CAM0,
    T_CAM_VELO,
    T_IMU_CAM,
    T_VELO_IMU,
    Content,
    content,
    mosaic,
    write_bag,
    write_chain,
    write_image,
    write_kaist_folder,
    write_kitti_folder,
    write_tum_folder,
)

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.datasets.base import KeepsEncodedImages
from p2gd_fgo.datasets.kitti_raw import KittiRawSequence
from p2gd_fgo.errors import DataError, ImageError
from p2gd_fgo.evaluation.association import common_poses
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse, transform
from p2gd_fgo.types import Trajectory

CAMERA = RadTanCamera(64, 48, 40.0, 41.0, 31.5, 23.5, -0.1, 0.01, 0.0002, 1e-05)
POINTS = np.array([[8.0, 1.0, 0.4], [9.0, -2.0, 0.5], [12.0, 0.3, -1.0]])  # in the IMU's frame


@pytest.fixture(scope="module")
def made() -> Content:
    return content()


def opened(path: Path, **settings: Any) -> Sequence:
    return open_sequence(DatasetConfig(path=str(path), **settings))


def check(sequence: Sequence, made: Content, *, images: bool = True) -> None:
    assert sequence.image_stamps_ns.tolist() == made.image_stamps_ns.tolist()
    for k in (5, 0, 1, 2, 4, 4) if images else ():  # in any order
        np.testing.assert_array_equal(sequence.image(k), made.images[k])
    assert sequence.imu.stamps_ns.tolist() == made.imu.stamps_ns.tolist()
    np.testing.assert_array_equal(sequence.imu.gyro, made.imu.gyro)
    np.testing.assert_array_equal(sequence.imu.accel, made.imu.accel)
    assert sequence.truth is not None
    check_truth(sequence.truth.trajectory, made)


def check_truth(trajectory: Trajectory, made: Content) -> None:
    assert trajectory.stamps_ns.tolist() == made.truth.stamps_ns.tolist()
    np.testing.assert_allclose(trajectory.T_world_imu, made.truth.T_world_imu, atol=1e-8)


def kinds(sequence: Sequence) -> list[str]:
    return [event.kind for event in sequence.events]


def test_tum_style(tmp_path: Path, made: Content) -> None:
    folder = write_tum_folder(tmp_path / "desk", made)
    sequence = opened(folder)
    check(sequence, made)
    assert sequence.name == "desk" and sequence.events == ()
    assert sequence.calibration.camera == CAMERA
    assert sequence.calibration.time_offset_s == 0.003
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, T_IMU_CAM, atol=1e-12)
    noise = sequence.calibration.imu_noise
    assert noise is not None and noise.gyro_noise_density == NOISE["gyroscope_noise_density"]
    assert opened(folder, time_offset_s=0.0).calibration.time_offset_s == 0.0
    part = opened(folder, start_s=0.2, duration_s=0.2)
    assert part.image_stamps_ns.tolist() == made.image_stamps_ns[2:5].tolist()
    np.testing.assert_array_equal(part.image(0), made.images[2])


def test_poses_of_another_frame_are_moved_to_the_imu(tmp_path: Path, made: Content) -> None:
    folder = write_tum_folder(tmp_path / "desk", made)
    T_marker_imu = from_rotation_translation(so3.exp(np.array([0.4, 0.1, -2.0])), np.ones(3))
    rows = tuple(tuple(row) for row in T_marker_imu.tolist())
    truth = opened(folder, T_truth_imu=rows).truth
    assert truth is not None
    expected = made.truth.T_world_imu @ T_marker_imu
    np.testing.assert_allclose(truth.trajectory.T_world_imu, expected, atol=1e-8)
    with pytest.raises(DataError, match=r"dataset\.T_truth_imu is not a rigid transform"):
        opened(folder, T_truth_imu=((2.0, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))


def test_kaist_urban(tmp_path: Path, made: Content) -> None:
    sequence = opened(write_kaist_folder(tmp_path / "urban", made))
    assert sequence.events == ()
    assert sequence.calibration.camera == CAMERA
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, T_IMU_CAM, atol=1e-12)
    assert sequence.calibration.imu_noise is not None
    check(sequence, moved_to_first_vehicle(made), images=False)
    # Bayer: ITU weights of red 200, green 100 + k and blue 50, wherever all three are near.
    for k in range(6):
        grey = sequence.image(k)
        assert grey.shape == (48, 64)
        assert np.abs(grey[2:-2, 2:-2] - (0.299 * 200 + 0.587 * (100 + k) + 0.114 * 50)).max() < 1.5


def moved_to_first_vehicle(made: Content) -> Content:
    T = made.truth.T_world_imu.copy()
    lever = np.array([-0.07, 0.0, 1.7])
    T[:, :3, 3] -= T[0, :3, 3] - T[0, :3, :3] @ lever
    return Content(made.image_stamps_ns, made.images, made.imu, Trajectory(made.truth.stamps_ns, T))


def test_kaist_without_list_with_opencv_yaml_and_colour(tmp_path: Path, made: Content) -> None:
    folder = write_kaist_folder(tmp_path / "urban", made)
    (folder / "sensor_data" / "stereo_stamp.csv").unlink()
    left = folder / "calibration" / "left.yaml"
    text = left.read_text().replace("camera_matrix:", "camera_matrix: !!opencv-matrix")
    left.write_text("%YAML:1.0\n---\n" + text)
    colour = cv2.merge([np.full((48, 64), value, np.uint8) for value in (50, 100, 200)])
    write_image(folder / "image" / "stereo_left" / f"{START_NS}.png", colour)
    sequence = opened(folder)
    assert sequence.image_stamps_ns.tolist() == made.image_stamps_ns.tolist()
    assert sequence.calibration.camera == CAMERA
    assert abs(int(sequence.image(0)[20, 20]) - 124) <= 1


def test_kaist_imu_files_without_raw_data_are_refused(tmp_path: Path, made: Content) -> None:
    folder = write_kaist_folder(tmp_path / "urban", made)
    path = folder / "sensor_data" / "xsens_imu.csv"
    path.write_text("\n".join(",".join(r.split(",")[:8]) for r in path.read_text().splitlines()))
    with pytest.raises(DataError, match=r"xsens_imu\.csv: the rows have no raw gyro"):
        opened(folder)


def test_holes_in_the_truth_stay_holes(tmp_path: Path, made: Content) -> None:
    holed = content(30).without_truth_between(0.75, 2.05)
    sequence = opened(write_kaist_folder(tmp_path / "urban", holed))
    assert kinds(sequence) == ["truth_partial"]
    assert sequence.events[0].data == {"covered": 17, "images": 30, "holes": 1}
    truth = sequence.truth
    assert truth is not None
    assert truth.trajectory.stamps_ns.tolist() == holed.truth.stamps_ns.tolist()
    poses = np.tile(np.eye(4), (30, 1, 1))
    common = common_poses(Trajectory(sequence.image_stamps_ns, poses), truth.trajectory)
    t = (common.stamps_ns - START_NS) / 1e9
    assert len(common) == 17 and not ((t > 0.75) & (t < 2.05)).any()


@pytest.mark.parametrize("camera", ["00", "01"])
def test_kitti_extract(tmp_path: Path, made: Content, camera: str) -> None:
    folder = write_kitti_folder(tmp_path / "day" / "drive_0001_extract", made, camera=camera)
    sequence = opened(folder, camera=f"cam{int(camera)}")
    check_kitti(sequence, made)
    K = RadTanCamera(64, 48, 40.0, 41.0, 31.5, 23.5, -0.3, 0.1, 1e-3, 2e-3, -0.02)
    assert sequence.calibration.camera == K
    points = transform(T_CAM_VELO @ T_VELO_IMU, POINTS)
    if camera == "01":
        points = transform(T_CAM1_CAM0, points)
    np.testing.assert_allclose(projected(sequence), K.project(points), atol=1e-6)


def test_kitti_sync(tmp_path: Path, made: Content) -> None:
    folder = write_kitti_folder(
        tmp_path / "day" / "drive_0001_sync", made, rectified=True, camera="02"
    )
    sequence = opened(folder, camera="image_02", format="kitti_raw")
    check_kitti(sequence, made)
    # The data set's own formula: P_rect R_rect T_cam_velo T_velo_imu X.
    points = transform(T_CAM_VELO @ T_VELO_IMU, POINTS) @ R_RECT.T
    homogeneous = np.column_stack([points, np.ones(3)]) @ P_RECT.T
    np.testing.assert_allclose(
        projected(sequence), homogeneous[:, :2] / homogeneous[:, 2:], atol=1e-6
    )


def projected(sequence: Sequence) -> np.ndarray:
    T_cam_imu = inverse(sequence.calibration.T_imu_cam)
    return sequence.calibration.camera.project(transform(T_cam_imu, POINTS))


def check_kitti(sequence: Sequence, made: Content) -> None:
    assert sequence.events == ()
    assert sequence.image_stamps_ns.tolist() == made.image_stamps_ns.tolist()
    np.testing.assert_array_equal(sequence.image(3), made.images[3])
    count = len(made.truth)
    assert sequence.imu.stamps_ns.tolist() == made.truth.stamps_ns.tolist()
    np.testing.assert_allclose(sequence.imu.gyro, made.imu.gyro[:count], rtol=1e-12)
    np.testing.assert_allclose(sequence.imu.accel, made.imu.accel[:count], rtol=1e-12)
    assert sequence.calibration.imu_noise is None
    truth = sequence.truth
    assert truth is not None and truth.velocity is not None
    np.testing.assert_allclose(truth.velocity, np.tile([3.0, 4.0, 0.5], (count, 1)))
    T, expected = truth.trajectory.T_world_imu, made.truth.T_world_imu.copy()
    np.testing.assert_allclose(T[:, :3, :3], expected[:, :3, :3], atol=1e-9)
    expected[:, :3, 3] -= expected[0, :3, 3]
    np.testing.assert_allclose(T[:, :3, 3], expected[:, :3, 3], atol=1e-4)
    assert abs(LATITUDE) < 89


def test_kitti_packets_and_images_may_be_missing_or_late(tmp_path: Path, made: Content) -> None:
    folder = write_kitti_folder(tmp_path / "day" / "drive", made)
    (folder / "oxts" / "data" / "0000000004.txt").unlink()
    times = folder / "oxts" / "timestamps.txt"
    lines = times.read_text().splitlines()
    lines[9], lines[10] = lines[10], lines[9]
    times.write_text("\n".join(lines))
    (folder / "image_00" / "data" / "0000000000.png").unlink()
    sequence = opened(folder)
    assert kinds(sequence) == ["imu_unsorted", "truth_unsorted"]
    assert len(sequence.imu) == len(made.truth) - 1
    with pytest.raises(DataError, match=r"0000000000\.png: no such image"):
        sequence.image(0)
    (folder.parent / "calib_imu_to_velo.txt").unlink()
    with pytest.raises(DataError, match=r"calib_imu_to_velo\.txt: no such file; put the calib"):
        opened(folder)


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_bags(tmp_path: Path, made: Content, kind: str) -> None:
    path = write_bag(tmp_path / ("run.bag" if kind == "ros1" else "run"), made, kind=kind)
    calibration = str(write_chain(tmp_path / "calibration"))
    sequence = opened(path, calibration=calibration)
    check(sequence, made)
    assert sequence.name == "run" and kinds(sequence) == ["truth_topic_guessed"]
    assert sequence.calibration.camera == CAMERA
    named = opened(path, calibration=calibration, truth_topic="/truth", start_s=0.2)
    assert named.events == () and len(named.image_stamps_ns) == 4
    np.testing.assert_array_equal(named.image(1), made.images[3])
    without = opened(path, calibration=calibration, truth_topic="none")
    assert without.truth is None and kinds(without) == ["truth_missing"]
    if kind != "ros1":  # the storage file without its folder's metadata
        (file,) = (p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
        check(opened(file, calibration=calibration), made)


@pytest.mark.parametrize(
    ("kind", "compression"),
    [
        ("ros1", ("BZ2",)),
        ("ros1", ("LZ4",)),
        ("mcap", ("STORAGE", "ZSTD")),
        ("sqlite3", ("MESSAGE", "ZSTD")),
        ("sqlite3", ("FILE", "ZSTD")),
    ],
)
def test_compressed_bags(
    tmp_path: Path, made: Content, kind: str, compression: tuple[str, ...]
) -> None:
    path = tmp_path / ("run.bag" if kind == "ros1" else "run")
    write_bag(path, made, kind=kind, compression=compression)
    check(opened(path, calibration=str(write_chain(tmp_path / "calibration"))), made)


def test_a_recording_in_parts(tmp_path: Path, made: Content) -> None:
    late = made.image_stamps_ns[3] + 30_000_000
    folder = tmp_path / "parts"
    folder.mkdir()
    for name, first, last in (("a", 0, late), ("b", late, late + 10**10)):
        write_bag(folder / f"{name}.bag", made.between(first, last), kind="ros1")
    calibration = str(write_chain(tmp_path / "calibration"))
    sequence = opened(folder, calibration=calibration)
    check(sequence, made)
    assert sequence.name == "parts"


def test_images_recorded_in_another_order_and_twice(tmp_path: Path, made: Content) -> None:
    def late(stamp: int) -> int:
        return 150_000_000 if stamp == made.image_stamps_ns[2] else 1_000_000

    again = Content(
        np.append(made.image_stamps_ns, made.image_stamps_ns[4]),
        [*made.images, np.zeros((48, 64), np.uint8)],
        made.imu,
        made.truth,
    )
    path = write_bag(tmp_path / "run.bag", again, kind="ros1", recorded_late_ns=late)
    sequence = opened(path, calibration=str(write_chain(tmp_path / "calibration")))
    check(sequence, made)
    assert kinds(sequence)[:2] == ["image_unsorted", "image_duplicates"]


@pytest.fixture
def large_images(monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Height and width of what is written in this test."""
    monkeypatch.setattr(written_recordings, "WIDTH", 320)
    monkeypatch.setattr(written_recordings, "HEIGHT", 240)
    return 240, 320


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_long_bag_is_not_held(
    tmp_path: Path, made: Content, kind: str, large_images: tuple[int, int]
) -> None:
    images = [np.full(large_images, k, np.uint8) for k in range(200)]
    stamps = START_NS + 1_000_000 * np.arange(200, dtype=np.int64)
    path = tmp_path / (f"{kind}.bag" if kind == "ros1" else kind)
    write_bag(path, Content(stamps, images, made.imu, made.truth), kind=kind)
    calibration = str(write_chain(tmp_path / "calibration", resolution=[320, 240]))
    tracemalloc.start()
    sequence = opened(path, calibration=calibration)
    for k in range(200):
        assert sequence.image(k)[7, 7] == k
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000 < sum(image.nbytes for image in images) / 3


@pytest.mark.realdata
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_a_shared_recording_as_a_bag(
    tmp_path: Path, recordings: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = opened(recordings / "euroc_mh01", duration_s=1.0)
    assert before.truth is not None
    images = [before.image(k) for k in range(len(before.image_stamps_ns))]
    whole = Content(before.image_stamps_ns, images, before.imu, before.truth.trajectory)
    path = tmp_path / ("run.bag" if kind == "ros1" else "run")
    monkeypatch.setattr(written_recordings, "WIDTH", 752)
    monkeypatch.setattr(written_recordings, "HEIGHT", 480)
    write_bag(path, whole, kind=kind)
    after = opened(path, calibration=str(recordings / "euroc_mh01"), truth_topic="/truth")
    assert after.events == ()
    np.testing.assert_array_equal(after.image_stamps_ns, before.image_stamps_ns)
    np.testing.assert_array_equal(after.image(11), images[11])
    np.testing.assert_array_equal(after.imu.accel, before.imu.accel)
    assert after.calibration.camera == before.calibration.camera
    assert after.truth is not None
    np.testing.assert_allclose(
        after.truth.trajectory.T_world_imu, before.truth.trajectory.T_world_imu, atol=1e-8
    )


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
@pytest.mark.parametrize("encoding", ["png", "mono16", "rgb8", "bgr8", "bgra8"])
def test_encodings_of_images(tmp_path: Path, made: Content, kind: str, encoding: str) -> None:
    path = write_bag(tmp_path / "run.bag", made, kind=kind, images=encoding, truth=None)
    sequence = opened(path, calibration=str(write_chain(tmp_path / "calibration")))
    for k in range(6):
        np.testing.assert_array_equal(sequence.image(k), made.images[k])


def test_jpeg_and_bayer_in_a_bag(tmp_path: Path, made: Content) -> None:
    calibration = str(write_chain(tmp_path / "calibration"))
    smooth = Content(
        made.image_stamps_ns,
        [np.tile(np.arange(64, dtype=np.uint8) + 9 * k, (48, 1)) for k in range(6)],
        made.imu,
        made.truth,
    )
    path = write_bag(tmp_path / "jpeg.bag", smooth, kind="ros1", images="jpeg")
    image = opened(path, calibration=calibration).image(4)
    assert np.abs(image.astype(int) - smooth.images[4]).max() <= 3
    raw = Content(made.image_stamps_ns, [mosaic(200, 100, 50)] * 6, made.imu, made.truth)
    path = write_bag(tmp_path / "bayer", raw, kind="sqlite3", images="bayer_rggb8")
    image = opened(path, calibration=calibration).image(0)
    assert abs(int(image[20, 20]) - 124) <= 1
    packed = {
        "bayer_rggb8; png compressed ": True,  # as image_transport packs a mosaic
        "rgb8; png compressed bgr8": False,
        "mono8; jpeg compressed ": False,
        "png": False,
    }
    for k, (form, is_mosaic) in enumerate(packed.items()):
        written = raw if is_mosaic else smooth
        path = write_bag(tmp_path / f"packed{k}.bag", written, kind="ros1", images=form)
        sequence = opened(path, calibration=calibration)
        expected = image if is_mosaic else smooth.images[0]
        assert np.abs(sequence.image(0).astype(int) - expected).max() <= 3
        assert isinstance(sequence, KeepsEncodedImages)
        assert (sequence.encoded_image(0) is None) == is_mosaic
    path = write_bag(tmp_path / "wide", raw, kind="mcap", images="bayer_rggb16; png compressed ")
    with pytest.raises(DataError, match="known are 8-bit Bayer mosaics"):
        opened(path, calibration=calibration)
    path = write_bag(tmp_path / "yuv", raw, kind="sqlite3", images="yuv422")
    with pytest.raises(DataError, match="the encoding is 'yuv422', known are mono8"):
        opened(path, calibration=calibration)


@pytest.mark.parametrize(
    "truth",
    [
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "geometry_msgs/msg/TransformStamped",
    ],
)
def test_kinds_of_truth(tmp_path: Path, made: Content, truth: str) -> None:
    path = write_bag(tmp_path / "run", made, kind="mcap", truth=truth)
    sequence = opened(path, calibration=str(write_chain(tmp_path / "calibration")))
    assert sequence.truth is not None
    check_truth(sequence.truth.trajectory, made)


def test_topics_that_must_be_named(tmp_path: Path, made: Content) -> None:
    calibration = str(write_chain(tmp_path / "calibration"))
    path = write_bag(
        tmp_path / "two.bag", made, kind="ros1",
        image_topics=("/cam0/image_raw", "/cam1/image_raw"), truth_topics=("/odom", "/gps"),
    )  # fmt: skip
    with pytest.raises(DataError, match=r"2 topics hold images \(/cam0/image_raw, /cam1/image_raw"):
        opened(path, calibration=calibration)
    with pytest.raises(DataError, match=r"2 topics hold odometry .*\(/gps, /odom\).* or 'none'"):
        opened(path, calibration=calibration, image_topic="/cam1/image_raw")
    settings = {"image_topic": "/cam1/image_raw", "truth_topic": "/odom"}
    check(opened(path, calibration=calibration, **settings), made)
    with pytest.raises(DataError, match=r"dataset\.image_topic is '/imu0', which holds sensor_m"):
        opened(path, calibration=calibration, image_topic="/imu0")
    with pytest.raises(DataError, match=r"dataset\.imu_topic is '/imu', which is not in the bag"):
        opened(path, calibration=calibration, imu_topic="/imu", **settings)
    with pytest.raises(DataError, match=r"name a Kalibr or OpenVINS .* by dataset\.calibration"):
        opened(path)


@pytest.mark.parametrize(
    "write",
    [write_tum_folder, write_kaist_folder, write_kitti_folder],
    ids=["tum", "kaist", "kitti"],
)
def test_another_calibration_wins(
    tmp_path: Path, made: Content, write: Callable[[Path, Content], Path]
) -> None:
    folder = write(tmp_path / "day" / "drive", made)
    given = write_chain(tmp_path / "given", intrinsics=[50.0, 51.0, 30.0, 20.0])
    sequence = opened(folder, calibration=str(given))
    assert sequence.calibration.camera.fx == 50.0


def test_tum_vi_with_its_calibration_beside(tmp_path: Path, made: Content) -> None:
    from p2gd_fgo.datasets.convert import convert_to_asl

    folder = write_tum_folder(tmp_path / "desk", made)
    room = tmp_path / "dataset-room1_512_16"
    convert_to_asl(opened(folder), room)
    mav0 = room / "mav0"
    for k, stamp in enumerate(made.image_stamps_ns.tolist()):  # 16-bit, as the data set's
        wide = made.images[k].astype(np.uint16) * 256 + 77
        write_image(mav0 / "cam0" / "data" / f"{stamp}.png", wide)
    (mav0 / "cam0" / "sensor.yaml").unlink()
    (mav0 / "imu0" / "sensor.yaml").unlink()
    (mav0 / "state_groundtruth_estimate0").rename(mav0 / "mocap0")
    (mav0 / "mocap0" / "sensor.yaml").unlink()
    with pytest.raises(DataError, match=r"cam0/sensor\.yaml: no such file; some releases"):
        opened(room)
    lens = {
        "distortion_model": "equidistant",
        "distortion_coeffs": [0.0034, 0.0007, -0.002, 0.0002],
    }
    inverse_chain = {"T_imu_cam": None, "T_cam_imu": inverse(T_IMU_CAM).tolist()}
    write_chain(room / "dso", **lens, **inverse_chain)
    (room / "dso" / "kalibr_imucam_chain.yaml").rename(room / "dso" / "camchain.yaml")
    sequence = opened(room)
    for k in range(6):
        np.testing.assert_array_equal(sequence.image(k), made.images[k])
    assert sequence.calibration.imu_noise is not None
    np.testing.assert_allclose(sequence.calibration.T_imu_cam, T_IMU_CAM, atol=1e-12)
    assert type(sequence.calibration.camera).__name__ == "EquidistantCamera"
    assert sequence.truth is not None
    check_truth(sequence.truth.trajectory, made)


def test_settings_of_another_format_are_refused(tmp_path: Path, made: Content) -> None:
    folder = write_kaist_folder(tmp_path / "urban", made)
    with pytest.raises(DataError, match=r"dataset\.imu_topic is set, but .* format 'kaist' and"):
        opened(folder, imu_topic="/imu")
    identity = tuple(tuple(row) for row in np.eye(4).tolist())
    with pytest.raises(DataError, match=r"dataset\.T_truth_imu is set.* for bag and tum: leave"):
        opened(folder, T_truth_imu=identity)
    with pytest.raises(
        DataError, match=r"dataset\.camera is 'cam1', but of KAIST Urban only the left"
    ):
        opened(folder, camera="cam1")
    drive = write_kitti_folder(tmp_path / "day" / "drive", made)
    with pytest.raises(DataError, match=r"dataset\.camera is 'cam7', but KITTI raw has cam0, cam1"):
        opened(drive, camera="cam7", format="kitti_raw")


def test_a_damaged_first_image_is_survived(tmp_path: Path, made: Content) -> None:
    calibration = str(write_chain(tmp_path / "calibration"))
    broken = [np.zeros((0, 0), np.uint8), *made.images[1:]]
    bag = write_bag(tmp_path / "run.bag", replace(made, images=broken), kind="ros1", images="png")
    drive = write_kitti_folder(tmp_path / "day" / "drive", made)
    (drive / "image_00" / "data" / "0000000000.png").write_bytes(b"no picture")
    for sequence in (opened(bag, calibration=calibration), opened(drive)):
        with pytest.raises(ImageError):
            sequence.image(0)
        np.testing.assert_array_equal(sequence.image(1), made.images[1])


@pytest.mark.parametrize("camera", ["image_00", "cam0"])
def test_kitti_is_told_from_asl_by_any_name_of_a_camera(
    tmp_path: Path, made: Content, camera: str
) -> None:
    sequence = opened(write_kitti_folder(tmp_path / "day" / "drive", made), camera=camera)
    assert isinstance(sequence, KittiRawSequence)


def test_names_of_kaist_images_that_are_no_stamps(tmp_path: Path, made: Content) -> None:
    folder = write_kaist_folder(tmp_path / "urban", made)
    (folder / "sensor_data" / "stereo_stamp.csv").unlink()
    write_image(folder / "image" / "stereo_left" / f"{'9' * 23}.png", made.images[0])
    with pytest.raises(DataError, match="doesn't fit into 64 bits"):
        opened(folder)


def test_kaist_has_as_many_coefficients_as_its_lens(tmp_path: Path, made: Content) -> None:
    folder = write_kaist_folder(tmp_path / "urban", made)
    left = folder / "calibration" / "left.yaml"
    left.write_text(left.read_text().replace("plumb_bob", "equidistant"))
    with pytest.raises(DataError, match="distortion_coefficients holds 5 numbers, needed are 4"):
        opened(folder)
