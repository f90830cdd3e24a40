"""Every way of spreading features on one recording: ``run.py FOLDER --out FILE``, two tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import cv2  # noqa: E402
import numpy as np  # noqa: E402

from p2gd_fgo.cli.options import read_settings  # noqa: E402
from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.config import Config, load_config, override  # noqa: E402
from p2gd_fgo.datasets import open_sequence  # noqa: E402
from p2gd_fgo.evaluation.evaluate import evaluate  # noqa: E402
from p2gd_fgo.evaluation.tracking_quality import camera_rotations, tracking_quality  # noqa: E402
from p2gd_fgo.pipeline import run_sequence  # noqa: E402

P2GD: dict[str, object] = {"distribution.kind": "p2gd"}
_P2GD = "distribution.p2gd."
FAR = {_P2GD + "scene.max_depth": 1000.0, _P2GD + "scene.max_condition": 1e8}
FLOOR = {_P2GD + "floor": 0.5}
REFILL = {"distribution.refill": True}
CONTINUE = {"frontend.continue_consumed": True}
D_OPTIMAL = {_P2GD + "allocate": "d_optimal"}
ORB = {"frontend.tracker": "orb"}
EQUALIZE = {"frontend.equalize": True}
ROWS: dict[str, Mapping[str, object]] = {
    "grid": {},
    "grid + refill": REFILL,
    "grid + continued tracks": CONTINUE,
    "p2gd, as in the paper": P2GD,
    "p2gd before tracking": P2GD | {_P2GD + "when": "before_tracking"},
    "p2gd into the loss": P2GD | {_P2GD + "into_loss": True},
    "p2gd by track length": P2GD | {_P2GD + "weight": "track_length"},
    "p2gd + floor": P2GD | FLOOR,
    "p2gd + refill": P2GD | REFILL,
    "p2gd + floor + refill": P2GD | FLOOR | REFILL,
    "p2gd + share for new cells": P2GD | {_P2GD + "share_new_cells": True},
    "p2gd + grid when still": P2GD | {_P2GD + "still_parallax_px": 0.3},
    "p2gd + continued tracks": P2GD | CONTINUE,
    "d_optimal": P2GD | D_OPTIMAL,
    "d_optimal, far points": P2GD | D_OPTIMAL | FAR,
    "d_optimal, far + floor + refill": P2GD | D_OPTIMAL | FAR | FLOOR | REFILL,
    "quadtree": {"distribution.kind": "quadtree"},
    "anms": {"distribution.kind": "anms"},
    "uniform random": {"distribution.kind": "uniform_random"},
    "p2gd, constant velocity": P2GD | {"priors.source": "constant_velocity"},
    "p2gd, truth + 0.25 m": P2GD | {"priors.source": "noisy_truth", "priors.position_noise": 0.25},
    "p2gd, truth + 2.5° yaw": P2GD | {"priors.source": "noisy_truth", "priors.yaw_noise_deg": 2.5},
    "p2gd, no priors": P2GD | {"priors.source": "none"},
    "ORB: grid": ORB,
    "ORB: p2gd": P2GD | ORB,
    "equalised: grid": EQUALIZE,
    "equalised: p2gd": P2GD | EQUALIZE,
}
MEASURES = {
    "length": ("mean_length", 1.0, 2),
    "two-view °": ("two_view_parallax_deg", 1.0, 3),
    "total °": ("total_parallax_deg", 1.0, 2),
    "single %": ("single_frame_share", 100.0, 1),
    "features/image": ("features_per_frame", 1.0, 0),
    "total °/image": ("total_parallax_per_frame_deg", 1.0, 0),
    "≥3/image": ("tracks_3_per_frame", 1.0, 1),
    "≥10/image": ("tracks_10_per_frame", 1.0, 2),
    "asked": ("quota_asked_per_frame", 1.0, 0),
    "served": ("quota_served_per_frame", 1.0, 0),
}
ERRORS = {
    "ATE yaw_pos m": ("ate_yaw_pos", 1.0, 3),
    "ATE origin m": ("ate_origin", 1.0, 3),
    "ARE °": ("are", 1.0, 3),
    "RTE short %": ("rte_short", 1.0, 2),
    "RTE long %": ("rte_long", 1.0, 2),
    "scale": ("scale", 1.0, 3),
    "distribute ms": ("distribute_ms", 1.0, 2),
    "frame ms": ("frame_ms", 1.0, 1),
}


def job(task: tuple[str, int], config: Config, lengths_m: Sequence[float]) -> dict[str, object]:
    """Measures and errors of one run."""
    name, seed = task
    config = override(config, {"runtime.seed": seed, **ROWS[name]})
    cv2.setNumThreads(1)
    sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
    assert sequence.truth is not None
    truth = sequence.truth.trajectory
    result = run_sequence(sequence, config)
    rotations = camera_rotations(
        result.tracks.stamps_ns, truth, result.estimate, sequence.calibration.T_imu_cam
    )
    metrics = evaluate(
        result.estimate, truth, frames_total=result.frames_total, config=config.evaluation
    ).to_json()
    rte = {entry["length_m"]: entry["percent"] for entry in metrics["rte"]}
    stages = {
        f"{stage}_ms": float(np.median([row[stage][0] for row in result.timing]))
        for stage in ("distribute", "frame")
    }
    return {
        "row": name,
        "seed": seed,
        "status": result.status,
        "completeness": metrics["completeness"],
        "ate_yaw_pos": metrics["ate_m"]["yaw_pos"]["rmse"],
        "ate_origin": metrics["ate_m"]["origin"]["rmse"],
        "are": metrics["are_deg"]["yaw_pos"]["rmse"],
        "rte_short": rte.get(lengths_m[0]),
        "rte_long": rte.get(lengths_m[1]),
        "scale": metrics["scale"],
        **stages,
        **{
            key: tracking_quality(result.tracks, rotations).to_json()[key]
            for key, _, _ in MEASURES.values()
        },
    }


def table(
    rows: Sequence[Mapping[str, object]], columns: Mapping[str, tuple[str, float, int]]
) -> str:
    """Mean ± standard deviation over the seeds, in markdown."""
    lines = [f"| | runs | {' | '.join(columns)} |", "|---" * (len(columns) + 2) + "|"]
    for name in ROWS:
        runs = [row for row in rows if row["row"] == name]
        if not runs:
            continue
        done = [run for run in runs if run["status"] == "done"]
        cells = []
        for key, factor, decimals in columns.values():
            values = factor * np.array([run[key] for run in done], dtype=float)
            cells.append(f"{values.mean():.{decimals}f} ± {values.std(ddof=1):.{decimals}f}")
        lines.append(f"| {name} | {len(done)}/{len(runs)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="recording with truth")
    parser.add_argument(
        "--out", type=Path, required=True, help="a line per run; goes on from there"
    )
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--rows", nargs="*", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--rte-lengths", nargs=2, type=float, default=(10.0, 100.0))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    settings = read_settings(options.set)
    given = {"dataset.path": str(options.folder), "initialization.kind": "given"}
    config = override(load_config(), given | settings)
    results = []
    if options.out.exists():
        results = [json.loads(line) for line in options.out.read_text().splitlines()]
    known = {(run["row"], run["seed"]) for run in results}
    tasks = [(n, s) for s in range(options.seeds) for n in options.rows if (n, s) not in known]
    work = partial(job, config=config, lengths_m=options.rte_lengths)
    with ProcessPoolExecutor(options.jobs) as pool, options.out.open("a") as file:
        for future in as_completed([pool.submit(work, task) for task in tasks]):
            results.append(future.result())
            file.write(json.dumps(results[-1]) + "\n")
            file.flush()
            sys.stderr.write(f"{len(results)}/{len(tasks) + len(known)}\r")
    sys.stdout.write(f"{table(results, MEASURES)}\n\n{table(results, ERRORS)}\n")


if __name__ == "__main__":
    run_refusing(main)
