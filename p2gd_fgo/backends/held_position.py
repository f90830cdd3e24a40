"""A body that stands for a while stays where it is reported.

What standing tells about biases also corrects the way behind, for a minute and more: the newest
position creeps while the body is known not to move. So after a while the position is held, and the
offset between what the back end says and what is reported takes the correction up; it stays when
the body goes on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from p2gd_fgo.types import NANOSECONDS, Estimate, FloatArray, NavState, Trajectory


class HeldPosition:
    """The offset from the back end's positions to the reported ones.

    Parameters
    ----------
    after_s
        Standing time before the position is held: its first seconds tell the speed's error, and
        that correction is let through. None: never.
    """

    def __init__(self, after_s: float | None) -> None:
        self._after_ns = None if after_s is None else round(after_s * NANOSECONDS)
        self._since_ns: int | None = None
        self._place: FloatArray | None = None
        self._offset = np.zeros(3)

    def hold(self, estimate: Estimate) -> Estimate:
        """The estimate as it is reported: call once an image."""
        stamp_ns = estimate.state.stamp_ns
        position = estimate.state.T_world_imu[:3, 3]
        if not estimate.stationary or self._after_ns is None:
            self._since_ns = self._place = None
        elif self._since_ns is None:
            self._since_ns = stamp_ns
        elif self._place is not None:
            self._offset = self._place - position
        elif stamp_ns - self._since_ns >= self._after_ns:
            self._place = position + self._offset
        if not self._offset.any():
            return estimate
        window = estimate.window
        return replace(
            estimate,
            state=self.moved(estimate.state),
            window=Trajectory(window.stamps_ns, self._moved(window.T_world_imu)),
        )

    def moved(self, state: NavState) -> NavState:
        """A state of the back end as it is reported."""
        return replace(state, T_world_imu=self._moved(state.T_world_imu))

    def _moved(self, T: FloatArray) -> FloatArray:
        out = T.copy()
        out[..., :3, 3] += self._offset
        return out
