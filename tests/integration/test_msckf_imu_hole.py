"""The filter over a hole in the IMU in which the body turns by more than it can linearise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from msckf_runs import msckf
from smoother_runs import fates, record, run

from p2gd_fgo.backends.msckf import Msckf
from p2gd_fgo.imu import UnknownMotion, across_holes
from p2gd_fgo.simulation.feature_recording import FeatureRecording
from p2gd_fgo.types import NANOSECONDS, ImuBatch, NavState

HOLE_S = (5.0, 6.0)
SIGMA_RATE, SIGMA_ACCEL = np.radians(60.0), 2.0
SWING = np.radians([0.0, 20.0, 40.0])  # rad/s, by which the bridge is wrong beside
ONE_IN_A_THOUSAND = 22.5  # chi-square of 6 degrees of freedom


def holed(recording: FeatureRecording) -> FeatureRecording:
    imu = recording.imu
    since_s = (imu.stamps_ns - recording.image_stamps_ns[0]) / NANOSECONDS
    keep = (since_s < HOLE_S[0]) | (since_s > HOLE_S[1])
    return replace(recording, imu=ImuBatch(imu.stamps_ns[keep], imu.gyro[keep], imu.accel[keep]))


class Bridging(Msckf):
    """Is handed what the intake makes of the hole, and a turn that nobody measured."""

    holed: ImuBatch

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        imu, unknown = across_holes(self.holed, imu, 0.1, SIGMA_RATE, SIGMA_ACCEL)
        if unknown is not None:
            imu = ImuBatch(imu.stamps_ns, imu.gyro + SWING, imu.accel)
        return super().propagate(imu, unknown)


@pytest.mark.parametrize("fej", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_swing_in_a_hole_is_found_and_covered(seed: int, fej: bool) -> None:
    recording = record("robot", seed, 10.0, outlier_share=0.05)
    healthy = msckf(recording, fej=fej)
    clean = run(healthy, recording, seed)
    faulty = holed(recording)
    backend = msckf(faulty, Bridging, fej=fej)
    assert isinstance(backend, Bridging)
    backend.holed = faulty.imu
    result = run(backend, faulty, seed)
    assert result.position_error.max() < 2.0 * clean.position_error.max()
    assert result.nees[50:].max() < ONE_IN_A_THOUSAND
    assert fates(backend.counts) == backend.counts["observations"]
    assert backend.counts["used"] > 0.95 * healthy.counts["used"]  # the gates let the good pass
