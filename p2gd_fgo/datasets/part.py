"""From all that a recording holds to the part that is used, checked."""

from __future__ import annotations

from dataclasses import dataclass

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.integrity import check_coverage
from p2gd_fgo.datasets.slicing import cut_imu, cut_truth, select_images
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS, Event, ImuBatch, IntArray, Truth

_MAX_OFFSET_S = 86_400.0


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """The images in ``chosen``, and the IMU and truth around them; what is amiss in ``events``."""

    chosen: slice
    imu: ImuBatch
    truth: Truth | None
    events: list[Event]


def choose_part(
    image_stamps_ns: IntArray,
    imu: ImuBatch,
    truth: Truth | None,
    time_offset_s: float,
    config: DatasetConfig,
    max_gap_s: float,
) -> Part:
    """Cut to ``config.start_s`` and ``config.duration_s``, and compare what the sensors cover.

    Parameters
    ----------
    image_stamps_ns
        (N,) strictly increasing, on the camera's clock.
    time_offset_s
        t_imu = t_cam + offset.
    max_gap_s
        Longer holes in the IMU become an event.

    Raises
    ------
    DataError
        No image is left or none lies within the IMU's time; an offset of more than a day.
    """
    if abs(time_offset_s) > _MAX_OFFSET_S:
        raise DataError(
            f"the time offset is {time_offset_s:g} s, more than a day: dataset.time_offset_s and "
            "timeshift_cam_imu are in seconds"
        )
    chosen = select_images(image_stamps_ns, config.start_s, config.duration_s)
    on_imu_clock = image_stamps_ns[chosen] + round(time_offset_s * NANOSECONDS)
    if chosen != slice(0, len(image_stamps_ns)):
        span = int(on_imu_clock[0]), int(on_imu_clock[-1])
        imu = cut_imu(imu, *span)
        truth = None if truth is None else cut_truth(truth, *span)
    return Part(chosen, imu, truth, check_coverage(on_imu_clock, imu, truth, max_gap_s))
