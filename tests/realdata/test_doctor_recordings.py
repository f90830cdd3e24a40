from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.config import Config, DatasetConfig, resolve
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.doctor import FIT, Report, examine
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.types import ImuBatch


def diagnose(sequence: AslSequence) -> Report:
    return examine(sequence, resolve(Config(), sequence.calibration.camera.width)).report


def recording(folder: Path, duration_s: float | None = None) -> AslSequence:
    sequence = open_sequence(DatasetConfig(path=str(folder), duration_s=duration_s))
    assert isinstance(sequence, AslSequence)
    return sequence


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["euroc_mh01", "kitti_0039"])
def test_healthy(recordings: Path, name: str) -> None:
    report = diagnose(recording(recordings / name))
    assert report.verdict == FIT and report.faults == ()


@pytest.mark.realdata
def test_three_faults_at_once_in_a_drive(recordings: Path) -> None:
    """Stamps 60 ms early, T_imu_cam inverted, gyro in deg/s: none hides another."""
    whole = recording(recordings / "kitti_0039", duration_s=14.0)
    spoilt = replace(
        whole,
        image_stamps_ns=whole.image_stamps_ns - 60_000_000,
        calibration=replace(whole.calibration, T_imu_cam=inverse(whole.calibration.T_imu_cam)),
        imu=ImuBatch(whole.imu.stamps_ns, np.degrees(whole.imu.gyro), whole.imu.accel),
    )
    report = diagnose(spoilt)
    assert set(report.faults) == {"time_offset", "extrinsic_inverted", "gyro_units"}
