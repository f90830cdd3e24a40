"""What the sightings of a point say about the poses that it was seen from (paper eqs. 12, 13).

Sightings are undistorted, so h_d of eq. 12 is not in here; residuals are in standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from p2gd_fgo.backends.msckf.state import POSE_DIM, Poses
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """What turns a point into a sighting.

    Attributes
    ----------
    camera
        With its distortion.
    T_imu_cam
        (4, 4)
    pixel_noise_px
        1 sigma, in the image as it was taken.
    """

    camera: Camera
    T_imu_cam: FloatArray
    pixel_noise_px: float

    def weights(self, sightings: Sightings) -> FloatArray:
        """(O, 2, 2) from undistorted coordinates to standard deviations of a pixel's noise.

        The Jacobian of h_d at the sighting itself: a shift in the image is by so much larger on
        the undistorted plane as the lens squeezes there.
        """
        return self.camera.distort_jacobian(sightings.normalized) / self.pixel_noise_px


def carried(points: FloatArray, sightings: Sightings, source: Poses, target: Poses) -> FloatArray:
    """Points (M, 3) as the last image that saw them holds them, from source to target poses."""
    if source is target:
        return points
    last = sightings.view[sightings.starts + sightings.lengths - 1]
    away = np.swapaxes(source.R[last], -1, -2) @ (points - source.p[last])[..., None]
    return np.asarray(target.p[last] + (target.R[last] @ away)[..., 0])


def least_depth(
    sightings: Sightings, points: FloatArray, poses: Poses, sensor: Sensor
) -> FloatArray:
    """(M,) m: of each point before the camera that it is nearest to."""
    depth = _in_camera(sightings, points, poses, sensor)[1][:, 2]
    return np.asarray(np.minimum.reduceat(depth, sightings.starts))


def residuals(sightings: Sightings, points: FloatArray, poses: Poses, sensor: Sensor) -> FloatArray:
    """(O, 2): measured less predicted, of points (M, 3) in the world."""
    local = _in_camera(sightings, points, poses, sensor)[1]
    off = sightings.normalized - local[:, :2] / local[:, 2:]
    return np.asarray((sensor.weights(sightings) @ off[..., None])[..., 0])


def jacobians(
    sightings: Sightings, points: FloatArray, poses: Poses, sensor: Sensor
) -> tuple[FloatArray, FloatArray]:
    """H_x (O, 2, 6) for the pose of the sighting's image, H_f (O, 2, 3) for the point.

    With q the point in the IMU frame, δq = [q]× δθ − Rᵀ δp + Rᵀ δp_f.
    """
    q, local = _in_camera(sightings, points, poses, sensor)
    inverse_depth = 1.0 / local[:, 2]
    z = local[:, :2] * inverse_depth[:, None]
    R_cam_imu = sensor.T_imu_cam[:3, :3].T
    by_q = R_cam_imu[:2] - z[:, :, None] * R_cam_imu[2]
    by_q = (sensor.weights(sightings) * inverse_depth[:, None, None]) @ by_q
    H_f = by_q @ np.swapaxes(poses.R, -1, -2)[sightings.view]
    return np.concatenate([by_q @ so3.hat(q), -H_f], axis=2), H_f


def orthonormal_columns(H_f: FloatArray, sightings: Sightings) -> FloatArray:
    """Q (O, 2, 3) that spans each track's H_f, orthonormal over the track: QᵀQ = I.

    Two rounds of Cholesky-QR; one loses digits to the square of the condition number.

    Raises
    ------
    numpy.linalg.LinAlgError
        A point is not determined by its sightings.
    """
    Q = H_f
    for _ in range(2):
        gram = np.add.reduceat(np.swapaxes(Q, -1, -2) @ Q, sightings.starts)
        inverse = np.linalg.inv(np.linalg.cholesky(gram))
        Q = Q @ np.swapaxes(inverse, -1, -2)[sightings.track]
    return Q


def times_root(H_x: FloatArray, sightings: Sightings, L: FloatArray) -> FloatArray:
    """H L (O, 2, n): what a unit of each whitened error does; L (n, n) with P = L Lᵀ."""
    out = np.empty((len(H_x), 2, len(L)))
    order = np.argsort(sightings.view, kind="stable")
    ends = np.searchsorted(sightings.view[order], np.arange(sightings.view.max() + 2))
    for view, (a, z) in enumerate(pairwise(ends.tolist())):
        if z > a:
            rows = order[a:z]
            block = L[view * POSE_DIM : (view + 1) * POSE_DIM]
            out[rows] = (H_x[rows].reshape(-1, POSE_DIM) @ block).reshape(-1, 2, len(L))
    return out


def without_point(rows: FloatArray, Q: FloatArray, sightings: Sightings) -> FloatArray:
    """Rows (O, 2, k) less what a shift of the track's point could explain: (I − Q Qᵀ) rows.

    The projection on the left null space of H_f, in the coordinates of the sightings themselves:
    the same information as Nᵀ rows with N a basis of that space, and no basis to be found.
    """
    explained = np.add.reduceat(np.swapaxes(Q, -1, -2) @ rows, sightings.starts)
    return rows - Q @ explained[sightings.track]


def _in_camera(
    sightings: Sightings, points: FloatArray, poses: Poses, sensor: Sensor
) -> tuple[FloatArray, FloatArray]:
    """The points in the IMU frame and in the camera's (O, 3), of each sighting."""
    away = points[sightings.track] - poses.p[sightings.view]
    q = (np.swapaxes(poses.R, -1, -2)[sightings.view] @ away[..., None])[..., 0]
    return q, (q - sensor.T_imu_cam[:3, 3]) @ sensor.T_imu_cam[:3, :3]
