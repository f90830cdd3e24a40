"""Faults are where and what they are said to be, and nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.simulation import faults
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray

BEGIN_S = 4.0


@pytest.fixture(scope="module")
def sequence(short_demo: Path) -> Sequence:
    return open_sequence(DatasetConfig(path=str(short_demo)))


def since_s(sequence: Sequence) -> FloatArray:
    return np.asarray((sequence.image_stamps_ns - sequence.image_stamps_ns[0]) / NANOSECONDS)


def changed(faulty: Sequence, sequence: Sequence) -> BoolArray:
    return np.array(
        [
            not np.array_equal(faulty.image(k), sequence.image(k))
            for k in range(len(sequence.image_stamps_ns))
        ]
    )


def test_images_are_missing(sequence: Sequence) -> None:
    left = since_s(faults.without_images(sequence, BEGIN_S, 1.0))
    assert not ((left >= 4.0) & (left <= 5.0)).any()
    assert len(left) == len(sequence.image_stamps_ns) - 11
    faulty = faults.without_images(sequence, BEGIN_S, 1.0)
    np.testing.assert_array_equal(faulty.image(40), sequence.image(51))
    assert faulty.truth is sequence.truth and faulty.calibration is sequence.calibration


def test_images_are_black(sequence: Sequence) -> None:
    faulty = faults.black_images(sequence, BEGIN_S, 0.5)
    np.testing.assert_array_equal(np.flatnonzero(changed(faulty, sequence)), np.arange(40, 46))
    assert not faulty.image(43).any()


def test_an_image_is_frozen(sequence: Sequence) -> None:
    faulty = faults.frozen_image(sequence, BEGIN_S, 0.5)
    np.testing.assert_array_equal(np.flatnonzero(changed(faulty, sequence)), np.arange(41, 46))
    np.testing.assert_array_equal(faulty.image(45), sequence.image(40))
    np.testing.assert_array_equal(faulty.image_stamps_ns, sequence.image_stamps_ns)


def test_the_brightness_jumps(sequence: Sequence) -> None:
    faulty = faults.brightness_jump(sequence, BEGIN_S, 0.5, 0.5)
    np.testing.assert_array_equal(np.flatnonzero(changed(faulty, sequence)), np.arange(40, 46))
    assert faulty.image(42).mean() == pytest.approx(0.5 * sequence.image(42).mean(), rel=0.02)


def test_the_truck_covers_its_share_and_moves(sequence: Sequence) -> None:
    faulty = faults.passing_truck(sequence, BEGIN_S, 2.0, 0.6)
    covered = [float((faulty.image(k) != sequence.image(k)).mean()) for k in range(38, 64)]
    assert max(covered[:2]) == 0.0 and max(covered[-3:]) == 0.0
    middle = covered[8:17]
    assert min(middle) > 0.58 and max(middle) < 0.62  # a few pixels agree by chance
    assert not np.array_equal(faulty.image(49), faulty.image(50))


def test_imu_samples_are_missing(sequence: Sequence) -> None:
    imu = faults.imu_hole(sequence, BEGIN_S, 1.0).imu
    steps = np.diff(imu.stamps_ns)
    k = int(np.argmax(steps))
    assert 1.0 <= steps[k] / NANOSECONDS < 1.02
    assert (np.delete(steps, k) == steps[0]).all()
    begin_s = (int(imu.stamps_ns[k]) - int(sequence.image_stamps_ns[0])) / NANOSECONDS
    assert begin_s == pytest.approx(BEGIN_S, abs=0.011)


def test_doubled_stamps_are_mended_and_counted(sequence: Sequence) -> None:
    faulty = faults.doubled_stamps(sequence, 0.3, np.random.default_rng(0))
    np.testing.assert_array_equal(faulty.imu.stamps_ns, sequence.imu.stamps_ns)
    np.testing.assert_array_equal(faulty.imu.gyro, sequence.imu.gyro)
    assert not changed(faulty, sequence).any()
    counts = {e.kind: e.data["count"] for e in faulty.events}
    assert counts["imu_duplicates"] == pytest.approx(0.3 * len(sequence.imu), rel=0.15)
    assert 10 < float(counts["image_duplicates"]) < 35
