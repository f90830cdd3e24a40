"""A smooth trajectory with exact derivatives: quintic spline in position, cubic on SO(3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, RotationSpline

from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Trajectory, Truth


@dataclass(frozen=True, slots=True, eq=False)
class KinematicState:
    """Motion of the IMU at N times.

    Attributes
    ----------
    T_world_imu
        (N, 4, 4).
    velocity, acceleration
        (N, 3) in the world, m/s and m/s².
    angular_rate
        (N, 3) in the IMU frame, rad/s.
    """

    T_world_imu: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    angular_rate: FloatArray


class SplineTrajectory:
    """A spline through poses of the IMU.

    Parameters
    ----------
    stamps_ns
        (N,) strictly increasing, N ≥ 6.
    positions
        (N, 3) m in the world.
    rotations
        (N, 3, 3) world from IMU.
    """

    def __init__(self, stamps_ns: IntArray, positions: FloatArray, rotations: FloatArray) -> None:
        self._start_ns, self._end_ns = int(stamps_ns[0]), int(stamps_ns[-1])
        t = self._seconds(stamps_ns)
        self._position = make_interp_spline(t, positions, k=5)
        self._velocity = self._position.derivative()
        self._acceleration = self._position.derivative(2)
        self._rotation = RotationSpline(t, Rotation.from_matrix(rotations))

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last time."""
        return self._start_ns, self._end_ns

    def sample(self, stamps_ns: IntArray) -> KinematicState:
        """Pose and derivatives at stamps_ns (M,).

        Raises
        ------
        ValueError
            A time lies outside the spline.
        """
        stamps_ns = np.asarray(stamps_ns, dtype=np.int64)
        if stamps_ns.min() < self._start_ns or stamps_ns.max() > self._end_ns:
            raise ValueError("a sample time lies outside the trajectory's span")
        t = self._seconds(stamps_ns)
        R = np.asarray(self._rotation(t).as_matrix())
        return KinematicState(
            from_rotation_translation(R, np.asarray(self._position(t))),
            np.asarray(self._velocity(t)),
            np.asarray(self._acceleration(t)),
            np.asarray(self._rotation(t, 1)),
        )

    def truth(self, stamps_ns: IntArray) -> Truth:
        """Pose and velocity at stamps_ns."""
        state = self.sample(stamps_ns)
        return Truth(Trajectory(np.asarray(stamps_ns, np.int64), state.T_world_imu), state.velocity)

    def _seconds(self, stamps_ns: IntArray) -> FloatArray:
        return np.asarray((np.asarray(stamps_ns) - self._start_ns) / NANOSECONDS)
