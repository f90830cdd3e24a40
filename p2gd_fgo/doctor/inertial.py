"""Units, gravity and saturation of the IMU, from its samples alone."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.doctor.report import Finding, Status, Value
from p2gd_fgo.types import FloatArray, ImuBatch

MAX_RATE = 35.0
"""2000 deg/s in rad/s, the largest range that MEMS gyros are sold with."""

_GRAVITY_WARNING, _GRAVITY_FAULT = 0.05, 0.2  # share of gravity
_NEAR = 0.1  # around the values that a wrong unit gives
_RUN = 3  # samples in a row at the same extreme value
_STEPS = 20.0  # extremes nearer than these steps of the converter to the median are rest


def check_inertial(sequence: Sequence, config: Config) -> list[Finding]:
    """Look at the accelerometer's mean, and at both sensors' extremes."""
    imu = sequence.imu
    return [
        _gravity(imu, config.imu.gravity),
        _range("gyro range", imu.gyro, "rad/s", MAX_RATE),
        _range("accelerometer range", imu.accel, "m/s²", None),
    ]


def _gravity(imu: ImuBatch, gravity: float) -> Finding:
    size = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    ratio = size / gravity
    threshold = (
        f"{gravity:g} ± {_GRAVITY_WARNING * gravity:.2f} m/s², a fault beyond "
        f"± {_GRAVITY_FAULT * gravity:.1f} m/s²"
    )
    value = f"|accelerometer| is {size:.4g} m/s² in the median"
    data: dict[str, Value] = {"median": size}
    if abs(ratio - 1.0) <= _GRAVITY_WARNING:
        return Finding("gravity", "ok", value, threshold, data=data)
    if abs(ratio - 1.0) <= _GRAVITY_FAULT:
        mend = "calibrate the accelerometer, or allow for its bias in the start's sigmas"
        return Finding("gravity", "warning", value, threshold, mend, "accel_scale", data)
    if abs(ratio * gravity - 1.0) < _NEAR:
        value += ": the accelerometer is in g"
        mend = f"multiply it by {gravity:g}"
        return Finding("gravity", "fault", value, threshold, mend, "accel_units", data)
    if abs(ratio / gravity - 1.0) < _NEAR:
        value += ": the accelerometer was multiplied by g though it was in m/s²"
        mend = f"divide it by {gravity:g}"
        return Finding("gravity", "fault", value, threshold, mend, "accel_units", data)
    if abs(ratio / 1000.0 * gravity - 1.0) < _NEAR or abs(ratio / 1000.0 - 1.0) < _NEAR:
        value += ": the accelerometer is in thousandths of its unit"
        return Finding(
            "gravity", "fault", value, threshold, "convert it to m/s²", "accel_units", data
        )
    if ratio < 1.0 - _GRAVITY_FAULT:
        value += ": gravity has been taken out of it"
        mend = "record the raw specific force; at rest it reads +g upwards"
        return Finding("gravity", "fault", value, threshold, mend, "gravity_removed", data)
    mend = "convert the accelerometer to m/s²"
    return Finding("gravity", "fault", value, threshold, mend, "accel_units", data)


def _range(check: str, values: FloatArray, unit: str, limit: float | None) -> Finding:
    largest = float(np.abs(values).max())
    clipped = [axis for axis, k in zip("xyz", range(3), strict=True) if _clips(values[:, k])]
    value = f"up to {largest:.3g} {unit}"
    threshold = f"no {_RUN} samples in a row at the same extreme"
    if limit is not None:
        threshold += f", < {limit:g} {unit}"
    data: dict[str, Value] = {"largest": largest, "clipped": "".join(clipped)}
    status: Status = "ok"
    mend, fault = "", None
    sensor = check.split()[0]
    if clipped:
        status, fault = "warning", f"{sensor}_saturated"
        value += f", {' and '.join(clipped)} saturated"
        mend = "widen the sensor's range, or damp its mount"
    if limit is not None and float(np.percentile(np.abs(values), 99.0)) > limit:
        status, fault = "fault", f"{sensor}_units"
        value += f": no gyro turns so fast in {unit}, it is in deg/s"
        mend = "multiply it by π/180"
    return Finding(check, status, value, threshold, mend, fault, data)


def _clips(values: FloatArray) -> bool:
    """Whether an axis (N,) stays at its largest or smallest value for some samples."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    if len(steps) == 0:
        return False
    resolution, median = float(steps.min()), float(np.median(values))
    for extreme in (values.max(), values.min()):
        if abs(extreme - median) < _STEPS * resolution:
            continue
        at = values == extreme
        if (at[2:] & at[1:-1] & at[:-2]).any():
            return True
    return False
