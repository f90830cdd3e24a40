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
from p2gd_fgo.evaluation.alignment import align_yaw_pos  # noqa: E402
from p2gd_fgo.geometry.pose import interpolate  # noqa: E402
from p2gd_fgo.pipeline import run_sequence  # noqa: E402
from p2gd_fgo.types import NANOSECONDS, FloatArray  # noqa: E402

STILL_M = 1e-4  # from image to image, of truth
SETTLE_NS = 3 * NANOSECONDS  # what a standstill tells about the way behind is mostly told by then


def longest_standstill(positions: FloatArray) -> tuple[int, int]:
    """First and last image (N, 3) of it."""
    moving = np.linalg.norm(np.diff(positions, axis=0), axis=1) > STILL_M
    ends = np.flatnonzero(np.concatenate([[True], moving, [True]]))
    return max(((a, b - 1) for a, b in pairwise(ends.tolist())), key=lambda span: span[1] - span[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--backend", nargs="+", default=["smoother", "msckf"])
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    write = sys.stdout.write
    write(
        "| back end | seed | stands s | recognised s | moved m | from recognition on m | expected "
    )
    write("m | from 3 s later on m | error at the stop m | at recognition m | at the end m |\n")
    write(11 * "|---" + "|\n")
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
            result = run_sequence(sequence, config)
            stamps, T = result.estimate.stamps_ns, result.estimate.T_world_imu
            reference = interpolate(sequence.truth.trajectory, stamps)
            first, last = longest_standstill(reference[:, :3, 3])
            known = first + int(np.argmax(result.still[first : last + 1]))
            if not result.still[known]:
                parser.error(f"{options.recording}: the standstill was not recognised")
            p = T[:, :3, 3]
            later = int(np.searchsorted(stamps, stamps[known] + SETTLE_NS))
            # Brought together at the first pose: a static start chooses position and yaw freely.
            start = align_yaw_pos(T[:1], reference[:1])
            error = np.linalg.norm((start.apply(T) - reference)[:, :3, 3], axis=1)
            P = result.covariances[:, 3:6, 3:6]
            learnt = np.linalg.eigvalsh(P[known] - P[last]).clip(0.0).sum()
            write(
                f"| {backend} | {seed} | {(stamps[last] - stamps[first]) / NANOSECONDS:.1f} | "
                f"{(stamps[known] - stamps[first]) / NANOSECONDS:.1f} | "
                f"{np.linalg.norm(p[last] - p[first]):.3f} | "
                f"{np.linalg.norm(p[last] - p[known]):.3f} | {np.sqrt(learnt):.3f} | "
                f"{np.linalg.norm(p[later : last + 1] - p[later], axis=1).max():.3f} | "
                f"{error[first]:.3f} | {error[known]:.3f} | {error[last]:.3f} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
