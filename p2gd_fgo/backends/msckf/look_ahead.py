"""What all tracks of a window say about its poses, those that are not due yet too.

The filter updates by tracks that have ended; until then what they say is not in its estimate. Its
update is linearised where they say that the images were taken: docs/msckf.md, "Where an update is
linearised".
"""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.msckf.measurement import (
    Sensor,
    jacobians,
    orthonormal_columns,
    residuals,
)
from p2gd_fgo.backends.msckf.state import POSE_DIM, Poses
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.types import FloatArray


def pose_information(
    sightings: Sightings, points: FloatArray, poses: Poses, sensor: Sensor
) -> tuple[FloatArray, FloatArray]:
    """Information (6 N, 6 N) of tracks with points (M, 3) about N poses, and its vector (6 N,).

    The sum over tracks of H_xᵀ (I − Q Qᵀ) (H_x, r) with Q orthonormal and spanning H_f: the Schur
    complement of the points. No row of any track is multiplied by the covariance's root, so it
    costs a small part of an update.
    """
    H_x, H_f = jacobians(sightings, points, poses, sensor)
    Q = orthonormal_columns(H_f, sightings)
    r = residuals(sightings, points, poses, sensor)[..., None]
    H_t = np.swapaxes(H_x, -1, -2)
    order = np.argsort(sightings.view, kind="stable")
    views, first = np.unique(sightings.view[order], return_index=True)

    blocks = np.zeros((len(poses), POSE_DIM, len(sightings), 3))
    blocks[sightings.view, :, sightings.track] = H_t @ Q
    by_points = blocks.reshape(len(poses) * POSE_DIM, -1)
    explained = np.add.reduceat(np.swapaxes(Q, -1, -2) @ r, sightings.starts).ravel()

    information = -by_points @ by_points.T
    blocks = information.reshape(len(poses), POSE_DIM, len(poses), POSE_DIM)
    blocks[views, :, views] += np.add.reduceat((H_t @ H_x)[order], first)
    vector = np.zeros((len(poses), POSE_DIM))
    vector[views] = np.add.reduceat((H_t @ r)[order], first)[..., 0]
    return information, vector.ravel() - by_points @ explained
