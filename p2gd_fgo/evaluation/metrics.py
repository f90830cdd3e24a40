"""What an evaluation says, and its form in ``metrics.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from p2gd_fgo.evaluation.trajectory_errors import RelativeError, Statistics

_WITHOUT_TRUTH: dict[str, Any] = {
    "frames_compared": 0,
    "truth_coverage": None,
    "path_length_m": None,
    "ate_m": None,
    "are_deg": None,
    "ate_percent": None,
    "scale": None,
    "rte": [],
    "rte_tolerance": None,
    "final_drift": None,
}


@dataclass(frozen=True, slots=True)
class FinalDrift:
    """Error of the last compared pose with the first one aligned (``origin``)."""

    position_m: float
    rotation_deg: float


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Errors against truth.

    Attributes
    ----------
    frames_compared
        Estimates with truth at their time.
    path_length_m
        Of the truth, over the compared stamps.
    ate_m, are_deg
        By alignment: statistics of the distance and of the angle; None where the path doesn't
        determine the alignment (se3 and sim3 on a straight line or a point).
    scale
        Factor on the estimate that fits the truth best (sim3), or None.
    rte
        One entry for each length that fits.
    rte_tolerance
        Share by which a pair may miss its length.
    final_drift
        Error at the end.
    """

    frames_compared: int
    path_length_m: float
    ate_m: Mapping[str, Statistics | None]
    are_deg: Mapping[str, Statistics | None]
    scale: float | None
    rte: tuple[RelativeError, ...]
    rte_tolerance: float
    final_drift: FinalDrift


@dataclass(frozen=True, slots=True)
class Metrics:
    """The judgement on one run.

    Attributes
    ----------
    frames
        Images with an online estimate.
    frames_total
        Images in the recording, or None where only the estimate is known.
    duration_s
        From the first estimate to the last.
    alignment
        The main one.
    accuracy
        None without truth.
    """

    frames: int
    frames_total: int | None
    duration_s: float
    alignment: str
    accuracy: Accuracy | None

    @property
    def completeness(self) -> float | None:
        """Share of the recording's images with an online estimate.

        None where the estimates are more than the images, and so can't be one for each.
        """
        if not self.frames_total or self.frames > self.frames_total:
            return None
        return self.frames / self.frames_total

    @property
    def truth_coverage(self) -> float | None:
        """Share of the estimates with truth at their time."""
        return self.accuracy.frames_compared / self.frames if self.accuracy else None

    @property
    def ate_percent(self) -> float | None:
        """RMSE of the position under the main alignment, in percent of the path."""
        if self.accuracy is None or not self.accuracy.path_length_m:
            return None
        ate = self.accuracy.ate_m[self.alignment]
        return 100.0 * ate.rmse / self.accuracy.path_length_m if ate else None

    def to_json(self) -> dict[str, Any]:
        """Plain data with the same keys for every run; what is unknown is None.

        ``alignment, frames, frames_total, completeness, duration_s, frames_compared,
        truth_coverage, path_length_m, scale, ate_percent, rte_tolerance`` are single values;
        ``ate_m`` and ``are_deg`` map ``yaw_pos, se3, sim3, origin`` to ``rmse, mean, median,
        max``; ``rte`` lists ``length_m, rmse_m, percent, rre_deg, pairs``; ``final_drift`` holds
        ``position_m, rotation_deg``.
        """
        out = {
            "alignment": self.alignment,
            "frames": self.frames,
            "frames_total": self.frames_total,
            "completeness": self.completeness,
            "duration_s": self.duration_s,
        }
        if self.accuracy is None:
            return out | _WITHOUT_TRUTH
        return (
            out
            | asdict(self.accuracy)
            | {
                "rte": [asdict(entry) for entry in self.accuracy.rte],
                "truth_coverage": self.truth_coverage,
                "ate_percent": self.ate_percent,
            }
        )
