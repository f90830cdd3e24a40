"""The examination: from a recording to a report."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.doctor.flow import follow
from p2gd_fgo.doctor.images import check_images
from p2gd_fgo.doctor.inertial import check_inertial
from p2gd_fgo.doctor.intervals import GyroIntegral
from p2gd_fgo.doctor.lens import check_lens
from p2gd_fgo.doctor.motion import check_motion
from p2gd_fgo.doctor.report import Finding, Report
from p2gd_fgo.doctor.stamps import check_stamps, enough_data
from p2gd_fgo.doctor.stretches import choose_stretches


@dataclass(frozen=True, slots=True, eq=False)
class Examination:
    """The report, and the number of an image with much contrast for a picture, or None."""

    report: Report
    example: int | None


def examine(
    sequence: Sequence, config: Config, progress: Callable[[int, int], None] | None = None
) -> Examination:
    """Look at a recording and say whether it is fit to run.

    Parameters
    ----------
    sequence
        As :func:`p2gd_fgo.datasets.open_sequence` gives it.
    config
        Gravity, gap threshold, pixel noise, window and sigmas of the start are taken from it.
    progress
        Called with images done and images in all.
    """
    begin = time.perf_counter()
    amount = enough_data(sequence, config.backend.window)
    findings = [
        amount,
        *check_stamps(sequence, config),
        *check_inertial(sequence, config),
        *check_lens(sequence.calibration.camera),
    ]
    gyro = GyroIntegral(sequence.imu, config.imu.max_gap_s)
    image_s = gyro.seconds(sequence.image_stamps_ns) + sequence.calibration.time_offset_s
    sample = follow(sequence, choose_stretches(image_s, gyro), progress)
    findings += check_images(sample)
    factor = _accel_factor(findings, config.imu.gravity)
    findings += check_motion(sequence, config, gyro, sample, factor)
    enough = amount.status == "ok"
    report = Report(sequence.name, tuple(findings), time.perf_counter() - begin, enough)
    return Examination(report, sample.example)


def _accel_factor(findings: list[Finding], gravity: float) -> float:
    """What makes m/s² of an accelerometer whose unit was found wrong."""
    for finding in findings:
        median = finding.data.get("median")
        if finding.fault == "accel_units" and isinstance(median, float):
            return gravity / median
    return 1.0
