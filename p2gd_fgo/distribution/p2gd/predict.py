"""How features will be tracked along the prior poses (paper III-B1 and III-B2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class PredictedTracks:
    """P points in the current camera and in H predicted ones.

    Attributes
    ----------
    T_world_cam
        (H + 1, 4, 4) the current camera and the predicted ones.
    visible
        (P, H + 1) true up to the first loss.
    pixels
        (P, H + 1, 2), NaN from the first loss on.
    """

    T_world_cam: FloatArray
    visible: BoolArray
    pixels: FloatArray

    @property
    def lengths(self) -> IntArray:
        """(P,) predicted tracking length: images after the current one, before the first loss."""
        return np.asarray(np.maximum(self.visible.sum(axis=1) - 1, 0))

    def part(self, which: BoolArray) -> PredictedTracks:
        """The points in which (P,)."""
        return PredictedTracks(self.T_world_cam, self.visible[which], self.pixels[which])


def predicted_cameras(
    T_world_imu0: FloatArray, T_imu0_imu: FloatArray, T_imu_cam: FloatArray
) -> FloatArray:
    """Camera poses (H + 1, 4, 4) in the world: the current one and the prior ones (paper eq. 1).

    Parameters
    ----------
    T_world_imu0
        (4, 4) the body now.
    T_imu0_imu
        (H, 4, 4) prior poses relative to it.
    T_imu_cam
        (4, 4).
    """
    here = T_world_imu0 @ T_imu_cam
    return np.concatenate([here[None], T_world_imu0 @ T_imu0_imu @ T_imu_cam])


def predict_tracks(points: FloatArray, T_world_cam: FloatArray, camera: Camera) -> PredictedTracks:
    """Project every point into every camera, up to its first loss (paper eqs. 4 and 5).

    A point is lost where it is nearer than 5 cm, outside the image, or at an angle that the lens
    model doesn't cover.

    Parameters
    ----------
    points
        (P, 3) in the world.
    T_world_cam
        (H + 1, 4, 4) as :func:`predicted_cameras` gives them.
    camera
        Intrinsics and distortion.
    """
    R, centres = T_world_cam[:, :3, :3], T_world_cam[:, :3, 3]
    local = np.matmul(points - centres[:, None], R)  # (H + 1, P, 3)
    flat = local.reshape(-1, 3)
    with np.errstate(all="ignore"):  # what is behind the camera is not visible
        pixels = camera.project(flat)
    visible = camera.visible(flat, pixels).reshape(local.shape[:2])
    visible = np.logical_and.accumulate(visible, axis=0).T
    pixels = pixels.reshape(*local.shape[:2], 2).swapaxes(0, 1)
    return PredictedTracks(T_world_cam, visible, np.where(visible[..., None], pixels, np.nan))
