"""IMU samples: buffering, interpolation at image stamps, and strapdown integration.

Both back ends integrate the same increments: between two neighbouring samples the rate and the
specific force are their mean (trapezoid), and the interval runs exactly from image to image
because the samples at its ends are interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, interpolation_weights
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray, NavState


@dataclass(frozen=True, slots=True, eq=False)
class ImuIncrements:
    """Constant-rate pieces of an interval.

    Attributes
    ----------
    dt_s
        (N,) durations.
    gyro, accel
        (N, 3) mean rate (rad/s) and specific force (m/s²) of each piece, biases still in.
    """

    dt_s: FloatArray
    gyro: FloatArray
    accel: FloatArray


def interpolate_imu(imu: ImuBatch, query_ns: IntArray) -> tuple[FloatArray, FloatArray]:
    """Gyro and accel (M, 3) at query_ns (M,), linear; the nearest sample outside the range."""
    i, j, w = interpolation_weights(imu.stamps_ns, query_ns)
    u = w[:, None]
    return (
        (1.0 - u) * imu.gyro[i] + u * imu.gyro[j],
        (1.0 - u) * imu.accel[i] + u * imu.accel[j],
    )


def between(imu: ImuBatch, start_ns: int, end_ns: int) -> ImuBatch:
    """The samples from start to end, both ends interpolated.

    Raises
    ------
    ValueError
        No samples, or the interval is empty.
    """
    if len(imu) == 0 or end_ns <= start_ns:
        raise ValueError("between() needs samples and an interval of positive length")
    first = np.searchsorted(imu.stamps_ns, start_ns, side="right")
    last = np.searchsorted(imu.stamps_ns, end_ns, side="left")
    ends = np.array([start_ns, end_ns], dtype=np.int64)
    gyro, accel = interpolate_imu(imu, ends)
    inner = slice(first, last)
    return ImuBatch(
        np.concatenate([ends[:1], imu.stamps_ns[inner], ends[1:]]),
        np.concatenate([gyro[:1], imu.gyro[inner], gyro[1:]]),
        np.concatenate([accel[:1], imu.accel[inner], accel[1:]]),
    )


def increments(imu: ImuBatch) -> ImuIncrements:
    """Trapezoid pieces of consecutive samples (N samples give N − 1 pieces)."""
    return ImuIncrements(
        np.diff(imu.stamps_ns) / NANOSECONDS,
        0.5 * (imu.gyro[1:] + imu.gyro[:-1]),
        0.5 * (imu.accel[1:] + imu.accel[:-1]),
    )


def integrate(state: NavState, imu: ImuBatch, gravity: float) -> NavState:
    """Strapdown integration over all samples, exact for piecewise constant rate and force.

    Per piece, with φ = ω dt and Γ₁, Γ₂ the first and second integral of the rotation:
    v ← v + g dt + R Γ₁(φ) a dt and p ← p + v dt + g dt²/2 + R Γ₂(φ) a dt².
    """
    pieces = increments(imu)
    dt = pieces.dt_s[:, None]
    phi = (pieces.gyro - state.gyro_bias) * dt
    a = pieces.accel - state.accel_bias
    steps = so3.exp(phi)
    dv = (so3.right_jacobian(-phi) @ a[..., None])[..., 0] * dt
    dp = (so3.second_integral(phi) @ a[..., None])[..., 0] * dt * dt
    R = state.T_world_imu[:3, :3]
    p = state.T_world_imu[:3, 3]
    v = state.velocity
    g = np.array([0.0, 0.0, -gravity])
    for k, h in enumerate(pieces.dt_s):
        p = p + v * h + 0.5 * g * h * h + R @ dp[k]
        v = v + g * h + R @ dv[k]
        R = R @ steps[k]
    R = so3.from_quaternion(so3.to_quaternion(R))
    return NavState(
        int(imu.stamps_ns[-1]),
        from_rotation_translation(R, p),
        v,
        state.gyro_bias,
        state.accel_bias,
    )


def rotation_over(imu: ImuBatch, gyro_bias: FloatArray) -> FloatArray:
    """R_first_last (3, 3): takes vectors of the IMU at the last sample to the IMU at the first."""
    pieces = increments(imu)
    R = np.eye(3)
    for step in so3.exp((pieces.gyro - gyro_bias) * pieces.dt_s[:, None]):
        R = R @ step
    return R


class ImuBuffer:
    """Samples as they arrive, until the image that they lead to has been processed."""

    def __init__(self) -> None:
        self._chunks: list[ImuBatch] = []

    def add(self, imu: ImuBatch) -> None:
        """Append samples that are later than all before.

        Raises
        ------
        DataError
            A sample is not finite, or not later than its predecessor.
        """
        if len(imu) == 0:
            return
        if not (np.isfinite(imu.gyro).all() and np.isfinite(imu.accel).all()):
            raise DataError("an IMU sample is not finite: drop it before handing it in")
        previous = self._chunks[-1].stamps_ns[-1:] if self._chunks else imu.stamps_ns[:0]
        steps = np.diff(np.concatenate([previous, imu.stamps_ns]))
        if (steps <= 0).any():
            raise DataError(
                "IMU stamps must increase, but one is not later than the sample before it: sort "
                "and deduplicate them first"
            )
        self._chunks.append(imu)

    def samples(self) -> ImuBatch:
        """Everything held."""
        if len(self._chunks) > 1:
            merged = ImuBatch(
                np.concatenate([c.stamps_ns for c in self._chunks]),
                np.concatenate([c.gyro for c in self._chunks]),
                np.concatenate([c.accel for c in self._chunks]),
            )
            self._chunks = [merged]
        if not self._chunks:
            return ImuBatch(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
        return self._chunks[0]

    def drop_before(self, stamp_ns: int) -> None:
        """Forget samples that no interval from ``stamp_ns`` on needs."""
        held = self.samples()
        first = max(int(np.searchsorted(held.stamps_ns, stamp_ns, side="right")) - 1, 0)
        if first > 0:
            keep = slice(first, None)
            self._chunks = [ImuBatch(held.stamps_ns[keep], held.gyro[keep], held.accel[keep])]
