"""Which pixel noise do tracks deserve? Prints a table in markdown, a row for each belief.

Whole runs on recordings with truth from a start that errs as its covariance says: the errors
against what the back end claims, pose by pose, and nothing aligned.
"""

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

from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.evaluation.consistency import nees, pose_error
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.types import NANOSECONDS

SETTLED_S = 5.0  # since the start; before, what is claimed is the start's


@dataclass(frozen=True)
class Drive:
    """What one run gave."""

    ate_m: float
    are_deg: float
    nees: float  # of poses, the mean over time; 6 expected


def drive(path: str, settings: dict[str, object]) -> Drive:
    config = override(load_config(), {"dataset.path": path} | settings)
    sequence = open_sequence(config.dataset)
    if sequence.truth is None:
        raise DataError(f"{path} has no truth to judge by; take a recording that has")
    result = run_sequence(sequence, config)
    if result.status != "done":
        raise DataError(f"the run on {path} with {settings} failed: {result.reason}")
    truth, stamps = sequence.truth.trajectory, result.estimate.stamps_ns
    inside = (stamps >= truth.stamps_ns[0]) & (stamps <= truth.stamps_ns[-1])
    T, P = result.estimate.T_world_imu[inside], result.covariances[inside]
    reference = interpolate(truth, stamps[inside])
    settled = stamps[inside] > stamps[0] + SETTLED_S * NANOSECONDS
    squares = nees(pose_error(T, reference)[settled], P[settled, :6, :6])
    metrics = evaluate(
        result.estimate, truth, frames_total=None, config=config.evaluation
    ).to_json()
    ate, are = (metrics[name]["yaw_pos"]["rmse"] for name in ("ate_m", "are_deg"))
    return Drive(ate, are, float(squares.mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", metavar="REC")
    parser.add_argument("--noise", type=float, nargs="+", default=[1.0, 0.5, 0.3, 0.2], help="px")
    parser.add_argument("--tracks", nargs="+", default=["free", "anchored"])
    parser.add_argument("--backends", nargs="+", default=["smoother", "msckf"])
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    if unknown := set(options.tracks) - {"free", "anchored"}:
        raise ConfigError(f"--tracks {' '.join(sorted(unknown))}: there are free and anchored")
    base = {
        "initialization.kind": "given", "initialization.given.noise": True, "runtime.threads": 1,
    } | read_settings(options.set)  # fmt: skip
    write = sys.stdout.write
    write(f"{len(options.paths)} recordings, means; NEES of a pose: 6 expected\n\n")
    write("| back end | tracks | noise px | ATE m | ARE ° | NEES, mean | median | worst |\n")
    write("|---|---|---|---|---|---|---|---|\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        for backend in options.backends:
            for tracks in options.tracks:
                for noise_px in options.noise:
                    settings = base | {
                        "backend.kind": backend,
                        "frontend.anchor": tracks == "anchored",
                        "backend.pixel_noise_px": noise_px,
                    }
                    drives = list(pool.map(partial(drive, settings=settings), options.paths))
                    squares = [d.nees for d in drives]
                    write(
                        f"| {backend} | {tracks} | {noise_px:g} "
                        f"| {np.mean([d.ate_m for d in drives]):.3f} "
                        f"| {np.mean([d.are_deg for d in drives]):.3f} "
                        f"| {np.mean(squares):.1f} | {np.median(squares):.1f} "
                        f"| {max(squares):.1f} |\n"
                    )
                    sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
