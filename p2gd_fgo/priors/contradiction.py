"""Compares what was planned with what was driven since."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.priors.screw import interpolate_screws
from p2gd_fgo.types import FloatArray, PriorPoses, Trajectory

_COMPARED = 10
_LEAST_COMPARED = 5
_AGREEING_AGAIN = 10
_SHORTEST_LAG = 5
_SIGMAS = 3.0
_ESTIMATE_ERROR = 0.03  # m; what the estimate itself may be off over half a horizon


class ContradictionCheck:
    """Whether the estimate's motion contradicts the prior poses handed in for it.

    At every image the poses handed in half a horizon ago are laid beside the motion estimated
    since, both relative to the body of that time. The last ten such looks back are judged
    together: the planned positions' mean error, which must be above its own scatter to count; their
    RMS error; the RMS error of the rotations. White noise averages out of the first, so that it is
    told from a wrong scale or direction.

    Once contradicted, priors are believed again after ten agreeing looks back in a row.

    Parameters
    ----------
    config
        Thresholds.
    horizon
        Images ahead.
    """

    def __init__(self, config: PriorsConfig, horizon: int) -> None:
        self._config = config
        self._horizon = horizon
        self._handed: dict[int, PriorPoses] = {}
        self._looks: deque[FloatArray] = deque(maxlen=_COMPARED)
        self._reason: str | None = None
        self._agreeing = 0

    def reason(self, stamp_ns: int, priors: PriorPoses, recent: Trajectory) -> str | None:
        """Why priors are not believed, or None; ``priors`` are kept for later looks back.

        Parameters
        ----------
        stamp_ns
            Of the current image.
        priors
            What was handed in with it, at the times of the next images.
        recent
            The estimate's window, the current pose included, newest last.
        """
        look = self._look_back(recent)
        self._handed[stamp_ns] = priors
        while (oldest_ns := next(iter(self._handed))) < recent.stamps_ns[0]:
            del self._handed[oldest_ns]
        if look is not None:
            self._looks.append(look)
            if len(self._looks) >= _LEAST_COMPARED:
                self._believe_or_not(self._contradiction())
        return self._reason

    def _believe_or_not(self, found: str | None) -> None:
        if found is not None:
            self._reason, self._agreeing = found, 0
        elif self._reason is not None:
            self._agreeing += 1
            if self._agreeing >= _AGREEING_AGAIN:
                self._reason = None

    def _look_back(self, recent: Trajectory) -> FloatArray | None:
        """(K, 7) planned position, driven position, rad between the rotations, of K poses.

        In the body frame in which they were handed in.
        """
        lag = min(self._horizon, len(recent)) // 2
        if lag == 0 or lag < min(_SHORTEST_LAG, self._horizon // 2):
            return None
        priors = self._handed.get(int(recent.stamps_ns[-1 - lag]))
        if priors is None:
            return None
        count = int(np.searchsorted(priors.stamps_ns, recent.stamps_ns[-1], side="right"))
        if count == 0:
            return None
        stamps_ns, T = priors.stamps_ns[:count], priors.T_imu0_imu[:count]
        since = slice(len(recent) - lag, len(recent) - lag + count)
        driven = recent.T_world_imu[since]
        if not np.array_equal(stamps_ns, recent.stamps_ns[since]):
            driven = interpolate_screws(recent, stamps_ns)
        R, p = recent.T_world_imu[-1 - lag, :3, :3], recent.T_world_imu[-1 - lag, :3, 3]
        trace = ((R @ T[:, :3, :3]) * driven[:, :3, :3]).sum(axis=(1, 2))
        look = np.empty((count, 7))
        look[:, :3] = T[:, :3, 3]
        look[:, 3:6] = (driven[:, :3, 3] - p) @ R
        look[:, 6] = np.arccos(np.minimum(np.maximum(0.5 * (trace - 1.0), -1.0), 1.0))
        return look

    def _contradiction(self) -> str | None:
        """What the last looks back say against the priors."""
        config, number = self._config, len(self._looks)
        count = min(len(look) for look in self._looks)
        looks = np.array([look[:count] for look in self._looks])
        planned, driven, turn = looks[:, :, :3], looks[:, :, 3:6], looks[:, :, 6]
        error = planned - driven
        noise, motion = _rms(error), _rms(driven)
        if noise > motion + config.max_noise:
            return (
                f"prior positions are {noise:.1f} m (RMS) off the motion that followed, more than "
                f"its {motion:.1f} m and {config.max_noise:g} m"
            )
        error_sum, planned_sum = error.sum(axis=0), planned.sum(axis=0)
        mean = _rms(error_sum) / number
        scatter = math.sqrt(max(noise * noise - mean * mean, 0.0) / (number - 1))
        way = max(_rms(planned_sum), _rms(planned_sum - error_sum)) / number
        limit = config.max_deviation * way + _SIGMAS * scatter + _ESTIMATE_ERROR
        if mean > limit:
            return (
                f"prior positions are {mean:.2f} m off the motion that followed in the mean of "
                f"{number} images (threshold {limit:.2f} m)"
            )
        turn_deg = math.degrees(math.sqrt(float(np.vdot(turn, turn)) / turn.size))
        if turn_deg > config.max_turn_error_deg:
            return (
                f"prior poses are {turn_deg:.0f}° (RMS) off the rotation that followed (threshold "
                f"{config.max_turn_error_deg:g}°)"
            )
        return None


def _rms(vectors: FloatArray) -> float:
    """Root mean square length of vectors (..., 3)."""
    return math.sqrt(3.0 * float(np.vdot(vectors, vectors)) / vectors.size)
