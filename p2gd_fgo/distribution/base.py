"""What every way of spreading the feature quota looks like to the odometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from p2gd_fgo.frontend import FeatureBuffer, Selection
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.priors import PriorProblem
from p2gd_fgo.types import BoolArray, FloatArray, IntArray, PriorPoses, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class DistributionContext:
    """What is known when the quotas of an image are decided.

    Attributes
    ----------
    camera
        Intrinsics and distortion.
    T_imu_cam
        (4, 4) takes camera points to the IMU frame.
    buffer
        The features of the newest image, and where they were before.
    recent
        Poses that the back end estimates, oldest first; their stamps name columns of the buffer's
        histories, and the last is the body at the buffer's newest image. Empty before the start.
    priors
        Where the planner will drive, relative to the last of ``recent``: checked, at the times of
        the next images. A problem where they can't be used; None where nobody asked for them.
    capacity
        (rows, columns) features that a cell can hold at the minimum distance, outside masks.
    corners
        (rows, columns) corners found in the previous image.
    allowed
        (height, width) false under the mask; None: no mask.
    """

    camera: Camera
    T_imu_cam: FloatArray
    buffer: FeatureBuffer
    recent: Trajectory
    priors: PriorPoses | PriorProblem | None
    capacity: IntArray
    corners: IntArray
    allowed: BoolArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Why quotas are what they are: what P2GD saw and predicted for P points and H poses.

    Attributes
    ----------
    points
        (P, 3) in the world: the 3-D scene.
    kept
        (P,) whether the position was kept from earlier images, not triangulated in this one.
    T_world_cam
        (H + 1, 4, 4) current camera and predicted ones.
    pixels
        (P, H + 1, 2) in the current image and predicted; NaN from the first loss on.
    lengths
        (P,) predicted tracking length: predicted images that see the point before the first loss.
    values
        (P,) what each point's predicted track is worth (total parallax in rad, or length).
    weights
        (rows, columns) of the cells.
    quotas
        (rows, columns) that follow.
    """

    points: FloatArray
    kept: BoolArray
    T_world_cam: FloatArray
    pixels: FloatArray
    lengths: IntArray
    values: FloatArray
    weights: FloatArray
    quotas: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What a distribution decided for one image.

    Attributes
    ----------
    selection
        Chooses the new features.
    problem
        Why the prior poses were not used, if they were wanted and were not.
    explanation
        Of P2GD, where it ran.
    """

    selection: Selection
    problem: PriorProblem | None = None
    explanation: Explanation | None = None


class Distribution(Protocol):
    """Decides which features an image should have."""

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        ...
