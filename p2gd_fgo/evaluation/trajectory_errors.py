"""Absolute and relative errors of a trajectory, from evo's error poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.evaluation.evo_bridge import absolute_errors, relative_errors
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of errors, in their unit."""

    rmse: float
    mean: float
    median: float
    max: float


@dataclass(frozen=True, slots=True)
class RelativeError:
    """Errors over pieces of one length.

    Attributes
    ----------
    length_m
        Path length of the piece on the reference.
    rmse_m, percent
        RTE: RMSE of the relative translation, and the same over the length.
    rre_deg
        RRE: RMSE of the relative rotation.
    pairs
        Number of pieces.
    """

    length_m: float
    rmse_m: float
    percent: float
    rre_deg: float
    pairs: int


def statistics(errors: FloatArray) -> Statistics:
    """Statistics of errors (N,), N > 0."""
    return Statistics(
        rmse=rmse(errors),
        mean=float(np.mean(errors)),
        median=float(np.median(errors)),
        max=float(np.max(errors)),
    )


def rmse(errors: FloatArray) -> float:
    """Root mean square of (N,)."""
    return float(np.sqrt(np.mean(errors * errors)))


def absolute(estimate: FloatArray, reference: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance in m and angle in degrees, (N,) each, of poses (N, 4, 4) that are aligned."""
    E = absolute_errors(estimate, reference)
    return np.linalg.norm(E[:, :3, 3], axis=1), so3.angle_deg(E[:, :3, :3])


def relative(
    estimate: FloatArray, reference: FloatArray, lengths_m: Sequence[float], tolerance: float
) -> tuple[RelativeError, ...]:
    """RTE and RRE over all pairs of each length; a length that doesn't fit is absent.

    ``estimate`` and ``reference`` (N, 4, 4) at the same stamps; neither need be aligned. A pair
    may miss its length by the share ``tolerance``, but a reference shorter than a length has none
    of it.
    """
    path_m = path_length(reference)
    out = []
    for length in lengths_m:
        if length > path_m:
            continue
        E = relative_errors(estimate, reference, length, tolerance)
        if len(E):
            error_m = rmse(np.linalg.norm(E[:, :3, 3], axis=1))
            error_deg = rmse(so3.angle_deg(E[:, :3, :3]))
            out.append(RelativeError(length, error_m, 100.0 * error_m / length, error_deg, len(E)))
    return tuple(out)


def path_length(poses: FloatArray) -> float:
    """Metres along poses (N, 4, 4)."""
    return float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
