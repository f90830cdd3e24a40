"""The short demo, spoilt on disk or in memory."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.types import FloatArray, Trajectory

Rows = list[str]

IMU = "imu0/data.csv"
TRUTH = "state_groundtruth_estimate0/data.csv"
SMALL_IMAGE = {"frontend.min_distance_px": 15.0}


def settings(**fields: object) -> Config:
    """A configuration for the demo's small images; ``__`` stands for the dot."""
    return override(
        load_config(), SMALL_IMAGE | {k.replace("__", "."): v for k, v in fields.items()}
    )


def opened(folder: Path, **fields: object) -> AslSequence:
    config = override(Config(), {f"dataset.{k}": v for k, v in fields.items()})
    config = override(config, {"dataset.path": str(folder)})
    sequence = open_sequence(config.dataset)
    assert isinstance(sequence, AslSequence)
    return sequence


def spoilt(
    folder: Path, into: Path, edits: dict[str, Callable[[Rows], Rows] | None] | None = None
) -> Path:
    """A copy whose tables are edited by row, without the header; None deletes a table."""
    copy = into / folder.name
    shutil.copytree(folder, copy)
    for name, edit in (edits or {}).items():
        path = copy / "mav0" / name
        if edit is None:
            path.unlink()
            continue
        header, *rows = path.read_text().splitlines()
        path.write_text("\n".join([header, *edit(rows)]) + "\n")
    return copy


def kinds(result: RunResult) -> list[str]:
    return [event.kind for event in result.events]


def ate_m(result: RunResult, truth: Trajectory) -> float:
    """RMSE of the position after aligning position and yaw."""
    config = result.config.evaluation
    found = evaluate(result.estimate, truth, frames_total=result.frames_total, config=config)
    assert found.accuracy is not None
    statistics = found.accuracy.ate_m["yaw_pos"]
    assert statistics is not None
    return statistics.rmse


def start_aligned_errors(estimate: Trajectory, truth: Trajectory) -> FloatArray:
    """Distance (N,) from truth after bringing the first poses together."""
    reference = interpolate(truth, estimate.stamps_ns)
    aligned = reference[0] @ np.linalg.inv(estimate.T_world_imu[0]) @ estimate.T_world_imu
    return np.asarray(np.linalg.norm(aligned[:, :3, 3] - reference[:, :3, 3], axis=1))
