"""Rows for trajectories that another program made, judged as our own are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.run_record import Label, RunRecord
from p2gd_fgo.trajectory_files import format_tum, read_trajectory
from p2gd_fgo.types import IntArray, Trajectory

ITS_OWN = "its own"
"""What tables show where our runs name their choice."""


def external_path(template: str, **places: Label) -> Path:
    """The file of one recording: ``path/{sequence}.tum`` with the places filled in.

    Parameters
    ----------
    template
        May hold the names in ``places`` in braces, such as ``{sequence}`` and ``{route}``.

    Raises
    ------
    ConfigError
        A name in braces that is none of them, or a lone brace.
    """
    try:
        return Path(template.format(**places)).expanduser()
    except (KeyError, IndexError, ValueError, AttributeError):
        known = ", ".join(f"{{{name}}}" for name in places)
        raise ConfigError(
            f"external: '{template}' can't be filled in: it may hold {known}"
        ) from None


def external_record(
    name: str,
    trajectory_file: Path,
    truth: Trajectory,
    *,
    sequence: str,
    frames_total: int | None = None,
    image_stamps_ns: IntArray | None = None,
    config: EvaluationConfig | None = None,
    study: str = "",
    axes: Mapping[str, Label] | None = None,
    route: str | None = None,
    group: str = "recordings",
    seed: int = 0,
) -> RunRecord:
    """Judge a trajectory as a run of ours would be.

    Parameters
    ----------
    name
        Of the estimator.
    trajectory_file
        TUM or EuRoC csv: poses of the IMU in any world, stamps on the IMU's clock.
    truth
        Of the recording, poses of the IMU.
    sequence, study, axes, route, group, seed
        As in the record; ``axes`` is by default ``{"backend": name}``, ``route`` the sequence.
    frames_total
        Images in the recording, for the completeness; unknown where the poses are more.
    image_stamps_ns
        (N,) of all images, on the IMU's clock, instead of their number. The completeness is the
        share of images with a pose no further away than the next image: an estimator may write one
        for every IMU sample, or for every other image.
    config
        Main alignment, lengths and tolerance; by default the package's.

    Returns
    -------
    RunRecord
        ``failed``, with the reason, where fewer than 3 poses have truth at their time. There are
        no measures of tracks, times and events.

    Raises
    ------
    DataError
        The file is missing or no trajectory.
    """
    estimate = read_trajectory(trajectory_file)
    config = config or EvaluationConfig()
    status, reason = "done", None
    try:
        metrics = evaluate(estimate, truth, frames_total=frames_total, config=config).to_json()
    except DataError as error:
        status, reason = "failed", f"{trajectory_file}: {error}"
        metrics = evaluate(estimate, None, frames_total=frames_total, config=config).to_json()
    if image_stamps_ns is not None:
        metrics["frames_total"] = len(image_stamps_ns)
        metrics["completeness"] = _share_reached(image_stamps_ns, estimate.stamps_ns)
    metrics |= {
        "name": sequence, "status": status, "reason": reason, "start": None, "seed": seed,
        "backend": name, "distribution": ITS_OWN,
    }  # fmt: skip
    content = json.dumps([name, sequence, config.model_dump(mode="json")], sort_keys=True)
    content += format_tum(estimate) + format_tum(truth)
    return RunRecord(
        key=hashlib.sha256(content.encode()).hexdigest()[:16],
        study=study,
        axes={"backend": name} if axes is None else axes,
        sequence=sequence,
        route=sequence if route is None else route,
        group=group,
        seed=seed,
        status="failed" if reason else "done",
        reason=reason,
        metrics=metrics,
    )


def _share_reached(images_ns: IntArray, poses_ns: IntArray) -> float:
    """Share of the images with a pose within the median time between two images."""
    if len(images_ns) < 2 or not len(poses_ns):
        return 0.0
    after = np.searchsorted(poses_ns, images_ns)
    beside = np.clip(np.stack([after - 1, after]), 0, len(poses_ns) - 1)
    distance = np.abs(poses_ns[beside] - images_ns).min(axis=0)
    return float(np.mean(distance <= np.median(np.diff(images_ns))))
