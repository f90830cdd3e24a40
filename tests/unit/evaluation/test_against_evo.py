"""Three trajectories from files, judged by us and by evo's own commands."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from evo import main_ape, main_rpe
from evo.core import metrics, sync
from evo.tools import file_interface

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.trajectory_files import read_trajectory, write_tum
from p2gd_fgo.types import Trajectory

START_NS = 1_600_000_000_000_000_000
PATHS = {  # metres of drive, m/s, m of climb, drift
    "loop": (300.0, 10.0, 4.0, 1.0),
    "walk": (60.0, 1.0, 0.5, 3.0),
    "drive": (2000.0, 15.0, 30.0, 0.3),
}
ALIGNED = {
    "se3": {"align": True},
    "sim3": {"align": True, "correct_scale": True},
    "origin": {"align_origin": True},
}
RELATION = metrics.PoseRelation


def write_pair(folder: Path, name: str) -> tuple[Path, Path]:
    """Files of a truth and of an estimate that drifts, in another frame, 3 % too long."""
    length, speed, climb, drift = PATHS[name]
    rng = np.random.default_rng(len(name) + int(length))
    s = np.arange(0.0, length, speed / 10.0)
    yaw = 2.0 * np.sin(s / length * 9.0) + s / length
    steps = (speed / 10.0) * np.stack(
        [np.cos(yaw), np.sin(yaw), climb / length * np.cos(s / length * 20.0)], axis=1
    )
    lean = 0.05 * rng.normal(size=(1, 3))
    R = so3.exp(np.stack([0 * s, 0 * s, yaw], axis=1)) @ so3.exp(lean)
    truth = from_rotation_translation(R, np.cumsum(steps, axis=0))
    wander = so3.exp(np.cumsum(drift * 1e-3 * rng.normal(size=(len(s), 3)), axis=0))
    shift = np.cumsum(drift * 1e-3 * speed * rng.normal(size=(len(s), 3)), axis=0)
    frame = from_rotation_translation(so3.exp(np.array([0.3, -0.1, 2.0])), np.array([5.0, 9, -2]))
    estimate = frame @ from_rotation_translation(R @ wander, 1.03 * truth[:, :3, 3] + shift)
    stamps = START_NS + np.round(np.arange(len(s)) * 1e8).astype(np.int64)
    for who, poses in (("truth", truth), ("estimate", estimate)):
        write_tum(folder / f"{name}_{who}.tum", Trajectory(stamps, poses))
    return folder / f"{name}_truth.tum", folder / f"{name}_estimate.tum"


@pytest.mark.parametrize("name", PATHS)
def test_a_file_gets_evos_figures(tmp_path: Path, name: str) -> None:
    truth, estimate = write_pair(tmp_path, name)
    config = EvaluationConfig(rte_lengths_m=(10.0, 50.0, 200.0))
    ours = evaluate(
        read_trajectory(estimate), read_trajectory(truth), frames_total=None, config=config
    ).accuracy
    assert ours is not None
    pair = sync.associate_trajectories(
        file_interface.read_tum_trajectory_file(truth),
        file_interface.read_tum_trajectory_file(estimate),
    )
    for kind, how in ALIGNED.items():
        for relation, found in (
            (RELATION.translation_part, ours.ate_m[kind]),
            (RELATION.rotation_angle_deg, ours.are_deg[kind]),
        ):
            theirs = main_ape.ape(*deepcopy(pair), relation, **how).stats  # aligns in place
            assert found is not None
            for what in ("rmse", "mean", "median", "max"):
                assert getattr(found, what) == pytest.approx(theirs[what], rel=1e-6)
    assert [entry.length_m for entry in ours.rte] == [10.0, 50.0, 200.0][
        : 2 if name == "walk" else 3
    ]
    for entry in ours.rte:
        for relation, value in (
            (RELATION.translation_part, entry.rmse_m),
            (RELATION.rotation_angle_deg, entry.rre_deg),
        ):
            theirs = main_rpe.rpe(
                *deepcopy(pair), relation, delta=entry.length_m, delta_unit=metrics.Unit.meters,
                all_pairs=True, pairs_from_reference=True,
            ).stats  # fmt: skip
            assert value == pytest.approx(theirs["rmse"], rel=1e-6)


def test_the_commands_say_the_same(tmp_path: Path) -> None:
    truth, estimate = write_pair(tmp_path, "loop")
    ours = evaluate(
        read_trajectory(estimate), read_trajectory(truth), frames_total=None,
        config=EvaluationConfig(),
    ).to_json()  # fmt: skip
    assert _command(tmp_path, "ape", truth, estimate, "-a") == pytest.approx(
        ours["ate_m"]["se3"]["rmse"], rel=1e-6
    )
    ten = next(entry for entry in ours["rte"] if entry["length_m"] == 10.0)
    how = "--delta 10 --delta_unit m --all_pairs --pairs_from_reference"
    assert _command(tmp_path, "rpe", truth, estimate, *how.split()) == pytest.approx(
        ten["rmse_m"], rel=1e-6
    )


def _command(folder: Path, metric: str, truth: Path, estimate: Path, *options: str) -> float:
    saved = folder / f"{metric}.zip"
    program = Path(sys.executable).with_name(f"evo_{metric}")
    subprocess.run(
        [program, "tum", truth, estimate, *options, "--save_results", saved, "--no_warnings"],
        check=True,
        capture_output=True,
        env={"HOME": str(folder), "PATH": str(program.parent), "MPLBACKEND": "agg"},
    )
    with zipfile.ZipFile(saved) as files:
        return float(json.loads(files.read("stats.json"))["rmse"])
