"""Whether the lens of the calibration is possible at all, whatever the images show."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.doctor.report import Finding, Status, Value
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray

_GRID = 40
_MAX_ROUND_TRIP_PX = 1e-3
_MAX_UNCOVERED = 0.02  # a fisheye's corners show the barrel
_MIN_FOV_DEG, _MAX_FOV_DEG = 20.0, 200.0
_MAX_SKEW = 0.1  # |fx / fy − 1|: pixels are square
_MAX_OFF_CENTRE = 0.15  # of the size


def pixel_grid(camera: Camera, count: int = _GRID) -> FloatArray:
    """(N, 2) pixels all over the image, its corners included."""
    u, v = np.meshgrid(
        np.linspace(0.0, camera.width - 1.0, count), np.linspace(0.0, camera.height - 1.0, count)
    )
    return np.column_stack([u.ravel(), v.ravel()])


def check_lens(camera: Camera) -> list[Finding]:
    """Round trip over the image, reach of the lens model, focal lengths and principal point."""
    return [_round_trip(camera), _pinhole(camera)]


def _round_trip(camera: Camera) -> Finding:
    pixels = pixel_grid(camera)
    covered = camera.invertible(pixels)
    uncovered = 1.0 - float(covered.mean())
    error = np.abs(camera.distort(camera.undistort(pixels[covered])) - pixels[covered])
    worst = float(error.max(initial=0.0))
    reach = float(np.degrees(camera.max_angle))
    kind = type(camera).__name__.removesuffix("Camera").lower()
    value = f"{kind}, grows up to {reach:.0f}° off the axis"
    data: dict[str, Value] = {
        "uncovered": uncovered, "round_trip_px": worst, "reach_deg": reach,
    }  # fmt: skip
    threshold = f"an inverse on {100 * (1 - _MAX_UNCOVERED):g} % of the image"
    if uncovered <= _MAX_UNCOVERED and worst < _MAX_ROUND_TRIP_PX:
        return Finding("lens model", "ok", value, threshold, data=data)
    value = f"{kind} turns back {reach:.0f}° off the axis: {100 * uncovered:.0f} % of the image "
    value += "has no inverse"
    mend = "check distortion_model and the order of distortion_coefficients"
    # The corners of a fisheye may be outside its model and in the dark; a tenth of the image isn't.
    status: Status = "fault" if uncovered > 5 * _MAX_UNCOVERED else "warning"
    return Finding("lens model", status, value, threshold, mend, "distortion_model", data)


def _pinhole(camera: Camera) -> Finding:
    edge = np.array([[0.0, camera.cy], [camera.width - 1.0, camera.cy]])
    x = camera.undistort(edge)[:, 0]
    fov = float(np.degrees(np.arctan(x[1]) - np.arctan(x[0])))
    skew = abs(camera.fx / camera.fy - 1.0)
    off = max(abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5))
    value = f"{fov:.0f}° wide, fx/fy {camera.fx / camera.fy:.4f}, "
    value += f"centre at {camera.cx:.0f}, {camera.cy:.0f} of {camera.width}x{camera.height}"
    threshold = f"{_MIN_FOV_DEG:g} to {_MAX_FOV_DEG:g}°, ± {_MAX_SKEW:g}, "
    threshold += f"within {100 * _MAX_OFF_CENTRE:g} % of the middle"
    data: dict[str, Value] = {"fov_deg": fov, "skew": skew, "off_centre": off}
    if _MIN_FOV_DEG <= fov <= _MAX_FOV_DEG and skew <= _MAX_SKEW and off <= _MAX_OFF_CENTRE:
        return Finding("pinhole", "ok", value, threshold, data=data)
    mend = "check intrinsics (fx fy cx cy) and whether images were cropped or scaled since"
    return Finding("pinhole", "warning", value, threshold, mend, "intrinsics", data)
