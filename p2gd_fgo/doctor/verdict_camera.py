"""Findings from the camera's rotation against the gyro's: units, axes, extrinsics, time, scale."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.doctor.camera_gyro import CameraMatch
from p2gd_fgo.doctor.matching import Match, signal
from p2gd_fgo.doctor.report import Finding, Status, Value
from p2gd_fgo.doctor.rotation_fit import SIGMA_SCALE
from p2gd_fgo.doctor.tolerances import Tolerances, beyond, grade
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray

FOCAL = SIGMA_SCALE
"""A focal length that is off by more than this share is worth a warning."""

_SCALE = (FOCAL, 0.10)
_AXES = "xyz"


def judge_camera(
    camera: CameraMatch,
    R_cam_imu: FloatArray,
    offset_s: float,
    tolerances: Tolerances,
    *,
    gyro_vouched: bool,
    gyro_scale: float = 1.0,
) -> list[Finding]:
    """Say what the best hypothesis means.

    Parameters
    ----------
    camera
        The match.
    R_cam_imu
        (3, 3) M as the calibration has it, the gyro's own axes mended where truth says so.
    offset_s
        t_imu = t_cam + offset, of the calibration.
    tolerances
        Of the recording.
    gyro_vouched
        Truth has been compared with the gyro, and what was wrong with its axes is in R_cam_imu.
    gyro_scale
        What the truth says of the gyro's scale.
    """
    found = camera.match
    if not found.explains:
        return [_nothing_fits(camera)]
    return [
        _extrinsic(found, R_cam_imu, tolerances, gyro_vouched),
        _time(found, offset_s, tolerances),
        _scale(camera, gyro_scale, gyro_vouched),
    ]


def _nothing_fits(camera: CameraMatch) -> Finding:
    share = 100.0 * camera.match.fit.explained
    value = f"the gyro explains {share:.0f} % of the rotation in the images"
    threshold = "≥ 50 %, in any axes, units and within ± 2 s"
    if not signal(camera.phi):
        value = "not determined: there is hardly any rotation"
        return Finding("camera and gyro", "undetermined", value, threshold, "turn more")
    mend = "check that IMU and images are of one recording, on one clock, on one rigid body"
    return Finding("camera and gyro", "fault", value, threshold, mend, "camera_gyro")


def _extrinsic(
    found: Match, R_cam_imu: FloatArray, tolerances: Tolerances, gyro_vouched: bool
) -> Finding:
    check = "extrinsic rotation"
    limits = tolerances.tilt_thresholds
    threshold = (
        f"{np.degrees(limits[0]):.1f}°, a fault beyond {np.degrees(limits[1]):.1f}° "
        f"({tolerances.noise_px:g} and {tolerances.outlier_px:g} px in a turn across the window)"
    )
    kind, axes = found.hypothesis.kind, found.hypothesis.axes
    data: dict[str, Value] = {"excess": found.excess, "gate": found.gate, "kind": kind}
    if kind == "inverse":
        value = "T_imu_cam is inverted: its inverse explains the gyro, it doesn't"
        mend = "invert it: T_imu_cam takes the camera's points to the IMU, T_cam_imu the other way"
        return Finding(check, "fault", value, threshold, mend, "extrinsic_inverted", data)
    if kind == "axes" and axes is not None:
        where = axes.describe()
        if axes.mirrored and not gyro_vouched:
            mend = "mend the gyro's columns in the recording, and look at the accelerometer's"
            return Finding(
                check, "fault", f"gyro axes: {where}", threshold, mend, "gyro_axes", data
            )
        if axes.mirrored:
            value = f"only a mirror image would fit (gyro: {where}), yet truth confirms the gyro"
            return Finding(
                check, "fault", value, threshold, "flip the images back", "images_mirrored", data
            )
        if gyro_vouched:
            value = f"T_imu_cam's axes are mixed up: of the IMU's, {where}"
            return Finding(
                check, "fault", value, threshold, "correct T_imu_cam", "extrinsic_rotation", data
            )
        value = f"T_imu_cam's or the IMU's axes are mixed up: of the IMU's, {where}"
        mend = "correct T_imu_cam, or the columns of gyro and accelerometer"
        return Finding(check, "fault", value, threshold, mend, "extrinsic_rotation", data)
    delta = so3.log(found.fit.matrix @ R_cam_imu.T)
    known = np.array(found.determined)
    sigma = found.fit.sigma_delta
    excess = float(
        np.linalg.norm(
            [beyond(d, s) for d, s, k in zip(delta, sigma, known, strict=True) if k] or [0.0]
        )
    )
    angle = float(np.degrees(np.linalg.norm(delta[known])))
    worst = float(np.degrees(sigma[known].max())) if known.any() else 0.0
    blind = [axis for axis, k in zip(_AXES, known, strict=True) if not k]
    data |= {"angle_deg": angle, "sigma_deg": worst, "undetermined": "".join(blind)}
    if not known.any():
        value = "not determined: too little rotation"
        return Finding(check, "undetermined", value, threshold, "turn about all axes", data=data)
    status = grade(excess, limits)
    value = f"{angle:.2f} ± {worst:.2f}° from T_imu_cam"
    if blind:
        value += f", not determined about the camera's {' and '.join(blind)}"
    if status == "ok":
        return Finding(check, "ok", value, threshold, data=data)
    axis = ", ".join(
        f"{np.degrees(d):.1f}" if k else "?" for d, k in zip(delta, known, strict=True)
    )
    mend = f"calibrate T_imu_cam anew: turn the camera by ({axis})° about its axes"
    return Finding(check, status, value, threshold, mend, "extrinsic_rotation", data)


def _time(found: Match, offset_s: float, tolerances: Tolerances) -> Finding:
    check = "time offset"
    error = found.fit.shift_s - offset_s
    sigma = found.fit.sigma_shift_s
    limits = tolerances.shift_thresholds_s
    threshold = (
        f"{1e3 * limits[0]:.1f} ms, a fault beyond {1e3 * limits[1]:.1f} ms "
        f"({tolerances.noise_px:g} and {tolerances.outlier_px:g} px in a turn, not below an IMU "
        "interval)"
    )
    value = f"{1e3 * error:+.1f} ± {1e3 * sigma:.1f} ms from {1e3 * offset_s:.4g} ms"
    data: dict[str, Value] = {
        "offset_s": found.fit.shift_s, "configured_s": offset_s, "sigma_s": sigma,
        "cost_px": tolerances.shift_px(error),
    }  # fmt: skip
    status = grade(beyond(error, sigma), limits)
    if status == "ok":
        if 3.0 * sigma > limits[1]:
            value = f"not determined: {value}"
            return Finding(
                check, "undetermined", value, threshold, "turn back and forth faster", data=data
            )
        return Finding(check, "ok", value, threshold, data=data)
    mend = f"dataset.time_offset_s: {found.fit.shift_s:.4f} (t_imu = t_cam + offset)"
    return Finding(check, status, value, threshold, mend, "time_offset", data)


def focal_ratio(scale: float, gyro_scale: float) -> float:
    """The focal length that the gyro asks for, over the calibration's."""
    return scale / gyro_scale


def _scale(camera: CameraMatch, gyro_scale: float, gyro_vouched: bool) -> Finding:
    check = "rotation scale"
    ratio, sigma = focal_ratio(camera.scale, gyro_scale), camera.match.fit.sigma_scale
    threshold = f"1 ± {_SCALE[0]:g}, a fault beyond ± {_SCALE[1]:g}"
    value = f"images turn {ratio:.3f} ± {sigma:.3f} times as far as the gyro"
    data: dict[str, Value] = {"ratio": ratio, "sigma": sigma}
    if sigma > 0.7 * SIGMA_SCALE:
        return Finding(check, "undetermined", "not determined", threshold, "turn more", data=data)
    status: Status = grade(beyond(ratio - 1.0, sigma), _SCALE)
    if status == "ok":
        return Finding(check, "ok", value, threshold, data=data)
    if gyro_vouched:
        value += ", the truth confirms the gyro: the focal length is wrong"
        mend = f"multiply fx and fy by {ratio:.3f}, or calibrate for this size of image"
        return Finding(check, status, value, threshold, mend, "focal_length", data)
    value += ": the focal length or the gyro's scale is wrong"
    mend = f"multiply fx and fy by {ratio:.3f}, or the gyro; truth would tell which"
    return Finding(check, status, value, threshold, mend, "focal_length", data)
