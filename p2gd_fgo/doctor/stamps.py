"""Rates, gaps, order and overlap of the sensors."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.doctor.report import Finding, Status
from p2gd_fgo.types import NANOSECONDS, Event, IntArray

MIN_IMAGE_HZ, MIN_IMU_HZ = 5.0, 50.0
"""Slower images lose their tracks; a slower IMU misses the vibration of any vehicle."""

MAX_IMU_GAP_S = 1.0
"""1 m/s² that nobody measured is 0.5 m after it."""

_DROP = 1.5  # median intervals
_MAX_DROPPED = 0.05
_MAX_HOLE_S = 1.0  # of images: tracks don't survive it
_MANY = 0.01  # of the samples


def check_stamps(sequence: Sequence, config: Config) -> list[Finding]:
    """Look at the stamps of images, IMU and truth, and at what was mended at opening."""
    return [
        _images(sequence.image_stamps_ns),
        _imu_rate(sequence.imu.stamps_ns),
        _imu_gaps(sequence, config.imu.max_gap_s),
        _overlap(sequence),
        *_mended(sequence),
    ]


def _images(stamps: IntArray) -> Finding:
    if len(stamps) < 2:
        return Finding(
            "images", "fault", "only one image", "at least 2", "record more", "image_rate"
        )
    steps = np.diff(stamps) / NANOSECONDS
    step = float(np.median(steps))
    holes = steps > _DROP * step
    dropped = int(np.round(steps[holes] / step - 1.0).sum())
    rate, longest = 1.0 / step, float(steps.max())
    value = f"{len(stamps)} at {rate:.4g} Hz"
    if dropped:
        value += f", {dropped} missing in {int(holes.sum())} holes, the longest {longest:.3g} s"
    threshold = (
        f"≥ {MIN_IMAGE_HZ:g} Hz, < {100 * _MAX_DROPPED:g} % missing, no hole of {_MAX_HOLE_S:g} s"
    )
    status: Status = "ok"
    mend, fault = "", None
    if rate < MIN_IMAGE_HZ:
        status, fault = "warning", "image_rate"
        mend = "record at a higher rate: features leave the view before they are triangulated"
    elif dropped > _MAX_DROPPED * len(stamps) or longest > _MAX_HOLE_S:
        status, fault = "warning", "images_missing"
        mend = "look for a full disk or an overloaded driver; dataset.start_s, duration_s cut"
    data = {"rate_hz": rate, "count": len(stamps), "missing": dropped, "longest_s": longest}
    return Finding("images", status, value, threshold, mend, fault, dict(data))


def _imu_rate(stamps: IntArray) -> Finding:
    steps = np.diff(stamps) / NANOSECONDS
    rate = 1.0 / float(np.median(steps))
    jitter = float(1.4826 * np.median(np.abs(steps - np.median(steps))))
    slow = rate < MIN_IMU_HZ
    return Finding(
        "IMU rate",
        "warning" if slow else "ok",
        f"{rate:.4g} Hz, jitter {1e3 * jitter:.2g} ms",
        f"≥ {MIN_IMU_HZ:g} Hz",
        "record the IMU at 100 Hz or more" if slow else "",
        "imu_rate" if slow else None,
        {"rate_hz": rate, "jitter_s": jitter},
    )


def _imu_gaps(sequence: Sequence, max_gap_s: float) -> Finding:
    stamps = sequence.imu.stamps_ns
    steps = np.diff(stamps) / NANOSECONDS
    # An IMU slower than the threshold is one long row of gaps: that is the rate's finding.
    limit = max(max_gap_s, 3.0 * float(np.median(steps)))
    gaps = np.flatnonzero(steps > limit)
    longest = float(steps.max())
    threshold = f"{limit:g} s (imu.max_gap_s); a fault beyond {MAX_IMU_GAP_S:g} s"
    data = {"count": len(gaps), "longest_s": longest}
    if len(gaps) == 0:
        value = f"none, the longest interval is {1e3 * longest:.3g} ms"
        return Finding("IMU gaps", "ok", value, threshold, data=dict(data))
    k = int(np.argmax(steps))
    at = (int(stamps[k]) - int(sequence.image_stamps_ns[0])) / NANOSECONDS
    value = f"{len(gaps)}, the longest of {longest:.3g} s begins {at:.1f} s after the first image"
    return Finding(
        "IMU gaps",
        "fault" if longest > MAX_IMU_GAP_S else "warning",
        value,
        threshold,
        "run the parts before and after it on their own (dataset.start_s, dataset.duration_s)",
        "imu_gap",
        {**data, "begin_s": at},
    )


def _overlap(sequence: Sequence) -> Finding:
    offset_ns = round(sequence.calibration.time_offset_s * NANOSECONDS)
    stamps = sequence.image_stamps_ns + offset_ns
    imu = sequence.imu.stamps_ns
    outside = int(((stamps < imu[0]) | (stamps > imu[-1])).sum())
    share = outside / len(stamps)
    status: Status = "fault" if share > 0.5 else "warning" if share > _MANY else "ok"
    if outside and status == "ok":
        status = "note"
    return Finding(
        "overlap",
        status,
        f"{len(stamps) - outside} of {len(stamps)} images lie within the IMU's time",
        f"all but {100 * _MANY:g} %",
        "check that both were recorded by one clock" if status in ("warning", "fault") else "",
        "overlap" if status in ("warning", "fault") else None,
        {"outside": outside},
    )


def enough_data(sequence: Sequence, window: int) -> Finding:
    """Whether there are images and IMU for the back end's window; ``undetermined`` where not."""
    offset_ns = round(sequence.calibration.time_offset_s * NANOSECONDS)
    stamps = sequence.image_stamps_ns + offset_ns
    imu = sequence.imu.stamps_ns
    inside = stamps[(stamps >= imu[0]) & (stamps <= imu[-1])]
    seconds = float(inside[-1] - inside[0]) / NANOSECONDS if len(inside) else 0.0
    few = len(inside) < window
    return Finding(
        "amount of data",
        "undetermined" if few else "ok",
        f"{len(inside)} images with IMU in {seconds:.3g} s",
        f"≥ {window} images, one window (backend.window)",
        "give a longer recording, or a longer part of it (dataset.duration_s)" if few else "",
        data={"images": len(inside), "seconds": seconds},
    )


def _mended(sequence: Sequence) -> list[Finding]:
    """Findings about what the reader mended and this room doesn't measure itself."""
    known = ("imu_gap", "images_outside_imu")
    return [_from_event(event, sequence) for event in sequence.events if event.kind not in known]


def _from_event(event: Event, sequence: Sequence) -> Finding:
    count = event.data.get("count", 0)
    total = len(sequence.imu) if event.kind.startswith("imu") else None
    many = total is not None and isinstance(count, int) and count > _MANY * total
    return Finding(
        event.kind.replace("_", " "),
        "warning" if many else "note",
        event.message,
        f"{100 * _MANY:g} % of the samples" if total is not None else "",
        "look at what wrote the file: stamps should increase" if many else "",
        event.kind if many else None,
        dict(event.data),
    )
