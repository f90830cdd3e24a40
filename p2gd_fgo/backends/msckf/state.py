"""The filter's state: the poses of the window's images, the IMU, and their joint covariance.

The newest image is taken at the IMU's own time, so its pose is the IMU's: it is cloned when the IMU
moves on, not before. The covariance is then never singular, and an image's columns lie where its
pose does. The order of the error is

    pose of image 0 (oldest), ..., pose of image N − 1 (= the IMU's), δv, δb_g, δb_a

with 6 numbers a pose, (δθ, δp), so that the last 15 are the error of :class:`Estimate`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import ERROR_DIM, FloatArray, NavState, Trajectory

POSE_DIM = 6
MOTION_DIM = ERROR_DIM - POSE_DIM
"""Of velocity and biases."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """R (N, 3, 3) and p (N, 3), world from IMU, of the window's images."""

    R: FloatArray
    p: FloatArray

    def __len__(self) -> int:
        return len(self.p)


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """N images, oldest first, and the IMU at the newest.

    Attributes
    ----------
    stamps_ns
        (N,)
    poses
        The estimates of now.
    velocity, gyro_bias, accel_bias
        (3,) of the IMU.
    first_poses, first_velocity
        First estimates, (3,) of the newest image: rotation and velocity as predicted before any
        image had its say, positions a chain of the motions so predicted. A correction that moves
        the estimate is in none of them, so that it doesn't pass for a motion of the body.
    covariance
        (6 N + 9, 6 N + 9) in the order above.
    """

    stamps_ns: tuple[int, ...]
    poses: Poses
    velocity: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    first_poses: Poses
    first_velocity: FloatArray
    covariance: FloatArray

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @classmethod
    def begin(cls, state: NavState, covariance: FloatArray) -> FilterState:
        """One image, at ``state`` with error covariance (15, 15)."""
        T = state.T_world_imu
        poses = Poses(T[None, :3, :3], T[None, :3, 3])
        return cls(
            (state.stamp_ns,), poses, state.velocity, state.gyro_bias, state.accel_bias,
            poses, state.velocity, covariance,
        )  # fmt: skip

    def newest(self) -> NavState:
        """The IMU."""
        return NavState(
            self.stamps_ns[-1],
            from_rotation_translation(self.poses.R[-1], self.poses.p[-1]),
            self.velocity,
            self.gyro_bias,
            self.accel_bias,
        )

    def trajectory(self) -> Trajectory:
        """The window's poses."""
        return Trajectory(
            np.array(self.stamps_ns, dtype=np.int64),
            from_rotation_translation(self.poses.R, self.poses.p),
        )

    @property
    def newest_interval_ns(self) -> int:
        """Between the newest two images; 0 at the first."""
        return self.stamps_ns[-1] - self.stamps_ns[-2] if len(self) > 1 else 0

    def newest_covariance(self) -> FloatArray:
        """(15, 15) of the IMU's error."""
        return self.covariance[-ERROR_DIM:, -ERROR_DIM:].copy()

    def linearization_poses(self, fej: bool) -> Poses:
        """Where Jacobians are taken."""
        return self.first_poses if fej else self.poses

    def linearization_velocity(self, fej: bool) -> FloatArray:
        """(3,) where Jacobians of the newest image's velocity are taken."""
        return self.first_velocity if fej else self.velocity

    def propagated(self, predicted: NavState, Phi: FloatArray, Q: FloatArray) -> FilterState:
        """The IMU moved on to ``predicted``, its pose at the last image left behind as a clone.

        The covariance of paper eq. 11, with the augmentation in the same step: the clones' part
        now holds the pose at the last image too.
        """
        P, n = self.covariance, len(self) * POSE_DIM
        out = np.empty((n + ERROR_DIM, n + ERROR_DIM))
        cross = P[:n, -ERROR_DIM:] @ Phi.T
        out[:n, :n] = P[:n, :n]
        out[:n, n:] = cross
        out[n:, :n] = cross.T
        out[n:, n:] = Phi @ P[-ERROR_DIM:, -ERROR_DIM:] @ Phi.T + Q
        T = predicted.T_world_imu
        return FilterState(
            (*self.stamps_ns, predicted.stamp_ns),
            _with(self.poses, T[:3, :3], T[:3, 3]),
            predicted.velocity,
            predicted.gyro_bias,
            predicted.accel_bias,
            _with(
                self.first_poses,
                T[:3, :3],
                self.first_poses.p[-1] + (T[:3, 3] - self.poses.p[-1]),
            ),
            predicted.velocity,
            out,
        )

    def corrected(self, error: FloatArray, covariance: FloatArray) -> FilterState:
        """Moved by ``error`` (6 N + 9,); the first estimates stay."""
        d = error[:-MOTION_DIM].reshape(-1, POSE_DIM)
        return replace(
            self,
            poses=Poses(self.poses.R @ so3.exp(d[:, :3]), self.poses.p + d[:, 3:]),
            velocity=self.velocity + error[-9:-6],
            gyro_bias=self.gyro_bias + error[-6:-3],
            accel_bias=self.accel_bias + error[-3:],
            covariance=covariance,
        )

    def moved_to(self, other: FilterState, L: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The error with which ``corrected`` gives the other's numbers, and L as seen from there.

        Parameters
        ----------
        L
            (6 N + 9, 6 N + 9), what takes white errors to those of this state.

        Returns
        -------
        tuple[FloatArray, FloatArray]
            (6 N + 9,), and J L with J = J_r of each pose's turn, the identity elsewhere.
        """
        if other is self:
            return np.zeros(len(L)), L
        turn = so3.log(np.swapaxes(self.poses.R, -1, -2) @ other.poses.R)
        poses = np.concatenate([turn, other.poses.p - self.poses.p], axis=1)
        motion = (
            other.velocity - self.velocity,
            other.gyro_bias - self.gyro_bias,
            other.accel_bias - self.accel_bias,
        )
        there = L.copy()
        rows = there[:-MOTION_DIM].reshape(-1, POSE_DIM, len(L))
        rows[:, :3] = so3.right_jacobian(turn) @ rows[:, :3]
        return np.concatenate([poses.ravel(), *motion]), there

    def begun_anew(self) -> FilterState:
        """With the estimates of now as the first ones."""
        return replace(self, first_poses=self.poses, first_velocity=self.velocity)

    def without_oldest(self) -> FilterState:
        """The oldest image's pose marginalised: its rows and columns go."""
        return replace(
            self,
            stamps_ns=self.stamps_ns[1:],
            poses=Poses(self.poses.R[1:], self.poses.p[1:]),
            first_poses=Poses(self.first_poses.R[1:], self.first_poses.p[1:]),
            covariance=self.covariance[POSE_DIM:, POSE_DIM:],
        )


def largest_turn(error: FloatArray) -> float:
    """Rad, of the poses in an error (6 N + 9,)."""
    turns = error[:-MOTION_DIM].reshape(-1, POSE_DIM)[:, :3]
    return float(np.linalg.norm(turns, axis=1).max())


def _with(poses: Poses, R: FloatArray, p: FloatArray) -> Poses:
    return Poses(np.concatenate([poses.R, R[None]]), np.concatenate([poses.p, p[None]]))
