"""Which fault a made-up gyro has, told from rotations that are known."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.doctor.axes import all_axes
from p2gd_fgo.doctor.camera_gyro import CameraMatch, match_camera
from p2gd_fgo.doctor.intervals import GyroIntegral, Intervals
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray, ImuBatch

RNG = np.random.default_rng(3)
T = np.arange(0.0, 15.0, 0.005)
PHASE = RNG.uniform(0.0, 2.0 * np.pi, (3, 4))
SPEED = np.array([[1.1, 2.3, 0.7, 3.1], [0.9, 1.7, 2.9, 0.5], [1.3, 0.6, 2.1, 3.7]])
R_IMU_CAM = so3.exp(np.array([0.1, -0.05, 0.02])) @ np.array(
    [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
)
NOISE = 3e-4


def rate(t: FloatArray, size: tuple[float, float, float] = (0.2, 0.2, 0.2)) -> FloatArray:
    waves = [np.sin(np.outer(t, SPEED[k]) + PHASE[k]).sum(axis=1) for k in range(3)]
    return np.stack(waves, axis=1) * size


def diagnose(
    matrix: FloatArray,
    *,
    R_imu_cam: FloatArray = R_IMU_CAM,
    shift_s: float = 0.0,
    size: tuple[float, float, float] = (0.2, 0.2, 0.2),
    told_s: float = 0.0,
) -> CameraMatch:
    """Match of a camera at 20 Hz with a gyro whose numbers are ``matrix`` times the truth's."""
    true = rate(T, size)
    stamps = (T * 1e9).astype(np.int64)
    gyro = true @ matrix.T + [0.02, -0.03, 0.08]
    begin = np.arange(3.0, 12.0, 0.05)
    exact = GyroIntegral(ImuBatch(stamps, true, np.zeros_like(true)), 0.1)
    phi = exact.rotation(begin, begin + 0.05) @ R_IMU_CAM
    phi = phi + NOISE * np.random.default_rng(0).standard_normal(phi.shape)
    intervals = Intervals(begin - shift_s, begin + 0.05 - shift_s, phi, np.arange(len(phi)) // 30)
    found = match_camera(
        intervals,
        GyroIntegral(ImuBatch(stamps, gyro, np.zeros_like(gyro)), 0.1),
        R_imu_cam,
        told_s,
        None,
    )
    assert found is not None
    return found


def test_healthy_within_its_own_uncertainty() -> None:
    fit = diagnose(np.eye(3)).match
    assert fit.hypothesis.kind == "expected" and fit.unit == "rad/s"
    assert abs(fit.fit.shift_s) < 4.0 * fit.fit.sigma_shift_s < 4e-3
    assert (np.abs(fit.fit.delta) < 4.0 * fit.fit.sigma_delta).all()
    assert fit.fit.sigma_delta.max() < np.radians(0.3)
    np.testing.assert_allclose(fit.fit.bias, [0.02, -0.03, 0.08], atol=2e-3)


@pytest.mark.parametrize("shift_s", [0.06, -0.06, 0.004, 1.3])
def test_offset_is_found_with_its_sign(shift_s: float) -> None:
    fit = diagnose(np.eye(3), shift_s=shift_s).match.fit
    assert fit.shift_s == pytest.approx(shift_s, abs=1e-3)


def test_offset_that_is_told_stays() -> None:
    assert diagnose(np.eye(3), shift_s=0.3, told_s=0.3).match.fit.shift_s == pytest.approx(
        0.3, abs=1e-3
    )


def test_inverted_extrinsic() -> None:
    assert diagnose(np.eye(3), R_imu_cam=R_IMU_CAM.T).match.hypothesis.kind == "inverse"


def test_degrees_per_second() -> None:
    found = diagnose(np.degrees(1.0) * np.eye(3)).match
    assert found.unit == "deg/s" and found.hypothesis.kind == "expected"
    assert found.scale == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.diag([1.0, 1.0, -1.0]), "the sign of z is wrong"),
        (np.diag([-1.0, 1.0, 1.0]), "the sign of x is wrong"),
        (np.eye(3)[[1, 0, 2]], "x and y are swapped"),
        (np.eye(3)[[0, 2, 1]], "y and z are swapped"),
    ],
)
def test_mirrored_axes_are_named(matrix: FloatArray, words: str) -> None:
    axes = diagnose(matrix).match.hypothesis.axes
    assert axes is not None and axes.mirrored
    assert axes.describe() == words


def test_small_error_of_the_extrinsic_is_measured() -> None:
    wrong = R_IMU_CAM @ so3.exp(np.radians([5.0, 0.0, 0.0]))
    fit = diagnose(np.eye(3), R_imu_cam=wrong).match.fit
    angle = np.degrees(np.linalg.norm(so3.log(fit.matrix @ wrong)))
    assert angle == pytest.approx(5.0, abs=0.3)


def test_pure_yaw_leaves_the_yaw_axis_undetermined_and_raises_no_alarm() -> None:
    size = (0.0, 0.0, 0.2)
    turned = R_IMU_CAM.T @ so3.exp(np.radians([0.0, 0.0, 40.0]))  # about the IMU's z alone
    for R in (R_IMU_CAM, turned.T):
        found = diagnose(np.eye(3), R_imu_cam=R, size=size).match
        assert found.hypothesis.kind == "expected"
        assert not all(found.determined) and any(found.determined)


def test_pure_yaw_still_tells_a_wrong_sign_of_yaw() -> None:
    axes = diagnose(np.diag([1.0, 1.0, -1.0]), size=(0.0, 0.0, 0.2)).match
    assert axes.hypothesis.kind != "expected"


def test_all_axes_are_48_and_the_identity_comes_first() -> None:
    axes = all_axes()
    assert len({tuple(a.matrix.ravel()) for a in axes}) == 48
    assert axes[0].changes == 0 and axes[0].describe() == "as recorded"
    assert sum(a.mirrored for a in axes) == 24
