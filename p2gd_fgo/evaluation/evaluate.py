"""Judge an estimated trajectory against the truth."""

from __future__ import annotations

from dataclasses import dataclass

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.alignment import ALIGNMENTS, align
from p2gd_fgo.evaluation.association import CommonPoses, common_poses
from p2gd_fgo.evaluation.metrics import Accuracy, FinalDrift, Metrics
from p2gd_fgo.evaluation.trajectory_errors import (
    Statistics,
    absolute,
    path_length,
    relative,
    statistics,
)
from p2gd_fgo.types import NANOSECONDS, FloatArray, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class ErrorSeries:
    """Errors over time under one alignment, for figures and evo's result file.

    Attributes
    ----------
    alignment
        Its name.
    aligned
        The whole estimate in the truth's frame.
    estimate, reference
        Aligned estimate and truth at the N compared stamps.
    position_m, rotation_deg
        (N,) each.
    """

    alignment: str
    aligned: Trajectory
    estimate: Trajectory
    reference: Trajectory
    position_m: FloatArray
    rotation_deg: FloatArray


def evaluate(
    estimate: Trajectory,
    truth: Trajectory | None,
    *,
    frames_total: int | None,
    config: EvaluationConfig,
) -> Metrics:
    """Compare an estimate with the truth; without truth only count.

    Parameters
    ----------
    estimate
        One pose for each image with an online estimate.
    truth
        Interpolated to the estimate's stamps, see :func:`common_poses`.
    frames_total
        Images in the recording, for the completeness.
    config
        Main alignment, lengths and tolerance.

    Raises
    ------
    DataError
        Fewer than 3 estimates have truth at their time.
    """
    stamps = estimate.stamps_ns
    return Metrics(
        frames=len(estimate),
        frames_total=frames_total,
        duration_s=float(stamps[-1] - stamps[0]) / NANOSECONDS if len(stamps) else 0.0,
        alignment=config.alignment,
        accuracy=None if truth is None else _accuracy(common_poses(estimate, truth), config),
    )


def error_series(estimate: Trajectory, truth: Trajectory, alignment: str) -> ErrorSeries:
    """Errors at every compared stamp under one alignment.

    Raises
    ------
    DataError
        Fewer than 3 estimates have truth at their time, or the path doesn't determine the
        alignment.
    """
    common = common_poses(estimate, truth)
    transform = align(alignment, common.estimate, common.reference)
    if transform is None:
        raise DataError(
            f"the path of {path_length(common.reference):.3g} m is straight or a point and doesn't "
            f"determine evaluation.alignment '{alignment}'; use yaw_pos or origin"
        )
    aligned = transform.apply(common.estimate)
    position_m, rotation_deg = absolute(aligned, common.reference)
    return ErrorSeries(
        alignment=alignment,
        aligned=Trajectory(estimate.stamps_ns, transform.apply(estimate.T_world_imu)),
        estimate=Trajectory(common.stamps_ns, aligned),
        reference=Trajectory(common.stamps_ns, common.reference),
        position_m=position_m,
        rotation_deg=rotation_deg,
    )


def _accuracy(common: CommonPoses, config: EvaluationConfig) -> Accuracy:
    ate: dict[str, Statistics | None] = dict.fromkeys(ALIGNMENTS)
    are: dict[str, Statistics | None] = dict.fromkeys(ALIGNMENTS)
    final = {}
    transforms = {kind: align(kind, common.estimate, common.reference) for kind in ALIGNMENTS}
    for kind, transform in transforms.items():
        if transform is not None:
            errors_m, errors_deg = absolute(transform.apply(common.estimate), common.reference)
            ate[kind], are[kind] = statistics(errors_m), statistics(errors_deg)
            final[kind] = FinalDrift(float(errors_m[-1]), float(errors_deg[-1]))
    sim3 = transforms["sim3"]
    return Accuracy(
        frames_compared=len(common),
        path_length_m=path_length(common.reference),
        ate_m=ate,
        are_deg=are,
        scale=sim3.scale if sim3 else None,
        rte=relative(common.estimate, common.reference, config.rte_lengths_m, config.rte_tolerance),
        rte_tolerance=config.rte_tolerance,
        final_drift=final["origin"],
    )
