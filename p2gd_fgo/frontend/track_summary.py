"""The account of one image's tracking."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """What became of the previous image's features.

    Attributes
    ----------
    tracked
        Found again and kept.
    consumed
        Reached the maximum length in the previous image; tracked or lost like any other if they
        are continued.
    lost_klt, lost_forward_backward, lost_outside, lost_outlier
        Not found by the tracker, whichever it is; not found on the way back; left the image or
        went under a mask; against the motion of the rest.
    """

    tracked: int = 0
    consumed: int = 0
    lost_klt: int = 0
    lost_forward_backward: int = 0
    lost_outside: int = 0
    lost_outlier: int = 0
