"""What goes wrong on the way of the images and the IMU samples, noticed and written down.

Nothing here changes an estimate. The estimator has its own answer to each trouble; a reader of the
run has to know that there was one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.frontend import ImageHealth, TrackSummary
from p2gd_fgo.imu import UnknownMotion
from p2gd_fgo.types import NANOSECONDS, Event

_INTERVALS = 20  # images whose intervals say what is usual
_KNOWN_INTERVALS = 3  # fewer say nothing
_GAP = 3.5  # usual intervals without an image: three are missing
_LEAST_TRACKS = 20  # of fewer, shares say nothing
_LOST_SHARE = 0.3  # fewer than this are found again
_REJECTED_SHARE = 0.25  # of the tracks found again don't move as the rest
_REJECTED_IMAGES = 3  # in a row: one bad image is no moving obstacle
_SAME_S = 1.0  # two troubles of a kind closer than this are one event


@dataclass(frozen=True, slots=True)
class Trouble:
    """One image's trouble: ``kind`` as of an :class:`Event`, what happened, and how bad it was.

    ``extent`` is what the event's data names ``worst``: a share, a ratio or seconds, larger being
    worse.
    """

    stamp_ns: int
    kind: str
    message: str
    extent: float


class TroubleWatch:
    """Looks at every image of a run, in order."""

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=_INTERVALS)
        self._rejecting = 0

    def look(
        self,
        stamp_ns: int,
        health: ImageHealth,
        tracked: TrackSummary,
        unknown: UnknownMotion | None,
        *,
        used: bool,
    ) -> list[Trouble]:
        """What is wrong with an image, its tracks and the samples that lead to it.

        ``used`` says whether its features were tracked at all.
        """
        found = [*self._late(stamp_ns)]
        if unknown is not None:
            found.append(
                Trouble(
                    stamp_ns, "imu_gap_bridged",
                    f"no IMU sample for {unknown.longest_s:.2f} s: straight line between the "
                    "neighbours, uncertainty grown for what may have happened (imu.gap_sigma_*)",
                    unknown.longest_s,
                )
            )  # fmt: skip
        if not used:
            kind, what = (
                ("image_blank", "black, white or grey all over")
                if health.blank
                else ("image_frozen", "the same picture as before, bit for bit")
            )
            message = f"{what}: the image was used for nothing, the IMU alone carried on"
            return [*found, Trouble(stamp_ns, kind, message, 1.0)]
        if health.jumped:
            ratio = health.brightness
            message = f"the brightness changed by a factor of {ratio:.2f} from image to image"
            found.append(Trouble(stamp_ns, "brightness_jump", message, max(ratio, 1.0 / ratio)))
        return [*found, *self._tracking(stamp_ns, tracked)]

    def _late(self, stamp_ns: int) -> Iterable[Trouble]:
        last, self._last_ns = self._last_ns, stamp_ns
        if last is None:
            return
        interval = stamp_ns - last
        usual = float(np.median(self._intervals)) if self._intervals else np.inf
        if len(self._intervals) >= _KNOWN_INTERVALS and interval > _GAP * usual:
            seconds = interval / NANOSECONDS
            message = f"no image for {seconds:.2f} s: the IMU alone carried on"
            yield Trouble(stamp_ns, "image_gap", message, seconds)
        else:
            self._intervals.append(interval)

    def _tracking(self, stamp_ns: int, tracked: TrackSummary) -> Iterable[Trouble]:
        judged = tracked.tracked + tracked.lost_outlier
        known = judged + tracked.lost_klt + tracked.lost_forward_backward + tracked.lost_outside
        if known >= _LEAST_TRACKS and tracked.tracked < _LOST_SHARE * known:
            message = f"only {tracked.tracked} of {known} features were found again"
            yield Trouble(stamp_ns, "tracks_lost", message, 1.0 - tracked.tracked / known)
        share = tracked.lost_outlier / judged if judged >= _LEAST_TRACKS else 0.0
        self._rejecting = self._rejecting + 1 if share > _REJECTED_SHARE else 0
        if self._rejecting >= _REJECTED_IMAGES:
            message = (
                f"{share:.0%} of the tracks don't move as the rest: something large passes by, or "
                "the calibration is wrong"
            )
            yield Trouble(stamp_ns, "many_tracks_rejected", message, share)


def trouble_events(troubles: Iterable[Trouble]) -> list[Event]:
    """One event for each stretch of a kind, told by its worst image."""
    stretches: dict[str, list[list[Trouble]]] = {}
    for trouble in troubles:
        of_kind = stretches.setdefault(trouble.kind, [])
        if of_kind and trouble.stamp_ns - of_kind[-1][-1].stamp_ns <= _SAME_S * NANOSECONDS:
            of_kind[-1].append(trouble)
        else:
            of_kind.append([trouble])
    events = []
    for kind, stretch in ((k, s) for k, of_kind in stretches.items() for s in of_kind):
        worst = max(stretch, key=lambda t: t.extent)
        seconds = (stretch[-1].stamp_ns - stretch[0].stamp_ns) / NANOSECONDS
        many = f" ({len(stretch)} images in {seconds:.1f} s)" if len(stretch) > 1 else ""
        data: dict[str, float | int | str] = {
            "images": len(stretch), "duration_s": seconds, "worst": worst.extent
        }  # fmt: skip
        events.append(Event(stretch[0].stamp_ns, kind, worst.message + many, data))
    return events
