"""Is the body standing still? The IMU and the images must both say so.

A car at constant speed has a quiet IMU, and a distant scene hardly moves; only together do they
mean standstill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.config import StationaryConfig
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.imu import between
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch

_MEAN_NS = 20_000_000
_MAX_STAMP_SLACK = 0.25  # share of the window by which an image may be older than its beginning


@dataclass(frozen=True, slots=True)
class Stillness:
    """What was measured over the window, and the verdict.

    Attributes
    ----------
    still
        All tests passed.
    covered
        IMU and images reach back over the whole window.
    gyro_std, accel_std
        Root of the summed variances over the axes, rad/s and m/s², of means over 20 ms: the
        sensor's white noise, which grows with its rate, stays out.
    since_ns
        The image that the newest one was compared with: the beginning of the window, or later
        where the features don't reach back so far.
    disparity_px, features
        Median shift of the features seen in both images, and their number.
    score
        The largest ratio of a value to its threshold: 1 and less is still.
    """

    still: bool
    covered: bool
    gyro_std: float
    accel_std: float
    since_ns: int
    disparity_px: float
    features: int
    score: float

    def describe(self, config: StationaryConfig) -> str:
        """The values beside their thresholds."""
        return (
            f"gyro deviation {self.gyro_std:.3g} rad/s (threshold {config.max_gyro_std:g}), "
            f"accelerometer deviation {self.accel_std:.3g} m/s² (threshold "
            f"{config.max_accel_std:g}), image motion {self.disparity_px:.3g} px over "
            f"{self.features} features (threshold {config.max_disparity_px:g} px, at least "
            f"{config.min_features} features)"
        )


def stillness(
    stamp_ns: int,
    imu: ImuBatch,
    buffer: FeatureBuffer,
    window_s: float,
    config: StationaryConfig,
    *,
    was_still: bool = False,
) -> Stillness:
    """Judge the window that ends at the image.

    Parameters
    ----------
    stamp_ns
        Time of the newest image in ``buffer``, on the IMU's clock.
    imu
        Samples that reach back over the window, if there are any so old.
    was_still
        The image before was still. Tracks that began together in a standstill end together, and
        leave hardly a feature with a past. So then a shorter span of images will do, at last with
        fewer features than ``min_features``, and where none has a past the IMU decides.

    A buffer too short for the window, as with a fast camera, counts as far as it reaches.
    """
    begin_ns = stamp_ns - int(window_s * NANOSECONDS)
    slack = int(_MAX_STAMP_SLACK * window_s * NANOSECONDS)
    filled = np.flatnonzero(buffer.stamps_ns != -1)
    old = filled[buffer.stamps_ns[filled] <= begin_ns + slack // 10]
    if len(old) == 0 and len(filled) == buffer.history:
        old = filled[:1]
    covered = (
        len(old) > 0
        and int(buffer.stamps_ns[old[-1]]) >= begin_ns - slack
        and len(imu) > 1
        and int(imu.stamps_ns[0]) <= begin_ns
    )
    if not covered:
        nan = float("nan")
        return Stillness(False, False, nan, nan, stamp_ns, nan, 0, float("inf"))
    part = between(imu, begin_ns, stamp_ns)
    gyro_std, accel_std = _deviation(part, part.gyro), _deviation(part, part.accel)
    span = buffer.history - 1 - int(old[-1])
    disparity, features = buffer.disparity_px(span)
    while was_still and features < config.min_features and span > 1:
        span -= 1
        disparity, features = buffer.disparity_px(span)
    if features >= config.min_features or (was_still and features > 0):
        seen = disparity / config.max_disparity_px
    else:
        seen = 0.0 if was_still else float("inf")
    score = max(gyro_std / config.max_gyro_std, accel_std / config.max_accel_std, seen)
    since_ns = int(buffer.stamps_ns[-1 - span])
    return Stillness(score <= 1.0, True, gyro_std, accel_std, since_ns, disparity, features, score)


def _deviation(imu: ImuBatch, values: FloatArray) -> float:
    """Root of the summed variances of the means of values (N, 3) over 20 ms."""
    bins = (imu.stamps_ns - imu.stamps_ns[0]) // _MEAN_NS
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    sums = np.add.reduceat(values, starts, axis=0)
    sizes = np.diff(np.append(starts, len(values)))[:, None]
    # The last bin holds the window's end alone: fewer samples, more noise.
    means = (sums / sizes)[:-1] if len(starts) > 2 else values
    return float(np.sqrt(means.var(axis=0).sum()))
