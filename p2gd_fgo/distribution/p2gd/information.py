"""How much a feature would tell about the coming motion (docs/d_optimal.md derives it).

Six parameters stand for what is not known about the motion over the horizon: δ = (δθ, δp), the
error that the pose has gathered at the horizon's end since the current image. It grows linearly
with time, as the two errors that matter most to an IMU do: a gyro bias and a wrong velocity. At
the share s of the horizon the camera is at

    R = Exp(s δθ) R̂,    c = ĉ + s δp,

δθ in rad and δp in m, both along the world's axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import BoolArray, FloatArray, IntArray

INVERSE_DEPTH_SIGMA = 1.0
"""1/m: what is known of a new feature's inverse depth. Weak: a camera that moves by a millimetre
learns more; it only keeps the depth's elimination defined for a camera that stands still."""


@dataclass(frozen=True, slots=True)
class StartUncertainty:
    """What the IMU's prediction starts from: 1 sigma of the current state.

    Attributes
    ----------
    velocity
        m/s.
    tilt
        rad, roll and pitch.
    gyro_bias
        rad/s.
    accel_bias
        m/s².
    """

    velocity: float = 0.05
    tilt: float = 0.003
    gyro_bias: float = 2e-4
    accel_bias: float = 0.02


@dataclass(frozen=True, slots=True)
class Sensors:
    """How well the IMU and a feature measure.

    Attributes
    ----------
    noise
        Of the IMU.
    gravity
        m/s².
    pixel_noise_px
        1 sigma of a feature's position.
    """

    noise: ImuNoise
    gravity: float
    pixel_noise_px: float


SETTLED = StartUncertainty()
"""Of a running estimator: about what the smoother states on a slow car, rounded up."""


def pose_information(
    points: FloatArray, T_world_cam: FloatArray, visible: BoolArray, sigma: float
) -> FloatArray:
    """Information about (δθ, δp) that one new feature at each point would bring.

    Its position is not known: a bearing in the current image and an inverse depth, both eliminated
    (Schur complement), so that a point far away is as well conditioned as a near one.

    Parameters
    ----------
    points
        (P, 3) in the world.
    T_world_cam
        (H + 1, 4, 4) current camera and predicted ones, evenly spaced in time.
    visible
        (P, H + 1) true up to the first loss.
    sigma
        Noise of a normalised coordinate: the pixel noise over the focal length.

    Returns
    -------
    FloatArray
        (P, 6, 6) symmetric; 0 for points seen fewer than twice.
    """
    information = np.zeros((len(points), 6, 6))
    tracked = np.flatnonzero(visible.sum(axis=1) >= 2)
    if tracked.size == 0:
        return information
    jacobian = _jacobian(points[tracked], T_world_cam, visible[tracked])
    normal = jacobian @ np.swapaxes(jacobian, 1, 2) / sigma**2
    motion, cross, point = normal[:, :6, :6], normal[:, :6, 6:], normal[:, 6:, 6:]
    point[:, 2, 2] += INVERSE_DEPTH_SIGMA**-2
    reduced = motion - cross @ np.linalg.solve(point, np.swapaxes(cross, 1, 2))
    information[tracked] = 0.5 * (reduced + np.swapaxes(reduced, 1, 2))
    return information


def _jacobian(points: FloatArray, T_world_cam: FloatArray, visible: BoolArray) -> FloatArray:
    """Derivatives (P, 9, 2 (H + 1)) of all sightings by (δθ, δp) and the point (u, v, 1/depth).

    With y the point seen from a camera, over its depth in the current image, and r the derivative
    of the camera's normalised coordinate by y, the derivative by δθ is s (r × y), by δp it is
    −s r/depth, and by the inverse depth −r · (c − c_0).
    """
    views = len(T_world_cam)
    # Coordinates first and views last, in memory too: three times as fast.
    axes = T_world_cam[:, :3, :3].transpose(2, 1, 0).copy()  # camera axis, world coordinate, view
    centres = T_world_cam[:, :3, 3].T.copy() - T_world_cam[0, :3, 3, None]
    share = np.linspace(0.0, 1.0, views)
    rays = points.T.copy() - T_world_cam[0, :3, 3, None]
    inverse_depth = 1.0 / (axes[2, :, 0] @ rays)

    y = (rays * inverse_depth)[..., None] - inverse_depth[:, None] * centres[:, None]
    x_cam, y_cam, z_cam = ((axis[:, None] * y).sum(axis=0) for axis in axes)
    scale = visible / np.where(visible, z_cam, 1.0)
    # A row (world coordinate, P, H + 1) for each of the two normalised coordinates.
    rows = [
        scale * (axis[:, None] - scale * local * axes[2][:, None])
        for axis, local in ((axes[0], x_cam), (axes[1], y_cam))
    ]
    jacobian = np.empty((len(points), 9, 2, views))
    for row, r in enumerate(rows):
        moved = share * r
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            jacobian[:, i, row] = moved[j] * y[k] - moved[k] * y[j]
            jacobian[:, 3 + i, row] = -inverse_depth[:, None] * moved[i]
        jacobian[:, 6, row] = (axes[0, :, :1, None] * r).sum(axis=0)
        jacobian[:, 7, row] = (axes[1, :, :1, None] * r).sum(axis=0)
        jacobian[:, 8, row] = -(centres[:, None] * r).sum(axis=0)
    return jacobian.reshape(len(points), 9, 2 * views)


def imu_information(
    noise: ImuNoise, horizon_s: float, gravity: float = 9.81, start: StartUncertainty = SETTLED
) -> FloatArray:
    """Information (6, 6) that the IMU has about (δθ, δp) at the end of ``horizon_s`` seconds.

    The inverse of the covariance of strapdown integration from ``start``, at a mean specific force
    of ``gravity`` upwards (m/s²). The pose at the current image is the reference, so its position
    and yaw have no error, but its tilt has one: it turns gravity into acceleration.
    """
    t = horizon_s
    lever = -so3.hat(np.array([0.0, 0.0, gravity]))  # acceleration error by attitude error
    bias, white, walk = start.gyro_bias**2, noise.gyro_noise_density**2, noise.gyro_random_walk**2
    rotation = bias * t**2 + white * t + walk * t**3 / 3.0
    turned = start.tilt**2 * t**4 / 4.0 + bias * t**6 / 36.0
    turned += white * t**5 / 20.0 + walk * t**7 / 252.0
    both = bias * t**4 / 6.0 + white * t**3 / 6.0 + walk * t**5 / 30.0
    straight = start.velocity**2 * t**2 + start.accel_bias**2 * t**4 / 4.0
    straight += noise.accel_noise_density**2 * t**3 / 3.0
    straight += noise.accel_random_walk**2 * t**5 / 20.0
    covariance = np.empty((6, 6))
    covariance[:3, :3] = rotation * np.eye(3)
    covariance[3:, :3] = both * lever
    covariance[:3, 3:] = both * lever.T
    covariance[3:, 3:] = straight * np.eye(3) + turned * (lever @ lever.T)
    return np.asarray(np.linalg.inv(covariance))


def cell_information(information: FloatArray, cells: IntArray, count: int) -> FloatArray:
    """Mean information (count, 6, 6) of the features in each cell; 0 in cells without any.

    ``information`` is (P, 6, 6), ``cells`` (P,) the flat index of the cell that each is in now.
    """
    features = np.bincount(cells, minlength=count)
    membership = np.zeros((count, len(cells)))
    membership[cells, np.arange(len(cells))] = 1.0 / features[cells]
    return np.asarray((membership @ information.reshape(-1, 36)).reshape(count, 6, 6))
