"""What every way of spreading the feature quota looks like to the odometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray, IntArray, PriorPoses, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class DistributionContext:
    """What is known when the quotas of an image are decided: after tracking, before extraction.

    Attributes
    ----------
    camera
        Intrinsics and distortion.
    T_imu_cam
        (4, 4) takes camera points to the IMU frame.
    buffer
        The features tracked into the current image, and where they were before.
    window
        Past poses that the back end estimates, oldest first; their stamps name columns of the
        buffer's histories. Empty before the start.
    T_world_imu
        (4, 4) the body at the current image as the IMU predicts it; None before the start.
    priors
        Where the planner will drive, relative to the body at the current image; None without.
    """

    camera: Camera
    T_imu_cam: FloatArray
    buffer: FeatureBuffer
    window: Trajectory
    T_world_imu: FloatArray | None
    priors: PriorPoses | None


class Distribution(Protocol):
    """Decides how many features every cell of the image should have."""

    def quotas(self, context: DistributionContext) -> IntArray:
        """Features wanted per cell (rows, columns), the tracked ones included."""
        ...
