"""Rows for trajectories that another program made, judged as our own are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.run_record import Label, RunRecord
from p2gd_fgo.trajectory_files import format_tum, read_trajectory
from p2gd_fgo.types import Trajectory

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
        Images in the recording, for the completeness. An estimator that writes a pose for every
        IMU sample has more, and then the completeness is 1 at most.
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
    if metrics["completeness"] is not None:
        metrics["completeness"] = min(1.0, metrics["completeness"])
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
