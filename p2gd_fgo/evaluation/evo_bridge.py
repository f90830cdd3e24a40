"""The bridge to evo (Grupp, "evo: Python package for the evaluation of odometry and SLAM")."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from evo.core import filters, metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface

from p2gd_fgo.atomic_files import atomic_path
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, Trajectory

_FULL = metrics.PoseRelation.full_transformation


def to_evo(stamps_ns: IntArray, poses: FloatArray) -> Any:
    """Make an evo trajectory of poses (N, 4, 4); its stamps are float seconds, to about 0.2 µs."""
    return PoseTrajectory3D(poses_se3=list(poses), timestamps=stamps_ns / NANOSECONDS)


def absolute_errors(estimate: FloatArray, reference: FloatArray) -> FloatArray:
    """Error poses (N, 4, 4) of evo's APE: inverse(estimate) @ reference, at the same stamps."""
    metric = metrics.APE(_FULL)
    metric.process_data((_path(reference), _path(estimate)))
    return np.asarray(metric.E, dtype=np.float64)


def relative_errors(
    estimate: FloatArray, reference: FloatArray, length_m: float, tolerance: float
) -> FloatArray:
    """Error poses (M, 4, 4) of evo's RPE over all pairs that lie ``length_m`` apart.

    Distances are path lengths of the reference; each pose is paired with the later one whose
    distance comes closest, if it misses ``length_m`` by at most ``tolerance * length_m``. M is 0
    where no pair fits.
    """
    metric = metrics.RPE(
        _FULL,
        delta=length_m,
        delta_unit=metrics.Unit.meters,
        rel_delta_tol=tolerance,
        all_pairs=True,
        pairs_from_reference=True,
    )
    try:
        metric.process_data((_path(reference), _path(estimate)))
    except filters.FilterException:
        return np.zeros((0, 4, 4))
    return np.asarray(metric.E, dtype=np.float64)


def write_result(
    path: Path, estimate: Trajectory, reference: Trajectory, *, alignment: str, name: str
) -> None:
    """Write a zip that ``evo_res`` reads: APE in m of an aligned estimate, both trajectories.

    Parameters
    ----------
    path
        The zip; it is replaced as a whole.
    estimate, reference
        N poses each at the same stamps, the estimate aligned.
    alignment
        Named in the result's title.
    name
        The estimate's name in evo's tables.
    """
    evo_estimate = to_evo(estimate.stamps_ns, estimate.T_world_imu)
    evo_reference = to_evo(reference.stamps_ns, reference.T_world_imu)
    metric = metrics.APE(metrics.PoseRelation.translation_part)
    metric.process_data((evo_reference, evo_estimate))
    result = metric.get_result("reference", name)
    result.info["title"] = f"{metric}\n(with {alignment} alignment)"
    result.add_trajectory("reference", evo_reference)
    result.add_trajectory("estimate", evo_estimate)
    seconds = (estimate.stamps_ns - estimate.stamps_ns[0]) / NANOSECONDS
    result.add_np_array("seconds_from_start", seconds)
    result.add_np_array("timestamps", evo_estimate.timestamps)
    result.add_np_array("distances_from_start", evo_reference.distances)
    result.add_np_array("distances", evo_estimate.distances)
    with atomic_path(path) as temporary:
        file_interface.save_res_file(temporary, result)


def _path(poses: FloatArray) -> Any:
    return to_evo(np.arange(len(poses), dtype=np.int64), poses)
