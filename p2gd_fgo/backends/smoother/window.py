"""The states of the sliding window as arrays, and their chart.

The error of a state in the window is GTSAM's: (δθ, δp in the IMU frame, δv, δb_a, δb_g), with
R = R̂ Exp(δθ), p = p̂ + R̂ δp.
"""

from __future__ import annotations

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, V, X

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import ERROR_DIM, FloatArray, NavState, Trajectory

# Position in our error (δθ, δp, δv, δb_g, δb_a) of each entry of GTSAM's order.
_TO_ERROR_ORDER = np.r_[0:9, 12:15, 9:12]


@dataclass(frozen=True, slots=True, eq=False)
class WindowStates:
    """n states, oldest first.

    Attributes
    ----------
    frames
        (n,) frame numbers, increasing: the keys are X(k), V(k), B(k).
    stamps_ns
        (n,)
    R, p, v
        (n, 3, 3), (n, 3), (n, 3): world from IMU, velocity in the world.
    bias
        (n, 6) accelerometer then gyroscope.
    """

    frames: tuple[int, ...]
    stamps_ns: tuple[int, ...]
    R: FloatArray
    p: FloatArray
    v: FloatArray
    bias: FloatArray

    def __len__(self) -> int:
        return len(self.frames)

    @classmethod
    def empty(cls) -> WindowStates:
        """No states."""
        return cls(
            (), (), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 6))
        )

    def append(self, frame: int, state: NavState) -> WindowStates:
        """With one state more at the end."""
        T = state.T_world_imu
        bias = np.concatenate([state.accel_bias, state.gyro_bias])
        return WindowStates(
            (*self.frames, frame),
            (*self.stamps_ns, state.stamp_ns),
            np.concatenate([self.R, T[None, :3, :3]]),
            np.concatenate([self.p, T[None, :3, 3]]),
            np.concatenate([self.v, state.velocity[None]]),
            np.concatenate([self.bias, bias[None]]),
        )

    def part(self, index: slice) -> WindowStates:
        """The states of a slice."""
        return WindowStates(
            self.frames[index], self.stamps_ns[index],
            self.R[index], self.p[index], self.v[index], self.bias[index],
        )  # fmt: skip

    def retract(self, delta: FloatArray) -> WindowStates:
        """Moved by delta (n · 15,)."""
        d = delta.reshape(-1, ERROR_DIM)
        return WindowStates(
            self.frames,
            self.stamps_ns,
            self.R @ so3.exp(d[:, 0:3]),
            self.p + (self.R @ d[:, 3:6, None])[..., 0],
            self.v + d[:, 6:9],
            self.bias + d[:, 9:15],
        )

    def local(self, other: WindowStates) -> FloatArray:
        """The delta (n, 15) with ``self.retract(delta) == other``."""
        Rt = np.swapaxes(self.R, -1, -2)
        return np.concatenate(
            [
                so3.log(Rt @ other.R),
                (Rt @ (other.p - self.p)[..., None])[..., 0],
                other.v - self.v,
                other.bias - self.bias,
            ],
            axis=1,
        )

    def equals(self, other: WindowStates) -> bool:
        """Whether all numbers are the same."""
        pairs = ((self.R, other.R), (self.p, other.p), (self.v, other.v), (self.bias, other.bias))
        return all(np.array_equal(mine, theirs) for mine, theirs in pairs)

    def newest(self) -> NavState:
        """The last state."""
        return NavState(
            self.stamps_ns[-1],
            from_rotation_translation(self.R[-1], self.p[-1]),
            self.v[-1].copy(),
            self.bias[-1, 3:].copy(),
            self.bias[-1, :3].copy(),
        )

    def trajectory(self) -> Trajectory:
        """The poses."""
        return Trajectory(
            np.array(self.stamps_ns, dtype=np.int64), from_rotation_translation(self.R, self.p)
        )

    def keys(self) -> list[int]:
        """GTSAM keys in the order of the dense system: X, V, B of each state."""
        return [key for k in self.frames for key in (X(k), V(k), B(k))]

    def values(self, anchor: FloatArray) -> gtsam.Values:
        """GTSAM's view of the states, positions counted from ``anchor`` (3,)."""
        values = gtsam.Values()
        for n, k in enumerate(self.frames):
            bias = gtsam.imuBias.ConstantBias(self.bias[n, :3], self.bias[n, 3:])
            values.insert(X(k), pose3=gtsam.Pose3(gtsam.Rot3(self.R[n]), self.p[n] - anchor))
            values.insert(V(k), vector=self.v[n])
            # By keyword: by position the wrapper tries 43 other types first, 29 µs a call.
            values.insert(B(k), constant_bias=bias)
        return values


def error_covariance(covariance: FloatArray, R: FloatArray) -> FloatArray:
    """(15, 15) of GTSAM's error made that of (δθ, δp in the world, δv, δb_g, δb_a)."""
    out = covariance[np.ix_(_TO_ERROR_ORDER, _TO_ERROR_ORDER)]
    out[3:6] = R @ out[3:6]
    out[:, 3:6] = out[:, 3:6] @ R.T
    return np.asarray(0.5 * (out + out.T))


def window_covariance(covariance: FloatArray, R: FloatArray) -> FloatArray:
    """The inverse of :func:`error_covariance`."""
    out = covariance.copy()
    out[3:6] = R.T @ out[3:6]
    out[:, 3:6] = out[:, 3:6] @ R
    return np.asarray(out[np.ix_(_TO_ERROR_ORDER, _TO_ERROR_ORDER)])
