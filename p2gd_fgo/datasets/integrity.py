"""What a recording may lack, and what is made of it: refused, or mended with an event."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import MAX_TRUTH_GAP_S, covered
from p2gd_fgo.types import NANOSECONDS, Event, ImuBatch, IntArray, Truth


def increasing_order(stamps_ns: IntArray, sensor: str) -> tuple[IntArray, list[Event]]:
    """Index (M,) that brings stamps (N,) into strictly increasing order, and what it mended.

    Of samples with the same stamp the first is kept.
    """
    order = np.argsort(stamps_ns, kind="stable")
    ordered = stamps_ns[order]
    keep = np.concatenate([[True], np.diff(ordered) > 0])
    late = stamps_ns[1:] < np.maximum.accumulate(stamps_ns)[:-1]
    events = []
    if late.any():
        stamp, count = int(stamps_ns[1:][late][0]), int(late.sum())
        message = f"{count} {sensor} samples were older than the one before and have been sorted in"
        events.append(Event(stamp, f"{sensor}_unsorted", message, {"count": count}))
    if not keep.all():
        stamp, count = int(ordered[~keep][0]), int((~keep).sum())
        message = f"{count} {sensor} samples repeated the stamp of another and have been dropped"
        events.append(Event(stamp, f"{sensor}_duplicates", message, {"count": count}))
    return np.asarray(order[keep], dtype=np.int64), events


def check_coverage(
    image_stamps_ns: IntArray, imu: ImuBatch, truth: Truth | None, max_gap_s: float
) -> list[Event]:
    """Compare what the sensors cover; ``image_stamps_ns`` (N,) on the IMU's clock.

    Returns
    -------
    list[Event]
        Of the kinds ``imu_gap``, ``images_outside_imu``, ``truth_missing``, ``truth_partial``;
        each once at most, with counts.

    Raises
    ------
    DataError
        No image lies within the IMU's time.
    """
    return [
        *_imu_gaps(imu, max_gap_s),
        *_images_outside(image_stamps_ns, imu),
        *_truth_coverage(image_stamps_ns, truth),
    ]


def _imu_gaps(imu: ImuBatch, max_gap_s: float) -> list[Event]:
    steps = np.diff(imu.stamps_ns)
    gaps = steps > max_gap_s * NANOSECONDS
    if not gaps.any():
        return []
    k = int(np.argmax(steps))
    count, longest = int(gaps.sum()), float(steps[k]) / NANOSECONDS
    message = (
        f"the IMU has {count} gaps longer than imu.max_gap_s = {max_gap_s:g} s, "
        f"the longest {longest:.3f} s"
    )
    data: dict[str, float | int | str] = {"count": count, "longest_s": longest}
    return [Event(int(imu.stamps_ns[k]), "imu_gap", message, data)]


def _images_outside(stamps: IntArray, imu: ImuBatch) -> list[Event]:
    first, last = int(imu.stamps_ns[0]), int(imu.stamps_ns[-1])
    before, after = stamps < first, stamps > last
    outside = before | after
    if outside.all():
        raise DataError(
            f"images and IMU don't overlap in time: the images span {_span(stamps)}, the IMU "
            f"{_span(imu.stamps_ns)} (ns, time offset included): check both data.csv and "
            "dataset.time_offset_s"
        )
    if not outside.any():
        return []
    message = (
        f"{int(before.sum())} images before the first and {int(after.sum())} after the last IMU "
        "sample can't be used"
    )
    data: dict[str, float | int | str] = {"before": int(before.sum()), "after": int(after.sum())}
    return [Event(int(stamps[outside][0]), "images_outside_imu", message, data)]


def _truth_coverage(stamps: IntArray, truth: Truth | None) -> list[Event]:
    if truth is None:
        return [
            Event(int(stamps[0]), "truth_missing", "the recording has no truth: no errors, no ATE")
        ]
    reference = truth.trajectory.stamps_ns
    known = covered(truth.trajectory, stamps)
    if known.all():
        return []
    in_hole = ~known & (stamps >= reference[0]) & (stamps <= reference[-1])
    count, holes = int(known.sum()), len(np.unique(np.searchsorted(reference, stamps[in_hole])))
    message = f"the truth covers {count} of {len(stamps)} images"
    if holes:
        message += f"; it has {holes} holes over {MAX_TRUTH_GAP_S} s, which are not bridged"
    data: dict[str, float | int | str] = {"covered": count, "images": len(stamps), "holes": holes}
    return [Event(int(stamps[~known][0]), "truth_partial", message, data)]


def _span(stamps_ns: IntArray) -> str:
    return f"{stamps_ns[0]} to {stamps_ns[-1]}"
