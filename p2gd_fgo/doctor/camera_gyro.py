"""The camera's rotation, from flow, against the gyro's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.doctor.axes import Axes, all_axes
from p2gd_fgo.doctor.flow import Pair
from p2gd_fgo.doctor.intervals import GyroIntegral, Intervals
from p2gd_fgo.doctor.lens_fit import Lens
from p2gd_fgo.doctor.matching import Hypothesis, Match, match
from p2gd_fgo.doctor.rotation_fit import RotationFit
from p2gd_fgo.doctor.two_view import two_view_motion
from p2gd_fgo.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class CameraMatch:
    """How the camera's rotation goes with the gyro's.

    Attributes
    ----------
    match
        The best hypothesis; its M takes the gyro's axes to the camera's.
    phi
        (N, 3) the rotations that were compared, rad.
    focal_factor
        By how much the focal lengths were corrected before.
    """

    match: Match
    phi: FloatArray
    focal_factor: float = 1.0

    @property
    def scale(self) -> float:
        """Rotation in the images, with the calibrated focal length, over that of the gyro."""
        return self.match.scale * self.focal_factor


def camera_rotations(
    pairs: Sequence[Pair], lens: Lens, image_stamps_ns: IntArray, gyro: GyroIntegral
) -> Intervals:
    """Rotation vectors between neighbouring images, on the camera's clock."""
    seconds = gyro.seconds(image_stamps_ns)
    begin, end, phi, stretch = [], [], [], []
    for pair in pairs:
        motion = two_view_motion(lens.undistort(pair.a), lens.undistort(pair.b), lens.focal_px)
        if motion is not None:
            begin.append(seconds[pair.first])
            end.append(seconds[pair.second])
            phi.append(motion.phi)
            stretch.append(pair.stretch)
    return Intervals(
        np.array(begin), np.array(end), np.array(phi).reshape(-1, 3), np.array(stretch, np.int64)
    )


def match_camera(
    intervals: Intervals,
    gyro: GyroIntegral,
    R_imu_cam: FloatArray,
    offset_s: float,
    gyro_axes: Axes | None,
) -> CameraMatch | None:
    """Compare with the gyro; None where there are too few intervals.

    Parameters
    ----------
    R_imu_cam
        (3, 3) of the calibration.
    offset_s
        t_imu = t_cam + offset, of the calibration.
    gyro_axes
        What the truth says of the gyro's axes; None where nobody says anything, and the camera
        alone decides.
    """
    fitter = RotationFit(gyro, intervals, offset_s)
    if not fitter.enough:
        return None
    S = np.eye(3) if gyro_axes is None else gyro_axes.matrix
    R = R_imu_cam.T
    others = [Hypothesis("inverse", R_imu_cam @ S, 1)]
    for axes in all_axes()[1:]:
        others.append(Hypothesis("axes", R @ axes.matrix @ S, axes.changes, axes))
    return CameraMatch(match(fitter, R @ S, others), fitter.intervals.phi)
