"""Takes prior poses in, one image after the other, and says what is wrong with them."""

from __future__ import annotations

import math

import numpy as np

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.errors import DataError
from p2gd_fgo.priors.base import PriorProblem, PriorSource
from p2gd_fgo.priors.contradiction import ContradictionCheck
from p2gd_fgo.priors.resampling import LONGEST_HOLE_S, resample
from p2gd_fgo.types import NANOSECONDS, IntArray, PriorPoses, Trajectory

_LEAST_SHARE = 0.25
_ORTHONORMAL = 1e-3  # largest entry of RᵀR − I; a quaternion written with four digits passes

_IDENTITY = np.eye(3)
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


class PriorIntake:
    """Checks prior poses before anything relies on them.

    Parameters
    ----------
    source
        Asked where the caller hands in nothing.
    horizon
        Images ahead.
    config
        Whether, and how, priors are compared with the motion that followed.
    """

    def __init__(
        self, source: PriorSource, horizon: int, config: PriorsConfig | None = None
    ) -> None:
        config = config or PriorsConfig()
        self._source = source
        self._horizon = horizon
        self._check = ContradictionCheck(config, horizon) if config.check else None

    def take(
        self, stamp_ns: int, handed: PriorPoses | None, recent: Trajectory
    ) -> PriorPoses | PriorProblem:
        """Prior poses at the times of the next images, at most ``horizon`` of them.

        Fewer where the poses or the recording end sooner, none at the recording's last image.

        Parameters
        ----------
        stamp_ns
            Of the current image.
        handed
            What the caller handed in with it, at any rate.
        recent
            The estimate's window, the current pose included, newest last; not empty.

        Raises
        ------
        DataError
            Something else than ``PriorPoses`` handed in, or stamps and poses of shapes that
            don't fit.
        """
        if handed is not None and not isinstance(handed, PriorPoses):
            raise DataError(
                f"prior poses were handed in as a {type(handed).__name__}: hand in a "
                "PriorPoses(stamps_ns, T_imu0_imu) from p2gd_fgo.types"
            )
        times_ns = self._source.image_times.after(stamp_ns, recent, self._horizon)
        if times_ns is not None and len(times_ns) == 0:
            return PriorPoses(times_ns, np.zeros((0, 4, 4)))
        priors = self._source.poses(stamp_ns, recent) if handed is None else handed
        if priors is None or len(priors.stamps_ns) == 0:
            return PriorProblem("priors_missing", f"no prior poses ({self._source.description})")
        problem = _malformed(priors)
        if problem is not None:
            return problem
        if times_ns is None:
            times_ns = priors.stamps_ns[priors.stamps_ns > stamp_ns][: self._horizon]
        count = len(priors.stamps_ns)
        if not np.array_equal(priors.stamps_ns, times_ns[:count]):
            last_ns = int(priors.stamps_ns[-1])
            if len(times_ns) == 0 or last_ns < times_ns[0]:
                return _late(last_ns, stamp_ns, times_ns)
            priors = resample(priors, stamp_ns, times_ns)
            count = len(priors.stamps_ns)
        needed = math.ceil(_LEAST_SHARE * len(times_ns))
        if count < needed:
            return PriorProblem(
                "priors_too_few",
                f"prior poses reach {count} of the next {len(times_ns)} images without a hole "
                f"above {LONGEST_HOLE_S:g} s, fewer than {needed}",
            )
        if self._check is not None and (handed is not None or self._source.independent):
            reason = self._check.reason(stamp_ns, priors, recent)
            if reason is not None:
                return PriorProblem("priors_contradicted", reason)
        return priors


def _malformed(priors: PriorPoses) -> PriorProblem | None:
    """What is wrong with the poses in themselves."""
    stamps_ns, T = priors.stamps_ns, priors.T_imu0_imu
    count = len(stamps_ns)
    if stamps_ns.shape != (count,) or T.shape != (count, 4, 4):
        raise DataError(
            f"prior poses have stamps of shape {stamps_ns.shape} and poses of shape {T.shape}: "
            "hand in (N,) and (N, 4, 4)"
        )
    later = stamps_ns[1:] > stamps_ns[:-1]
    if not later.all():
        at = int(np.argmin(later))
        back_s = int(stamps_ns[at] - stamps_ns[at + 1]) / NANOSECONDS
        return PriorProblem(
            "priors_unordered",
            f"prior pose {at + 1} comes {back_s:.3f} s before pose {at}, stamps must increase",
        )
    finite = np.isfinite(T)
    if not finite.all():
        bad = count - int(finite.all(axis=(1, 2)).sum())
        return PriorProblem(
            "priors_not_finite", f"{bad} of {count} prior poses hold NaN or infinity"
        )
    R = T[:, :3, :3]
    off = float(np.abs(R.transpose(0, 2, 1) @ R - _IDENTITY).max())
    if off > _ORTHONORMAL or (np.linalg.det(R) < 0.0).any() or (T[:, 3] != _LAST_ROW).any():
        return PriorProblem(
            "priors_not_rigid",
            f"a prior pose is no rigid transform: RᵀR is off the identity by {off:.2g} (threshold "
            f"{_ORTHONORMAL:g}), or R mirrors, or the last row is not 0 0 0 1",
        )
    return None


def _late(last_ns: int, stamp_ns: int, times_ns: IntArray) -> PriorProblem:
    behind_s = (stamp_ns - last_ns) / NANOSECONDS
    if len(times_ns) == 0 or behind_s >= 0.0:
        return PriorProblem(
            "priors_late", f"the last prior pose lies {behind_s:.3f} s before the image"
        )
    short_s = (times_ns[0] - last_ns) / NANOSECONDS
    return PriorProblem(
        "priors_late", f"the last prior pose lies {short_s:.3f} s before the next image"
    )
