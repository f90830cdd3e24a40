"""Prior poses from a trajectory known beforehand: truth, noisy truth, a planner's file."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors.image_times import ImageTimes
from p2gd_fgo.priors.resampling import covered, leading
from p2gd_fgo.priors.screw import interpolate_screws
from p2gd_fgo.types import FloatArray, IntArray, PriorPoses, Trajectory


class RecordedPriors:
    """Looks ahead on a trajectory, at the times of the next images.

    Parameters
    ----------
    trajectory
        In any world: only relative poses are handed out, so its drift doesn't matter (paper
        eq. 1). Quickest where it has a pose at every image's stamp.
    image_times
        When the next images come.
    horizon
        Images ahead.
    description
        For the head of the table.
    """

    independent = True

    def __init__(
        self, trajectory: Trajectory, image_times: ImageTimes, horizon: int, description: str
    ) -> None:
        self._trajectory = trajectory
        self._horizon = horizon
        self.image_times = image_times
        self.description = description

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        """Poses at the next images, up to the first that the trajectory doesn't cover."""
        ahead = self.image_times.after(stamp_ns, recent, self._horizon)
        if ahead is None or len(self._trajectory) == 0:
            return None
        poses = self._along(np.append(np.int64(stamp_ns), ahead))
        if len(poses) == 0:
            return None
        return PriorPoses(ahead[: len(poses) - 1], inverse(poses[0]) @ poses[1:])

    def _along(self, query_ns: IntArray) -> FloatArray:
        """Poses (K, 4, 4) at the first K of ``query_ns``, which are covered."""
        known = self._trajectory.stamps_ns
        index = np.minimum(np.searchsorted(known, query_ns), len(known) - 1)
        if (known[index] == query_ns).all():
            return self._trajectory.T_world_imu[index]
        count = leading(covered(known, query_ns))
        return interpolate_screws(self._trajectory, query_ns[:count])


def with_white_noise(
    trajectory: Trajectory, position_sigma: float, yaw_sigma_deg: float, rng: np.random.Generator
) -> Trajectory:
    """White noise on x and y (m, each) and on the yaw of every pose (paper Table VIII).

    The yaw turns a pose about the world's vertical, in place.
    """
    T = trajectory.T_world_imu.copy()
    yaw = np.radians(yaw_sigma_deg) * rng.standard_normal(len(T))
    T[:, :2, 3] += position_sigma * rng.standard_normal((len(T), 2))
    T[:, :3, :3] = so3.exp(yaw[:, None] * np.array([0.0, 0.0, 1.0])) @ T[:, :3, :3]
    return Trajectory(trajectory.stamps_ns, T)
