"""IMU samples: buffering, interpolation at image stamps, and strapdown integration.

Both back ends integrate the same increments: between two neighbouring samples the rate and the
specific force run linearly, and the interval runs exactly from image to image because the samples
at its ends are interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, interpolation_weights
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, IntArray, NavState

_BRIDGE_STEP_S = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class ImuIncrements:
    """Constant-rate pieces of an interval.

    Attributes
    ----------
    dt_s
        (N,) durations.
    gyro, accel
        (N, 3) rate (rad/s) and specific force (m/s²) of each piece, biases still in.
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


@dataclass(frozen=True, slots=True, eq=False)
class UnknownMotion:
    """White noise that stands for what was not measured, for each step between N samples.

    Attributes
    ----------
    gyro, accel
        (N − 1,) densities beside the sensor's own, rad/s/√Hz and m/s²/√Hz; 0 where nothing is
        missing.
    longest_s
        The longest hole that the samples touch, its part outside them included.
    """

    gyro: FloatArray
    accel: FloatArray
    longest_s: float


def across_holes(
    imu: ImuBatch, part: ImuBatch, max_gap_s: float, sigma_rate: float, sigma_accel: float
) -> tuple[ImuBatch, UnknownMotion | None]:
    """Bridge the holes in a part of the samples, and say what is not known of them.

    In a hole of length T between two samples the motion may differ from the straight line between
    them by a constant rate and force of these sigmas. The density σ √T gives the change of
    velocity over the hole that such a constant has, σ T, and a shift of σ T²/√3, not less than
    its σ T²/2.

    Parameters
    ----------
    imu
        As they were measured.
    part
        (:func:`between`) from one image to the next.
    max_gap_s
        A longer step between samples is a hole.
    sigma_rate, sigma_accel
        rad/s and m/s².

    Returns
    -------
    tuple[ImuBatch, UnknownMotion | None]
        The part with samples of the straight line in its holes, close enough for integration, and
        the noise of its steps; the part itself and None where there is no hole.
    """
    length_s = _measured_step_s(imu, part)
    if not (length_s > max_gap_s).any():
        return part, None
    pieces = np.ceil(np.diff(part.stamps_ns) / (_BRIDGE_STEP_S * NANOSECONDS)).astype(np.int64)
    pieces = np.where(length_s > max_gap_s, pieces, 1)
    ends = np.repeat(part.stamps_ns[1:], pieces)
    begins = np.repeat(part.stamps_ns[:-1], pieces)
    nth = np.arange(len(ends)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    stamps = begins + (ends - begins) * nth // np.repeat(pieces, pieces)
    stamps = np.append(stamps, part.stamps_ns[-1:])
    bridged = ImuBatch(stamps, *interpolate_imu(part, stamps))
    length_s = np.repeat(length_s, pieces)
    root = np.sqrt(np.where(length_s > max_gap_s, length_s, 0.0))
    return bridged, UnknownMotion(sigma_rate * root, sigma_accel * root, float(length_s.max()))


def has_hole(imu: ImuBatch, part: ImuBatch, max_gap_s: float) -> bool:
    """Whether a part of the samples touches a step between them longer than ``max_gap_s``."""
    return bool((_measured_step_s(imu, part) > max_gap_s).any())


def whole_since(imu: ImuBatch, stamp_ns: int, max_gap_s: float) -> int:
    """From when on the samples reach to ``stamp_ns`` without a hole: its end, or the first one."""
    before = imu.stamps_ns[: int(np.searchsorted(imu.stamps_ns, stamp_ns)) + 1]
    holes = np.flatnonzero(np.diff(before) > max_gap_s * NANOSECONDS)
    return int(before[holes[-1] + 1] if len(holes) else before[0])


def _measured_step_s(imu: ImuBatch, part: ImuBatch) -> FloatArray:
    """Time (N − 1,) between the measured samples around each step of a part."""
    step = np.searchsorted(imu.stamps_ns, part.stamps_ns[:-1], side="right") - 1
    return np.asarray(np.diff(imu.stamps_ns)[np.clip(step, 0, len(imu) - 2)] / NANOSECONDS)


def increments(imu: ImuBatch) -> ImuIncrements:
    """Two pieces of constant rate and force for each two neighbouring samples.

    N samples give 2 (N − 1) pieces: halves of the time between a and b, with the values
    (a + b)/2 ∓ (b − a)/3. Their first and second integrals are those of the straight line from a
    to b, so that rotation, velocity and position are all of third order in the sample interval;
    the mean alone leaves (b − a) dt²/12 of position, and as much of tilt in the velocity.
    """
    half_s = np.repeat(np.diff(imu.stamps_ns) / (2.0 * NANOSECONDS), 2)
    return ImuIncrements(half_s, _line_halves(imu.gyro), _line_halves(imu.accel))


def _line_halves(samples: FloatArray) -> FloatArray:
    mean = 0.5 * (samples[1:] + samples[:-1])
    slope = np.diff(samples, axis=0) / 3.0
    return np.stack([mean - slope, mean + slope], axis=1).reshape(-1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class StrapdownPath:
    """Motion through N pieces, at their N + 1 ends: ``R`` (., 3, 3), ``v`` and ``p`` (., 3)."""

    R: FloatArray
    v: FloatArray
    p: FloatArray


def strapdown(state: NavState, pieces: ImuIncrements, gravity: float) -> StrapdownPath:
    """Exact integration of piecewise constant rate and force from ``state``.

    Per piece, with φ = ω dt and Γ₁, Γ₂ the first and second integral of the rotation:
    v ← v + g dt + R Γ₁(φ) a dt and p ← p + v dt + g dt²/2 + R Γ₂(φ) a dt².
    """
    dt = pieces.dt_s[:, None]
    phi = (pieces.gyro - state.gyro_bias) * dt
    a = (pieces.accel - state.accel_bias)[..., None]
    R = np.empty((len(phi) + 1, 3, 3))
    R[0] = state.T_world_imu[:3, :3]
    for k, step in enumerate(so3.exp(phi)):
        np.matmul(R[k], step, out=R[k + 1])
    g = np.array([0.0, 0.0, -gravity])
    dv = (R[:-1] @ (so3.right_jacobian(-phi) @ a))[..., 0] * dt + g * dt
    v = np.cumsum(np.concatenate([state.velocity[None], dv]), axis=0)
    dp = (R[:-1] @ (so3.second_integral(phi) @ a))[..., 0] * dt**2 + (0.5 * g * dt + v[:-1]) * dt
    p = np.cumsum(np.concatenate([state.T_world_imu[None, :3, 3], dp]), axis=0)
    return StrapdownPath(R, v, p)


def duration_s(imu: ImuBatch) -> float:
    """From the first sample to the last."""
    return float(imu.stamps_ns[-1] - imu.stamps_ns[0]) / NANOSECONDS


def integrate(state: NavState, imu: ImuBatch, gravity: float) -> NavState:
    """The state at the last sample, from ``state`` at the first (:func:`strapdown`)."""
    path = strapdown(state, increments(imu), gravity)
    R = so3.from_quaternion(so3.to_quaternion(path.R[-1]))
    return NavState(
        int(imu.stamps_ns[-1]),
        from_rotation_translation(R, path.p[-1]),
        path.v[-1],
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


EARTH_RATE = 7.292115e-5
"""Rotation of the Earth against the stars, rad/s."""


def earth_rate(latitude_deg: float, heading_deg: float) -> FloatArray:
    """Rotation of the Earth (3,) in the world, whose x axis is ``heading_deg`` from east, rad/s."""
    latitude, heading = np.radians([latitude_deg, heading_deg])
    north = EARTH_RATE * np.cos(latitude)
    return np.array(
        [north * np.sin(heading), north * np.cos(heading), EARTH_RATE * np.sin(latitude)]
    )


def without_earth_rotation(
    imu: ImuBatch, state: NavState, gravity: float, rate: FloatArray
) -> ImuBatch:
    """Samples as they would be in a world that doesn't turn.

    The gyro feels Rᵀ ω_e, the accelerometer the Coriolis force Rᵀ (2 ω_e × v); gravity holds the
    centrifugal one already. R and v are those of the strapdown path from ``state`` at the first
    sample; what they are wrong by counts 7e-5-fold.

    Parameters
    ----------
    rate
        (3,) as :func:`earth_rate` gives it.
    """
    path = strapdown(state, increments(imu), gravity)
    R, v = path.R[::2], path.v[::2]
    return ImuBatch(
        imu.stamps_ns, imu.gyro - rate @ R, imu.accel - (np.cross(2.0 * rate, v)[:, None] @ R)[:, 0]
    )


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
