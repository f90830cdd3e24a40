"""Is a back end exact without noise and consistent with it? Prints two tables in markdown."""

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

from p2gd_fgo.backends.factory import make_backend
from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.evaluation.consistency import free_sigmas
from p2gd_fgo.evaluation.feature_runs import run_features
from p2gd_fgo.simulation.feature_recording import CAR_PLATFORM, ROBOT_PLATFORM, record_features
from p2gd_fgo.timing import StageTimer

PLATFORMS = {"car": CAR_PLATFORM, "robot": ROBOT_PLATFORM}
SETTLED_S = 5  # frames before are not judged


@dataclass(frozen=True)
class Row:
    path_m: float
    rmse_m: float
    worst_m: float
    nees: float
    lowest_position: float  # smallest standard deviation of an axis, as a share of the first
    lowest_yaw: float


def job(
    name: str, seed: int, config: Config, duration_s: float, noise: bool, outliers: float
) -> Row:
    recording = record_features(
        PLATFORMS[name],
        duration_s,
        np.random.default_rng(seed),
        noise=noise,
        outlier_share=outliers,
    )
    backend = make_backend(config, recording.calibration, StageTimer())
    result = run_features(backend, recording, np.random.default_rng([seed, 1]) if noise else None)
    steps = np.diff(recording.T_world_imu[:, :3, 3], axis=0)
    sigmas = free_sigmas(
        np.array([e.state.T_world_imu for e in result.estimates]),
        np.array([e.covariance for e in result.estimates]),
    )
    lowest = (sigmas / sigmas[0]).min(axis=0)
    return Row(
        float(np.linalg.norm(steps, axis=1).sum()),
        result.position_rmse,
        float(result.position_error.max()),
        float(result.nees[10 * SETTLED_S :].mean()),
        float(lowest[:3].min()),
        float(lowest[3]),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--backend", default="smoother")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds")
    parser.add_argument("--outliers", type=float, default=0.0, help="share of corrupted tracks")
    parser.add_argument("--platforms", nargs="+", default=list(PLATFORMS), choices=PLATFORMS)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    settings = read_settings(options.set)
    config = override(load_config(), {"backend.kind": options.backend, **settings})
    write = sys.stdout.write
    with ProcessPoolExecutor(options.jobs) as pool:
        for noise in (False, True):
            if options.outliers and not noise:
                continue
            seeds = range(options.seeds if noise else min(options.seeds, 3))
            write(f"\n{'With noise' if noise else 'Without noise'}, {options.duration:g} s\n\n")
            write("| platform | seed | path m | ATE (start) m | worst m | NEES | least σ x, y, z ")
            write("| least σ yaw |\n|---|---|---|---|---|---|---|---|\n")
            for name in options.platforms:
                work = partial(
                    job,
                    name,
                    config=config,
                    duration_s=options.duration,
                    noise=noise,
                    outliers=options.outliers,
                )
                rows = list(pool.map(work, seeds))
                for seed, r in zip(seeds, rows, strict=True):
                    write(
                        f"| {name} | {seed} | {r.path_m:.0f} | {r.rmse_m:.3g} | {r.worst_m:.3g} |"
                        f" {r.nees:.3g} | {r.lowest_position:.4f} | {r.lowest_yaw:.4f} |\n"
                    )
                mean = np.mean([r.nees for r in rows])
                errors = np.array([r.rmse_m for r in rows])
                rms, median = np.sqrt(np.mean(errors**2)), np.median(errors)
                worst = max(r.worst_m for r in rows)
                position, yaw = (
                    min(r.lowest_position for r in rows),
                    min(r.lowest_yaw for r in rows),
                )
                write(
                    f"| {name} | all | | {rms:.3g} (median {median:.3g}) | {worst:.3g} |"
                    f" **{mean:.3g}** | {position:.4f} | {yaw:.4f} |\n"
                )
                sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
