"""Prior poses without a planner: the recent motion goes on."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors.image_times import ImageTimes
from p2gd_fgo.priors.screw import along_screw
from p2gd_fgo.types import NANOSECONDS, PriorPoses, Trajectory

_AVERAGED_S = 0.5


class ConstantVelocityPriors:
    """A screw motion with the mean twist of the estimate's last half second.

    The mean, since the last step alone holds the suspension's pitching and the estimate's own
    corrections, which a horizon of two seconds would magnify twentyfold.

    Parameters
    ----------
    image_times
        When the next images come.
    horizon
        Images ahead.
    """

    independent = False
    description = "constant velocity (no planner)"

    def __init__(self, image_times: ImageTimes, horizon: int) -> None:
        self._horizon = horizon
        self.image_times = image_times

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        """Poses at the next images; None before there are two estimates."""
        ahead = self.image_times.after(stamp_ns, recent, self._horizon)
        if ahead is None or len(recent) < 2:
            return None
        now_ns = recent.stamps_ns[-1]
        ages_ns = now_ns - recent.stamps_ns[:-1]
        begin = int(np.argmin(np.abs(ages_ns - _AVERAGED_S * NANOSECONDS)))
        moved = inverse(recent.T_world_imu[begin]) @ recent.T_world_imu[-1]
        return PriorPoses(ahead, along_screw(moved, (ahead - now_ns) / ages_ns[begin]))
