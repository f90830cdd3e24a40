"""How far does the estimate move during a recording's longest standstill? Prints a table."""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402

from p2gd_fgo.config import load_config, override  # noqa: E402
from p2gd_fgo.datasets import open_sequence  # noqa: E402
from p2gd_fgo.geometry.pose import interpolate  # noqa: E402
from p2gd_fgo.pipeline import run_sequence  # noqa: E402
from p2gd_fgo.types import NANOSECONDS, FloatArray  # noqa: E402

STILL_M = 1e-4  # from image to image, of truth
RECOGNISED_S = 1.0


def longest_standstill(positions: FloatArray) -> tuple[int, int]:
    """First and last image (N, 3) of it."""
    moving = np.linalg.norm(np.diff(positions, axis=0), axis=1) > STILL_M
    ends = np.flatnonzero(np.concatenate([[True], moving, [True]]))
    return max(((a, b - 1) for a, b in pairwise(ends)), key=lambda span: span[1] - span[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--backend", nargs="+", default=["smoother", "msckf"])
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    write = sys.stdout.write
    write("| back end | seed | stands s | moved m | moved from 1 s on m | off at its begin m | ")
    write("at its end m |\n|---|---|---|---|---|---|---|\n")
    for backend in options.backend:
        for seed in range(options.seeds):
            settings = {
                "dataset.path": str(options.recording),
                "backend.kind": backend,
                "runtime.seed": seed,
            }
            config = override(load_config(), settings)
            sequence = open_sequence(config.dataset)
            if sequence.truth is None:
                parser.error(f"{options.recording}: no truth, which says when the body stands")
            estimate = run_sequence(sequence, config).estimate
            stamps = estimate.stamps_ns
            truth = interpolate(sequence.truth.trajectory, stamps)[:, :3, 3]
            p = estimate.T_world_imu[:, :3, 3]
            first, last = longest_standstill(truth)
            known = int(np.searchsorted(stamps, stamps[first] + RECOGNISED_S * NANOSECONDS))
            # Relative to the first pose: the frame of a static start is the estimator's own.
            error = np.linalg.norm(p - p[0], axis=1) - np.linalg.norm(truth - truth[0], axis=1)
            write(
                f"| {backend} | {seed} | {(stamps[last] - stamps[first]) / NANOSECONDS:.1f} | "
                f"{np.linalg.norm(p[last] - p[first]):.3f} | "
                f"{np.linalg.norm(p[last] - p[known]):.3f} | {abs(error[first]):.3f} | "
                f"{abs(error[last]):.3f} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
