"""The values that flow between the rooms of the package: plain frozen dataclasses of arrays.

Conventions (all of them in one place: the docstring of :mod:`p2gd_fgo`): ``T_a_b`` is a 4x4
matrix that takes points from frame b to frame a, stamps are int64 nanoseconds, everything else is
SI. The body frame is the IMU frame; the world's z axis points up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]

NANOSECONDS = 1_000_000_000
ERROR_DIM = 15
"""Size of the error (δθ, δp, δv, δb_g, δb_a) of a state; see :class:`Estimate`."""


@dataclass(frozen=True, slots=True, eq=False)
class ImuBatch:
    """Consecutive IMU samples.

    Attributes
    ----------
    stamps_ns
        (N,) strictly increasing.
    gyro
        (N, 3) angular rate in the IMU frame, rad/s.
    accel
        (N, 3) specific force in the IMU frame, m/s² (a body at rest reads +g upwards).
    """

    stamps_ns: IntArray
    gyro: FloatArray
    accel: FloatArray

    def __len__(self) -> int:
        return len(self.stamps_ns)


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses of the IMU in the world: ``stamps_ns`` (N,), ``T_world_imu`` (N, 4, 4)."""

    stamps_ns: IntArray
    T_world_imu: FloatArray

    def __len__(self) -> int:
        return len(self.stamps_ns)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A reference trajectory and, where the recording has them, velocity and biases.

    Attributes
    ----------
    trajectory
        N poses.
    velocity
        (N, 3) in the world, m/s, or None.
    gyro_bias, accel_bias
        (N, 3) rad/s and m/s², or None.
    """

    trajectory: Trajectory
    velocity: FloatArray | None = None
    gyro_bias: FloatArray | None = None
    accel_bias: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class NavState:
    """State of the IMU at one time.

    Attributes
    ----------
    stamp_ns
        Time on the IMU's clock.
    T_world_imu
        (4, 4) pose.
    velocity
        (3,) in the world, m/s.
    gyro_bias, accel_bias
        (3,) rad/s and m/s².
    """

    stamp_ns: int
    T_world_imu: FloatArray
    velocity: FloatArray
    gyro_bias: FloatArray = field(default_factory=lambda: np.zeros(3))
    accel_bias: FloatArray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """What one image says: the features seen in it.

    Attributes
    ----------
    stamp_ns
        Time of the image on the IMU's clock.
    ids
        (N,) track identities, unique within the image; an id is never used for another track.
    pixels
        (N, 2) in the distorted image, column then row.
    normalized
        (N, 2) undistorted coordinates on the plane z = 1 of the camera.
    """

    stamp_ns: int
    ids: IntArray
    pixels: FloatArray
    normalized: FloatArray

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What a back end knows right after an image.

    Attributes
    ----------
    state
        The newest state.
    covariance
        (15, 15) of the error (δθ, δp, δv, δb_g, δb_a) of the newest state: R = R̂ Exp(δθ) with δθ
        in the IMU frame; δp, δv in the world; biases additive.
    window
        The poses that the back end still estimates, oldest first, the newest included.
    stationary
        Whether the image was taken as standing still.
    """

    state: NavState
    covariance: FloatArray
    window: Trajectory
    stationary: bool = False


@dataclass(frozen=True, slots=True)
class Waiting:
    """The answer while the estimator has not started: when, and what it waits for."""

    stamp_ns: int
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class PriorPoses:
    """Where the planner will drive, relative to the current body frame (paper eq. 1).

    Attributes
    ----------
    stamps_ns
        (N,) future times, increasing.
    T_imu0_imu
        (N, 4, 4) the body at those times in the body frame of now.
    """

    stamps_ns: IntArray
    T_imu0_imu: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TrackRecord:
    """Which features every image of a run saw, and how many were asked for.

    Attributes
    ----------
    stamps_ns
        (F,) of the images.
    counts
        (F,) features in each.
    asked
        (F,) features that the distribution asked for, the tracked ones included.
    ids
        (M,) track identities, image by image; M is the sum of ``counts``.
    normalized
        (M, 2) undistorted coordinates on the plane z = 1.
    """

    stamps_ns: IntArray
    counts: IntArray
    asked: IntArray
    ids: IntArray
    normalized: FloatArray


@dataclass(frozen=True, slots=True)
class Event:
    """Something a reader of the report must know: a gap, a reset, a refusal.

    ``kind`` is a short snake_case name, ``message`` one sentence, ``data`` numbers for scripts.
    """

    stamp_ns: int
    kind: str
    message: str
    data: dict[str, float | int | str] = field(default_factory=dict)
