"""Is the smoother exact without noise and consistent with it? Prints two tables in markdown."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.config import load_config
from p2gd_fgo.evaluation.feature_runs import FeatureRun, run_features
from p2gd_fgo.simulation.feature_recording import (
    CAR_PLATFORM,
    ROBOT_PLATFORM,
    FeatureRecording,
    record_features,
)
from p2gd_fgo.simulation.imu import MEMS_NOISE

PLATFORMS = {"car": CAR_PLATFORM, "robot": ROBOT_PLATFORM}
SETTLED_S = 5  # frames before are not judged


@dataclass(frozen=True)
class Row:
    path_m: float
    rmse_m: float
    worst_m: float
    nees: float


def run(recording: FeatureRecording, rng: np.random.Generator | None) -> FeatureRun:
    backend = Smoother(recording.calibration, MEMS_NOISE, 9.81, load_config().backend)
    return run_features(backend, recording, rng)


def job(name: str, seed: int, duration_s: float, noise: bool) -> Row:
    recording = record_features(
        PLATFORMS[name], duration_s, np.random.default_rng(seed), noise=noise
    )
    result = run(recording, np.random.default_rng([seed, 1]) if noise else None)
    steps = np.diff(recording.T_world_imu[:, :3, 3], axis=0)
    return Row(
        float(np.linalg.norm(steps, axis=1).sum()),
        result.position_rmse,
        float(result.position_error.max()),
        float(result.nees[10 * SETTLED_S :].mean()),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    write = sys.stdout.write
    with ProcessPoolExecutor(options.jobs) as pool:
        for noise in (False, True):
            seeds = range(options.seeds if noise else 3)
            write(f"\n{'With noise' if noise else 'Without noise'}, {options.duration:g} s\n\n")
            write("| platform | seed | path m | ATE (start) m | worst m | NEES |\n")
            write("|---|---|---|---|---|---|\n")
            for name in PLATFORMS:
                work = partial(job, name, duration_s=options.duration, noise=noise)
                rows = list(pool.map(work, seeds))
                for seed, r in zip(seeds, rows, strict=True):
                    write(
                        f"| {name} | {seed} | {r.path_m:.0f} | {r.rmse_m:.3g} | {r.worst_m:.3g} |"
                        f" {r.nees:.3g} |\n"
                    )
                mean = np.mean([r.nees for r in rows])
                rms = np.sqrt(np.mean([r.rmse_m**2 for r in rows]))
                worst = max(r.worst_m for r in rows)
                write(f"| {name} | all | | {rms:.3g} | {worst:.3g} | **{mean:.3g}** |\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
