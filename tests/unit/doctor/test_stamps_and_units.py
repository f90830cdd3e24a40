"""Checks that need no images: gaps, order, units, saturation, lens, verdict."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from asl_folder import START_NS, AslFolder, imu_rows

from p2gd_fgo.config import Config
from p2gd_fgo.doctor import Finding, Report
from p2gd_fgo.doctor.inertial import check_inertial
from p2gd_fgo.doctor.lens import check_lens
from p2gd_fgo.doctor.picture import lens_picture
from p2gd_fgo.doctor.stamps import check_stamps, enough_data
from p2gd_fgo.geometry.camera import EquidistantCamera, RadTanCamera

PINHOLE = (64, 48, 40.0, 41.0, 31.5, 23.5)


def by_check(findings: list[Finding]) -> dict[str, Finding]:
    return {finding.check: finding for finding in findings}


def test_healthy_folder(tmp_path: Path) -> None:
    found = by_check(check_stamps(AslFolder(tmp_path).write().open(), Config()))
    assert {f.status for f in found.values()} == {"ok"}
    assert found["IMU rate"].data["rate_hz"] == pytest.approx(200.0)


@pytest.mark.parametrize(("missing", "status"), [(30, "warning"), (230, "fault")])
def test_gap_is_measured(tmp_path: Path, missing: int, status: str) -> None:
    rows = imu_rows(count=400)
    sequence = AslFolder(tmp_path, imu=rows[:40] + rows[40 + missing :]).write().open()
    gap = by_check(check_stamps(sequence, Config()))["IMU gaps"]
    assert (gap.status, gap.fault) == (status, "imu_gap")
    assert gap.data["longest_s"] == pytest.approx(0.005 * (missing + 1))


def test_missing_images_are_counted(tmp_path: Path) -> None:
    stamps = [START_NS + k * 100_000_000 for k in (0, 1, 2, 5, 6)]
    sequence = AslFolder(tmp_path, image_stamps=stamps, imu=imu_rows(count=200)).write().open()
    images = by_check(check_stamps(sequence, Config()))["images"]
    assert images.data["missing"] == 2 and images.fault == "images_missing"


def test_what_the_reader_mended_is_a_finding(tmp_path: Path) -> None:
    rows = imu_rows()
    rows[10], rows[20] = rows[20], rows[10]
    found = by_check(check_stamps(AslFolder(tmp_path, imu=rows).write().open(), Config()))
    assert found["imu unsorted"].status in ("note", "warning")


@pytest.mark.parametrize(
    ("factor", "fault", "words"),
    [
        (1.0, None, "9.81"),
        (1.0 / 9.81, "accel_units", "in g"),
        (9.81, "accel_units", "multiplied by g"),
        (0.01, "gravity_removed", "taken out"),
        (1.1, "accel_scale", "m/s²"),
    ],
)
def test_unit_of_the_accelerometer(
    tmp_path: Path, factor: float, fault: str | None, words: str
) -> None:
    rows = [[*row[:4], "0", "0", f"{9.81 * factor}"] for row in imu_rows()]
    found = by_check(check_inertial(AslFolder(tmp_path, imu=rows).write().open(), Config()))
    assert found["gravity"].fault == fault
    assert words in found["gravity"].value


def test_saturated_axis_is_named(tmp_path: Path) -> None:
    swing = np.clip(np.sin(0.1 * np.arange(131)), -0.7, 0.7)
    rows = [
        [row[0], f"{0.9 * np.sin(0.1 * k):.9f}", f"{swing[k]:.9f}", *row[3:]]
        for k, row in enumerate(imu_rows())
    ]
    gyro = by_check(check_inertial(AslFolder(tmp_path, imu=rows).write().open(), Config()))
    assert gyro["gyro range"].fault == "gyro_saturated"
    assert gyro["gyro range"].data["clipped"] == "y"


def test_lens_that_turns_back_inside_the_image() -> None:
    bad = RadTanCamera(*PINHOLE, -0.6, 0.0, 0.0, 0.0)
    assert by_check(check_lens(bad))["lens model"].status == "fault"
    good = EquidistantCamera(*PINHOLE, 0.01, 0.0, 0.0, 0.0)
    assert {f.status for f in check_lens(good)} == {"ok"}


def test_centre_of_a_cropped_image() -> None:
    cropped = RadTanCamera(64, 48, 40.0, 41.0, 50.0, 23.5, -0.1, 0.0, 0.0, 0.0)
    assert by_check(check_lens(cropped))["pinhole"].fault == "intrinsics"


def test_picture_shows_both_images() -> None:
    import cv2

    camera = RadTanCamera(*PINHOLE, -0.2, 0.0, 0.0, 0.0)
    png = np.frombuffer(lens_picture(np.full((48, 64), 90, np.uint8), camera), np.uint8)
    picture = cv2.imdecode(png, cv2.IMREAD_COLOR)
    assert picture is not None and picture.shape == (48, 2 * 64 + 12, 3)


@pytest.mark.parametrize(("images", "status"), [(3, "undetermined"), (20, "ok")])
def test_fewer_images_than_a_window_are_too_little(
    tmp_path: Path, images: int, status: str
) -> None:
    stamps = [START_NS + k * 100_000_000 for k in range(images)]
    folder = AslFolder(tmp_path, image_stamps=stamps, imu=imu_rows(count=20 * images))
    found = enough_data(folder.write().open(), window=20)
    assert found.status == status and found.data["images"] == images
    assert f"in {0.1 * (images - 1):.3g} s" in found.value


def test_too_little_data_is_no_verdict_but_a_fault_is_one() -> None:
    warned = (Finding("x", "warning", "", fault="y"),)
    assert Report("r", warned, 0.0, enough=False).verdict == "too little data to judge"
    wrong = (*warned, Finding("z", "fault", "", fault="w"))
    assert Report("r", wrong, 0.0, enough=False).verdict == "not fit to run"


@pytest.mark.parametrize(
    ("statuses", "verdict"),
    [
        (("ok", "note", "undetermined"), "fit to run"),
        (("ok", "warning"), "fit to run, with warnings"),
        (("warning", "fault"), "not fit to run"),
    ],
)
def test_verdict(statuses: tuple[str, ...], verdict: str) -> None:
    findings = tuple(Finding("x", s, "", fault="y") for s in statuses)  # type: ignore[arg-type]
    report = Report("r", findings, 0.0)
    assert report.verdict == verdict
    assert len(report.faults) == sum(s in ("warning", "fault") for s in statuses)
