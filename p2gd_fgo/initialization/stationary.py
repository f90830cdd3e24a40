"""Is the body standing still? The IMU and the images must both say so.

A car at constant speed has a quiet IMU, and a distant scene hardly moves; only together do they
mean standstill. In traffic a part of the image moves while the body stands, so the images are asked
two things: do enough of the features stay where they are, and do those that stay have no motion in
common? What drives by moves its own features far. A body that creeps moves all of them, the far
ones by less than can be told from the tracker's noise one by one, but all the same way.
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
_MAX_HOLE = 0.2  # share of the window without an IMU sample
_SURE = 3  # times min_features whose common motion can end a standstill


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
        How far the features seen in both images moved, the share asked for by less, and their
        number.
    drift_px
        What the features that stayed have in common: shift, or growth of the image.
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
    drift_px: float
    score: float

    def describe(self, config: StationaryConfig) -> str:
        """The values beside their thresholds."""
        return (
            f"gyro deviation {self.gyro_std:.3g} rad/s (threshold {config.max_gyro_std:g}), "
            f"accelerometer deviation {self.accel_std:.3g} m/s² (threshold "
            f"{config.max_accel_std:g}), image motion {self.disparity_px:.3g} px over "
            f"{self.features} features (threshold {config.max_disparity_px:g} px, at least "
            f"{config.min_features} features), common drift {self.drift_px:.3g} px (threshold "
            f"{config.max_drift_px:g} px)"
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
        The image before was still. Then what drives by may take a larger part of the view, and
        where images are missing one older than the window will do: what is where it was has stood.
        Tracks that began together in a standstill end together, and leave hardly a feature with a
        past: then a shorter span of images will do, at last with fewer features than
        ``min_features``, and where none has a past the IMU decides.

    A buffer too short for the window, as with a fast camera, counts as far as it reaches.
    """
    begin_ns = stamp_ns - int(window_s * NANOSECONDS)
    slack = int(_MAX_STAMP_SLACK * window_s * NANOSECONDS)
    filled = np.flatnonzero(buffer.stamps_ns != -1)
    old = filled[buffer.stamps_ns[filled] <= begin_ns + slack // 10]
    if len(old) == 0 and len(filled) == buffer.history:
        old = filled[:1]
    quiet = imu_deviation(stamp_ns, imu, window_s)
    late = len(old) > 0 and int(buffer.stamps_ns[old[-1]]) < begin_ns - slack
    if quiet is None or len(old) == 0 or (late and not was_still):
        nan = float("nan")
        return Stillness(False, False, nan, nan, stamp_ns, nan, 0, nan, float("inf"))
    gyro_std, accel_std = quiet
    share = config.share_to_stay if was_still else config.share_to_stop
    span = buffer.history - 1 - int(old[-1])
    disparity, features, drift = _image_motion(buffer, span, share, config.max_disparity_px)
    while was_still and features < config.min_features and span > 1:
        span -= 1
        disparity, features, drift = _image_motion(buffer, span, share, config.max_disparity_px)
    if features >= config.min_features or (was_still and features > 0):
        seen = disparity / config.max_disparity_px
        if features >= config.min_features * (_SURE if was_still else 1):
            seen = max(seen, drift / config.max_drift_px)
    else:
        seen = 0.0 if was_still else float("inf")
    score = max(gyro_std / config.max_gyro_std, accel_std / config.max_accel_std, seen)
    since_ns = int(buffer.stamps_ns[-1 - span])
    return Stillness(
        score <= 1.0, True, gyro_std, accel_std, since_ns, disparity, features, drift, score
    )


def imu_deviation(stamp_ns: int, imu: ImuBatch, window_s: float) -> tuple[float, float] | None:
    """Deviation of gyro and accelerometer over a window; see :class:`Stillness`.

    None where the samples don't reach back over it, or have a hole in it.
    """
    begin_ns = stamp_ns - int(window_s * NANOSECONDS)
    if len(imu) < 2 or int(imu.stamps_ns[0]) > begin_ns:
        return None
    first = int(np.searchsorted(imu.stamps_ns, begin_ns, side="right")) - 1
    last = int(np.searchsorted(imu.stamps_ns, stamp_ns, side="left")) + 1
    steps = np.diff(imu.stamps_ns[first:last])
    if len(steps) == 0 or steps.max() > _MAX_HOLE * window_s * NANOSECONDS:
        return None
    part = between(imu, begin_ns, stamp_ns)
    return _deviation(part, part.gyro), _deviation(part, part.accel)


def imu_is_quiet(stamp_ns: int, imu: ImuBatch, config: StationaryConfig) -> bool:
    """Whether the IMU alone has nothing against a standstill."""
    found = imu_deviation(stamp_ns, imu, config.window_s)
    return (
        found is not None and found[0] <= config.max_gyro_std and found[1] <= config.max_accel_std
    )


def _image_motion(
    buffer: FeatureBuffer, span: int, share: float, still_px: float
) -> tuple[float, int, float]:
    """Motion over ``span`` images: that of the share's last feature, their number, the drift.

    The drift is the largest of three medians over the features that moved by less than
    ``still_px``: the shift along either axis, and the growth of the image about the features'
    middle, in px at their median distance from it. Each halves the tracker's noise with four times
    the features, and what has another direction on each feature cancels.
    """
    nan = float("nan")
    if not 0 < span < buffer.history:
        return nan, 0, nan
    moved = buffer.pixels - buffer.pixel_history[:, -1 - span]
    seen = np.isfinite(moved[:, 0])
    moved, at = moved[seen], buffer.pixels[seen]
    count = len(moved)
    if count == 0:
        return nan, 0, nan
    distance = np.linalg.norm(moved, axis=1)
    disparity = float(np.quantile(distance, share))
    stays = distance <= still_px
    if stays.sum() < 2:
        return disparity, count, nan
    moved, at = moved[stays], at[stays]
    shift = np.median(moved, axis=0)
    out = at - np.median(at, axis=0)
    reach = np.maximum(np.linalg.norm(out, axis=1), 1.0)
    outwards = np.sum((moved - shift) * out, axis=1)
    growth = float(np.median(outwards / reach**2) * np.median(reach))
    return disparity, count, max(abs(float(shift[0])), abs(float(shift[1])), abs(growth))


def _deviation(imu: ImuBatch, values: FloatArray) -> float:
    """Root of the summed variances of the means of values (N, 3) over 20 ms."""
    bins = (imu.stamps_ns - imu.stamps_ns[0]) // _MEAN_NS
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    sums = np.add.reduceat(values, starts, axis=0)
    sizes = np.diff(np.append(starts, len(values)))[:, None]
    # The last bin holds the window's end alone: fewer samples, more noise.
    means = (sums / sizes)[:-1] if len(starts) > 2 else values
    return float(np.sqrt(means.var(axis=0).sum()))
