"""Standing still, said to the filter: two neighbouring images have the same pose."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.msckf.state import POSE_DIM, Poses
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray


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
