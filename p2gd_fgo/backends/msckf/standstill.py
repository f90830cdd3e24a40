"""Standing still, said to the filter: two neighbouring images have the same pose."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.msckf.state import POSE_DIM, FilterState, Poses
from p2gd_fgo.config import MsckfConfig
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import NANOSECONDS, FloatArray


def equal_poses(
    state: FilterState, at: Poses, L: FloatArray, config: MsckfConfig
) -> tuple[FloatArray, FloatArray]:
    """Rows Z (6, n) and r (6,): the image before this one has the pose of the one before it.

    What is asserted lies one image back: the detector looks at a window, and its newest image
    may already have begun to move by less than it can see.

    Parameters
    ----------
    at
        Where Jacobians are taken.
    L
        (n, n) root of the covariance.
    """
    j = len(state) - 2
    seconds = (state.stamps_ns[j] - state.stamps_ns[j - 1]) / NANOSECONDS
    moved = config.sigma_still_velocity * seconds
    shift = 1.0 / np.hypot(1.0 / config.sigma_still_position, 1.0 / moved)
    sigmas = np.repeat([np.radians(config.sigma_still_rotation_deg), shift], 3)
    H = relative_pose_jacobian(at, j - 1, j, len(L))
    return (H / sigmas[:, None]) @ L, -relative_pose(state.poses, j - 1, j) / sigmas


def relative_pose(poses: Poses, i: int, j: int) -> FloatArray:
    """(6,) rotation vector and shift of image j in the body frame of image i."""
    Rt = poses.R[i].T
    return np.concatenate([so3.log(Rt @ poses.R[j]), Rt @ (poses.p[j] - poses.p[i])])


def relative_pose_jacobian(poses: Poses, i: int, j: int, size: int) -> FloatArray:
    """(6, size) of :func:`relative_pose` by the filter's error."""
    a, b = i * POSE_DIM, j * POSE_DIM
    Rt = poses.R[i].T
    turn, shift = np.split(relative_pose(poses, i, j), 2)
    H = np.zeros((6, size))
    H[:3, b : b + 3] = so3.right_jacobian_inverse(turn)
    H[:3, a : a + 3] = -H[:3, b : b + 3] @ poses.R[j].T @ poses.R[i]
    H[3:, a : a + 3] = so3.hat(shift)
    H[3:, a + 3 : a + 6] = -Rt
    H[3:, b + 3 : b + 6] = Rt
    return H
