"""Findings from the truth against gyro and accelerometer."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.doctor.axes import Axes
from p2gd_fgo.doctor.matching import signal
from p2gd_fgo.doctor.report import Finding, Value
from p2gd_fgo.doctor.tolerances import Tolerances, beyond, grade
from p2gd_fgo.doctor.truth_accel import AccelMatch
from p2gd_fgo.doctor.truth_gyro import TruthMatch
from p2gd_fgo.geometry import so3

_TILT_DEG = (3.0, 10.0)
"""3° is what an accelerometer's bias of 0.5 m/s² looks like."""

_TILTS = (5.0, 25.0)  # times initialization.given.sigma_tilt_deg
_RESIDUAL = 3.0  # m/s²


def judge_truth(
    truth: TruthMatch, tolerances: Tolerances, config: Config, gyro_axes: Axes | None
) -> list[Finding]:
    """Time and rotation of the truth, once the gyro's axes are mended with ``gyro_axes``."""
    found = truth.match
    if truth.inverted:
        return [
            Finding(
                "truth rotation", "fault",
                "its quaternions are inverted: they take the world to the body",
                "T_world_imu", "conjugate the quaternions of the truth", "truth_inverted",
            )
        ]  # fmt: skip
    if not found.explains:
        if not signal(truth.phi):
            value = "not determined: there is hardly any rotation"
            return [Finding("truth rotation", "undetermined", value)]
        value = f"the gyro explains {100 * found.fit.explained:.0f} % of the truth's rotation"
        mend = "check that the truth belongs to this recording, and the order of its quaternion"
        return [Finding("truth rotation", "fault", value, "≥ 50 %", mend, "truth_rotation")]
    return [_time(truth, tolerances), _rotation(truth, config, gyro_axes)]


def _time(truth: TruthMatch, tolerances: Tolerances) -> Finding:
    shift, sigma = truth.match.fit.shift_s, truth.match.fit.sigma_shift_s
    limits = (tolerances.imu_step_s, 0.5 * tolerances.image_step_s)
    threshold = (
        f"{1e3 * limits[0]:.1f} ms (an IMU interval), a fault beyond {1e3 * limits[1]:.0f} ms "
        "(nearer to another image)"
    )
    value = f"its stamps are {1e3 * abs(shift):.1f} ± {1e3 * sigma:.1f} ms "
    value += f"{'early' if shift > 0 else 'late'}"
    data: dict[str, Value] = {"shift_s": shift, "sigma_s": sigma}
    status = grade(beyond(shift, sigma), limits)
    if status == "ok":
        if 3.0 * sigma > limits[1]:
            value = f"not determined: {value}"
            return Finding("truth time", "undetermined", value, threshold, data=data)
        return Finding("truth time", "ok", value, threshold, data=data)
    mend = f"add {shift:.4f} s to the truth's stamps"
    return Finding("truth time", status, value, threshold, mend, "truth_time", data)


def _rotation(truth: TruthMatch, config: Config, gyro_axes: Axes | None) -> Finding:
    check = "truth rotation"
    found = truth.match
    sigma_tilt = config.initialization.given.sigma_tilt_deg
    limits = (np.radians(_TILTS[0] * sigma_tilt), np.radians(_TILTS[1] * sigma_tilt))
    threshold = f"{np.degrees(limits[0]):.1f}°, a fault beyond {np.degrees(limits[1]):.1f}°"
    data: dict[str, Value] = {"kind": found.hypothesis.kind, "excess": found.excess}
    mend = "give the pose of the IMU: its T_BS says which frame the truth is of"
    axes = found.hypothesis.axes
    if axes is not None and gyro_axes is None:
        value = f"its body axes aren't the IMU's: of the IMU's, {axes.describe()}"
        return Finding(check, "fault", value, threshold, mend, "truth_rotation", data)
    mended = np.eye(3) if gyro_axes is None else gyro_axes.matrix
    delta = so3.log(found.fit.matrix @ mended.T)
    known, sigma = np.array(found.determined), found.fit.sigma_delta
    blind = [axis for axis, k in zip("xyz", known, strict=True) if not k]
    if not known.any():
        value = "not determined: too little rotation"
        return Finding(check, "undetermined", value, threshold, data=data)
    left = [beyond(d, s) for d, s, k in zip(delta, sigma, known, strict=True) if k]
    angle = float(np.degrees(np.linalg.norm(delta[known])))
    value = f"its body axes are {angle:.2f} ± {np.degrees(sigma[known].max()):.2f}° from the gyro's"
    if blind:
        value += f", not determined about {' and '.join(blind)}"
    data |= {"angle_deg": angle}
    status = grade(float(np.linalg.norm(left)), limits)
    if status == "ok":
        return Finding(check, "ok", value, threshold, data=data)
    return Finding(check, status, value, threshold, mend, "truth_rotation", data)


def judge_accel(accel: AccelMatch) -> Finding:
    """The accelerometer against the truth's motion."""
    check = "truth and accelerometer"
    threshold = (
        f"gravity within {_TILT_DEG[0]:g}° of the truth's up, a fault beyond {_TILT_DEG[1]:g}°; "
        f"{_RESIDUAL:g} m/s²"
    )
    data: dict[str, Value] = {
        "tilt_deg": accel.tilt_deg, "residual": accel.residual,
        "recorded_residual": accel.recorded_residual,
    }  # fmt: skip
    if accel.axes.changes:
        value = f"accelerometer axes: {accel.axes.describe()} ({accel.recorded_residual:.1f} m/s² "
        value += f"off as recorded, {accel.residual:.1f} m/s² if mended)"
        mend = "mend the accelerometer's columns; at rest it reads +g upwards"
        return Finding(check, "fault", value, threshold, mend, "accel_axes", data)
    value = f"gravity {accel.tilt_deg:.1f}° from the truth's up, "
    value += f"{accel.residual:.2f} m/s² apart in the median"
    status = grade(accel.tilt_deg, _TILT_DEG)
    if status == "ok" and accel.residual > _RESIDUAL:
        status = "warning"
    if status == "ok":
        return Finding(check, "ok", value, threshold, data=data)
    mend = "the truth's world must have z up, its poses be those of the IMU"
    return Finding(check, status, value, threshold, mend, "truth_gravity", data)
