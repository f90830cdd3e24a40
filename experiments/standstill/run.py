"""How far does the estimate move while a robot stands for 15 s? Prints a table in markdown."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from p2gd_fgo.backends.factory import make_backend
from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.evaluation.feature_runs import detected_still, run_features
from p2gd_fgo.simulation.feature_recording import (
    CAR_PLATFORM,
    ROBOT_PLATFORM,
    record_features,
)
from p2gd_fgo.timing import StageTimer

STOPS = ((40.0, 22.0, 37.0), (30.0, 10.0, 25.0))  # length of the drive, begin and end of the stop
SETTLED_FRAMES = 30
PLATFORMS = {"robot": ROBOT_PLATFORM, "car": CAR_PLATFORM}


def job(
    seed: int,
    config: Config,
    platform: str,
    detection_s: float,
    duration_s: float,
    begin_s: float,
    end_s: float,
) -> tuple[float, ...]:
    rng = np.random.default_rng(seed)
    stops = ((begin_s, end_s),)
    recording = record_features(PLATFORMS[platform], duration_s, rng, stops_s=stops)
    backend = make_backend(config, recording.calibration, StageTimer())
    still = detected_still(recording, detection_s)
    result = run_features(backend, recording, np.random.default_rng([seed, 1]), stationary=still)
    p = np.array([e.state.T_world_imu[:3, 3] for e in result.estimates])
    at = np.flatnonzero(recording.still)
    first, known, settled, last = at[0], int(np.argmax(still)), at[SETTLED_FRAMES], at[-1]
    P = [result.estimates[k].covariance[3:6, 3:6] for k in (known, last)]
    return (
        float(np.linalg.norm(p[last] - p[first])),
        float(np.linalg.norm(p[last] - p[known])),
        float(np.sqrt(np.linalg.eigvalsh(P[0] - P[1]).clip(0.0).sum())),
        float(np.linalg.norm(p[last] - p[settled])),
        float(result.position_error[first]),
        float(result.position_error[last]),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--backend", default="smoother")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--platform", choices=sorted(PLATFORMS), default="robot")
    parser.add_argument("--stop", type=float, nargs=2, metavar=("BEGIN", "END"), help="s")
    parser.add_argument("--detection", type=float, default=0.5, help="s until it is recognised")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    settings = read_settings(options.set)
    config = override(load_config(), {"backend.kind": options.backend, **settings})
    stops = list(STOPS)
    if options.stop:
        begin_s, end_s = options.stop
        stops = [(end_s + 2.0, begin_s, end_s)]
    write = sys.stdout.write
    write(
        "| stop s | seed | moved m | from recognition on m | expected m | from 3 s on m "
        "| error at its begin m | at its end m |\n"
    )
    write(8 * "|---" + "|\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        for duration_s, begin_s, end_s in stops:
            work = partial(
                job,
                config=config,
                platform=options.platform,
                detection_s=options.detection,
                duration_s=duration_s,
                begin_s=begin_s,
                end_s=end_s,
            )
            rows = list(pool.map(work, range(options.seeds)))
            name = f"{begin_s:g}-{end_s:g}"
            for seed, row in enumerate(rows):
                write(f"| {name} | {seed} | {' | '.join(f'{v:.3f}' for v in row)} |\n")
            median = np.median(rows, axis=0)
            write(f"| {name} | median | {' | '.join(f'**{v:.3f}**' for v in median)} |\n")


if __name__ == "__main__":
    run_refusing(main)
