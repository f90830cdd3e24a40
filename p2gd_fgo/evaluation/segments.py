"""Where on the way the error is made: one row for every 10 m of the truth's path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.alignment import Alignment, align, align_yaw_pos
from p2gd_fgo.evaluation.association import CommonPoses, common_poses
from p2gd_fgo.evaluation.trajectory_errors import rmse
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import MAX_TRUTH_GAP_S, interpolate, inverse
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Trajectory

LENGTH_M = 10.0
_STEP_S = 0.5  # over which speed, turn and acceleration of the truth are taken
_STILL_M_S = 0.05
_PATH_STEP_S = 0.1  # the truth's own rate would add its noise to the path
_NEAR = 0.05
_LEAST_CHORD = 0.5  # of the path; below it the ends lie too near for a scale

PerImage = tuple[IntArray, Mapping[str, FloatArray]]
"""Stamps (F,) and columns (F,), as :func:`p2gd_fgo.evaluation.frame_measures.read_frames` gives."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of the way: what it was like, what error was made in it.

    Attributes
    ----------
    index
        Its number on the truth's path; the same piece of the same way in every run.
    start_m, length_m
        On the truth's path; the length from the first pose beyond the beginning to the first one
        beyond the end, which is what the errors are of.
    start_s, duration_s
        Since the truth's first pose.
    still_share
        Share of the time below 0.05 m/s, by the truth.
    turn_deg
        Sum of the turns about the vertical over steps of 0.5 s, to either side, by the truth.
    accel_m_s2
        RMS of the acceleration over steps of 0.5 s, by the truth: what tells the scale.
    moving_share
        Mean share of the image under moving objects; NaN where nobody said.
    translation_m, translation_percent, rotation_deg
        Error of the motion over the piece, relative to its start; percent of ``length_m``.
    scale_error
        Distance of its ends by the estimate over that by the truth, minus 1; NaN where the ends
        lie nearer to each other than half the way.
    ate_share
        Share of the whole way's squared aligned error that lies in this piece: where the error is
        *seen*.
    ate_made_m
        How much smaller the ATE would be had the motion over this piece been exact and the rest as
        it was: where the error is *made*. Negative where it happens to undo another's error.
    measures
        Means over the images of the piece, by column of ``frames.csv``.
    """

    index: int
    start_m: float
    length_m: float
    start_s: float
    duration_s: float
    still_share: float
    turn_deg: float
    accel_m_s2: float
    moving_share: float
    translation_m: float
    translation_percent: float
    rotation_deg: float
    scale_error: float
    ate_share: float
    ate_made_m: float
    measures: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain data in one level, ``measures`` with their own names; 6 digits, NaN is None."""
        own = {name: getattr(self, name) for name in _OWN}
        return {name: _plain(value) for name, value in (own | dict(self.measures)).items()}

    @classmethod
    def from_json(cls, row: Mapping[str, Any]) -> Segment:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        DataError
            A field is missing or no number.
        """
        try:
            values = {k: math.nan if v is None else float(v) for k, v in row.items()}
            own = {name: values.pop(name) for name in _OWN}
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"a row of segments can't be read: {error}") from None
        return cls(**(own | {"index": int(own["index"])}), measures=values)  # type: ignore[arg-type]


def _plain(value: float) -> float | None:
    if isinstance(value, int):
        return value
    return None if math.isnan(value) else float(f"{value:.6g}")


_OWN = tuple(name for name in Segment.__dataclass_fields__ if name != "measures")


def segments(
    estimate: Trajectory,
    truth: Trajectory,
    *,
    alignment: str = "yaw_pos",
    length_m: float = LENGTH_M,
    frames: PerImage | None = None,
    moving: tuple[IntArray, FloatArray] | None = None,
) -> tuple[Segment, ...]:
    """Cut the truth's path into pieces and measure each.

    Parameters
    ----------
    estimate
        Online poses.
    truth
        The whole of it: its path decides where the pieces lie, so that they are the same for every
        run. The rest at the end is a piece of its own if it is half a length or more, otherwise
        part of the last.
    alignment
        For what concerns the ATE; ``yaw_pos`` where the path doesn't determine it.
    length_m
        Of a piece.
    frames
        Measures of the images.
    moving
        Stamps (G,) and the share of the image under moving objects (G,).

    Returns
    -------
    tuple
        The pieces that the estimate covers from end to end: to either end it has a pose within
        0.5 s, or within 5 % of the length along the path (it may have stood there before).

    Raises
    ------
    DataError
        Fewer than 3 estimates have truth at their time.
    """
    common = common_poses(estimate, truth)
    way = _Way.of(truth)
    edges_m, edges_ns = way.edges(length_m)
    stamps = common.stamps_ns
    first = np.searchsorted(stamps, edges_ns)
    near = np.abs(stamps[np.minimum(first, len(stamps) - 1)] - edges_ns)
    first = np.minimum(first, len(stamps) - 1)
    covered_m = np.interp(stamps[first], way.stamps_ns, way.distance_m)
    reached = (near <= MAX_TRUTH_GAP_S * NANOSECONDS) | (
        np.abs(covered_m - edges_m) <= _NEAR * length_m
    )
    motion = inverse(common.estimate[first[:-1]]) @ common.estimate[first[1:]]
    true_motion = inverse(common.reference[first[:-1]]) @ common.reference[first[1:]]
    errors = inverse(true_motion) @ motion
    translation_m = np.linalg.norm(errors[:, :3, 3], axis=1)
    rotation_deg = so3.angle_deg(errors[:, :3, :3])
    chord, true_chord = (np.linalg.norm(T[:, :3, 3], axis=1) for T in (motion, true_motion))
    squared, ate_m = _squared_errors(common, alignment)
    frame_stamps, columns = frames or (np.zeros(0, np.int64), {})
    found = []
    for k in np.flatnonzero(reached[:-1] & reached[1:] & (first[1:] > first[:-1])).tolist():
        length = float(covered_m[k + 1] - covered_m[k])
        begin, end = int(first[k]), int(first[k + 1])
        within = squared[begin : end + (k == len(edges_m) - 2)]
        far_apart = true_chord[k] >= _LEAST_CHORD * length
        repaired = _with_exact_motion(common, begin, end)
        still, turn_deg, accel = way.character(edges_ns[k], edges_ns[k + 1])
        found.append(
            Segment(
                index=k,
                start_m=float(edges_m[k]),
                length_m=length,
                start_s=float(edges_ns[k] - way.stamps_ns[0]) / NANOSECONDS,
                duration_s=float(edges_ns[k + 1] - edges_ns[k]) / NANOSECONDS,
                still_share=still,
                turn_deg=turn_deg,
                accel_m_s2=accel,
                moving_share=_mean_within(moving, edges_ns[k], edges_ns[k + 1]),
                translation_m=float(translation_m[k]),
                translation_percent=100.0 * float(translation_m[k]) / length,
                rotation_deg=float(rotation_deg[k]),
                scale_error=float(chord[k] / true_chord[k]) - 1.0 if far_apart else math.nan,
                ate_share=float(within.sum() / squared.sum()) if squared.any() else 0.0,
                ate_made_m=ate_m - _squared_errors(repaired, alignment)[1],
                measures={
                    name: _mean_within((frame_stamps, values), edges_ns[k], edges_ns[k + 1])
                    for name, values in columns.items()
                },
            )
        )
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The truth at 10 Hz: ``distance_m`` (N,) along it at ``stamps_ns``, and its poses by step."""

    stamps_ns: IntArray
    distance_m: FloatArray
    truth: Trajectory

    @classmethod
    def of(cls, truth: Trajectory) -> _Way:
        step = round(_PATH_STEP_S * NANOSECONDS)
        stamps = np.arange(truth.stamps_ns[0], truth.stamps_ns[-1] + 1, step)
        p = interpolate(truth, stamps)[:, :3, 3]
        steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
        return cls(stamps, np.concatenate([[0.0], np.cumsum(steps)]), truth)

    def edges(self, length_m: float) -> tuple[FloatArray, IntArray]:
        """Distances and times where the pieces begin, and where the last one ends."""
        total = float(self.distance_m[-1])
        whole = max(1, int(total / length_m + 0.5))
        edges_m = np.append(length_m * np.arange(whole), total)
        at = np.searchsorted(self.distance_m, edges_m)
        at[0] = 0
        return edges_m, self.stamps_ns[np.minimum(at, len(self.stamps_ns) - 1)]

    def character(self, begin_ns: int, end_ns: int) -> tuple[float, float, float]:
        """Share of time standing still, degrees turned, and RMS acceleration in m/s²."""
        count = max(1, round((end_ns - begin_ns) / (_STEP_S * NANOSECONDS)))
        stamps = np.linspace(begin_ns, end_ns, count + 1).astype(np.int64)
        seconds = np.diff(stamps) / NANOSECONDS
        T = interpolate(self.truth, stamps)
        velocity = np.diff(T[:, :3, 3], axis=0) / seconds[:, None]
        turns = so3.log(T[1:, :3, :3] @ np.swapaxes(T[:-1, :3, :3], 1, 2))[:, 2]
        accel = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / seconds[1:]
        return (
            float(np.mean(np.linalg.norm(velocity, axis=1) < _STILL_M_S)),
            float(np.degrees(np.abs(turns).sum())),
            rmse(accel) if len(accel) else math.nan,
        )


def _squared_errors(common: CommonPoses, alignment: str) -> tuple[FloatArray, float]:
    """Squared aligned errors (N,) of the positions, and the ATE."""
    found: Alignment | None = align(alignment, common.estimate, common.reference)
    found = found or align_yaw_pos(common.estimate, common.reference)
    away = found.apply(common.estimate)[:, :3, 3] - common.reference[:, :3, 3]
    squared = np.sum(away * away, axis=1)
    return squared, float(np.sqrt(squared.mean()))


def _with_exact_motion(common: CommonPoses, begin: int, end: int) -> CommonPoses:
    """The estimate with the truth's motion from one pose to another, all else as it was."""
    poses = common.estimate.copy()
    onto = poses[begin] @ inverse(common.reference[begin])
    exact = onto @ common.reference[begin : end + 1]
    poses[end + 1 :] = exact[-1] @ inverse(common.estimate[end]) @ common.estimate[end + 1 :]
    poses[begin : end + 1] = exact
    return CommonPoses(common.stamps_ns, poses, common.reference)


def _mean_within(values: tuple[IntArray, FloatArray] | None, begin_ns: int, end_ns: int) -> float:
    """Mean of what is known at stamps from begin to before end; NaN where nothing is."""
    if values is None:
        return math.nan
    stamps, column = values
    here = column[np.searchsorted(stamps, begin_ns) : np.searchsorted(stamps, end_ns)]
    known = here[np.isfinite(here)]
    return float(known.mean()) if len(known) else math.nan
