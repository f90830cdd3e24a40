"""What does each fault do to each back end? Prints a table in markdown."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import load_config, override
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.evaluation.alignment import Alignment, align_yaw_pos
from p2gd_fgo.evaluation.consistency import nees
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.simulation import faults
from p2gd_fgo.types import NANOSECONDS, FloatArray

Fault = Callable[[Sequence, float], Sequence]

FAULTS: dict[str, Fault] = {
    "0.5 s without images": lambda s, t: faults.without_images(s, t, 0.5),
    "3 s without images": lambda s, t: faults.without_images(s, t, 3.0),
    "1 s black images": lambda s, t: faults.black_images(s, t, 1.0),
    "2 s frozen image": lambda s, t: faults.frozen_image(s, t, 2.0),
    "1 s IMU gap": lambda s, t: faults.imu_hole(s, t, 1.0),
    "30 % duplicated stamps": lambda s, t: faults.doubled_stamps(s, 0.3, np.random.default_rng(1)),
    "brightness x 1.8 for 2 s": lambda s, t: faults.brightness_jump(s, t, 2.0, 1.8),
    "brightness x 0.4 for 2 s": lambda s, t: faults.brightness_jump(s, t, 2.0, 0.4),
    "truck over 60 % for 3 s": lambda s, t: faults.passing_truck(s, t, 3.0),
}
ALWAYS = {"started", "standstill", "truth_missing", "truth_partial", "images_outside_imu"}


@dataclass(frozen=True)
class Row:
    """What one run gave."""

    status: str
    images: int
    ate_m: float
    nees: float
    sigma_m: float
    events: Counter[str]


def measured(result: RunResult, sequence: Sequence, fault_s: float) -> Row:
    events = Counter(e.kind for e in result.events if e.kind not in ALWAYS)
    if sequence.truth is None or len(result.estimate) == 0:
        return Row(result.status, len(result.estimate), np.nan, np.nan, np.nan, events)
    estimate = result.estimate
    finite = np.isfinite(estimate.T_world_imu).all() and np.isfinite(result.covariances).all()
    truth = sequence.truth.trajectory
    inside = (estimate.stamps_ns >= truth.stamps_ns[0]) & (
        estimate.stamps_ns <= truth.stamps_ns[-1]
    )
    T, P = estimate.T_world_imu[inside], result.covariances[inside]
    reference = interpolate(truth, estimate.stamps_ns[inside])
    aligned = align_yaw_pos(T, reference).apply(T)
    error = np.linalg.norm(aligned[:, :3, 3] - reference[:, :3, 3], axis=1)
    since_s = (estimate.stamps_ns[inside] - sequence.image_stamps_ns[0]) / NANOSECONDS - fault_s
    after = (since_s > 0.0) & (since_s < 5.0)
    offset = from_start(T, reference, since_s)
    squares = nees(offset, P[:, 3:6, 3:6])
    sigma = np.sqrt(np.linalg.eigvalsh(P[:, 3:6, 3:6])[:, -1])
    return Row(
        result.status if finite else "NOT FINITE",
        len(estimate),
        float(np.sqrt(np.mean(error**2))),
        float(squares[after].max()) if after.any() else np.nan,
        float(sigma[after].max()) if after.any() else np.nan,
        events,
    )


def from_start(T: FloatArray, reference: FloatArray, since_s: FloatArray) -> FloatArray:
    """Position errors (N, 3) after bringing first position and yaw together."""
    one = align_yaw_pos(T[:1], reference[:1])
    return np.asarray((Alignment(1.0, one.T).apply(T) - reference)[:, :3, 3])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path")
    parser.add_argument("--backends", nargs="+", default=["smoother", "msckf"])
    parser.add_argument("--only", nargs="+", default=[], help="faults whose name holds a word")
    parser.add_argument("--at", type=float, default=None, help="s; by default the middle")
    parser.add_argument("--duration", type=float, default=25.0, help="s of the recording")
    parser.add_argument("--start", type=float, default=0.0, help="s of the recording left out")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    options = parser.parse_args()
    settings = read_settings(options.set)
    cv2.setNumThreads(1)
    write = sys.stdout.write
    write(
        "| fault | back end | status | images | ATE m | x clean | worst NEES | sigma m | events |\n"
    )
    write("|---|---|---|---|---|---|---|---|---|\n")
    base = override(
        load_config(),
        {"dataset.path": options.path, "dataset.duration_s": options.duration,
         "dataset.start_s": options.start} | settings,
    )  # fmt: skip
    sequence = open_sequence(base.dataset)
    stamps = sequence.image_stamps_ns
    at = options.at or float(stamps[-1] - stamps[0]) / NANOSECONDS / 2.0
    for backend in options.backends:
        config = override(base, {"backend.kind": backend})
        clean = measured(run_sequence(sequence, config), sequence, at)
        show(write, "none", backend, clean, clean)
        for name, fault in FAULTS.items():
            if options.only and not any(word in name for word in options.only):
                continue
            faulty = fault(sequence, at)
            show(write, name, backend, measured(run_sequence(faulty, config), faulty, at), clean)


def show(write: Callable[[str], object], name: str, backend: str, row: Row, clean: Row) -> None:
    kinds = ", ".join(f"{k} x{n}" if n > 1 else k for k, n in sorted(row.events.items())) or "-"
    write(
        f"| {name} | {backend} | {row.status} | {row.images} | {row.ate_m:.3f} "
        f"| {row.ate_m / clean.ate_m:.2f} | {row.nees:.1f} | {row.sigma_m:.3f} | {kinds} |\n"
    )
    sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
