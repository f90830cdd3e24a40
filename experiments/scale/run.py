"""Does a back end learn a scale from nothing? Prints a table in markdown, a row for each back end.

Drives of a preset's routes with tracks that are simulated, not rendered. The mean error of the
speed over many routes is what has a sign; a single route's scale drifts to either side.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from p2gd_fgo.backends.factory import make_backend
from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.alignment import align_yaw_pos
from p2gd_fgo.evaluation.feature_runs import detected_still, run_features
from p2gd_fgo.simulation.features import CAR_FEATURES, ROBOT_FEATURES
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.world_features import record_world_features
from p2gd_fgo.timing import StageTimer

BACKENDS: dict[str, dict[str, object]] = {
    "smoother": {"backend.kind": "smoother"},
    "MSCKF": {"backend.kind": "msckf"},
    "MSCKF, linearised at the prediction": {
        "backend.kind": "msckf",
        "backend.msckf.look_ahead": False,
    },
}
LEAST_SHARE = 0.4  # of the fastest; slower images say nothing about scale
SURVIVAL = {"car": 0.85, "robot": 0.9}  # of a track to the next image
SETTLED = 50  # images before are not judged
DELAY_S = 0.5  # of the detector of standstill


@dataclass(frozen=True)
class Drive:
    speed_error: float  # mean, relative
    ate_m: float
    nees: float
    cpu_s: float


def drive(route: int, preset: str, config: Config, pixel_noise_px: float, outliers: float) -> Drive:
    scenario = load_scenario(find_preset(preset), {"seed": route, "duration_s": 60.0})
    car = scenario.vehicle.kind == "car"
    model = replace(
        CAR_FEATURES if car else ROBOT_FEATURES,
        camera_height_m=scenario.vehicle.imu_height_m,
        survival=SURVIVAL[scenario.vehicle.kind],
        pixel_noise_px=pixel_noise_px,
        outlier_share=outliers,
    )
    recording = record_world_features(scenario, model=model, build=False)
    backend = make_backend(config, recording.calibration, StageTimer())
    start = time.process_time()
    result = run_features(
        backend,
        recording,
        np.random.default_rng(route),
        stationary=detected_still(recording, DELAY_S),
    )
    cpu_s = time.process_time() - start
    true = np.linalg.norm(recording.velocity, axis=1)
    speed = np.linalg.norm([e.state.velocity for e in result.estimates], axis=1)
    moving = true > LEAST_SHARE * true.max()
    poses = np.array([e.state.T_world_imu for e in result.estimates])
    off = align_yaw_pos(poses, recording.T_world_imu).apply(poses) - recording.T_world_imu
    return Drive(
        float((speed[moving] / true[moving] - 1.0).mean()),
        float(np.sqrt(np.mean(np.sum(off[:, :3, 3] ** 2, axis=1)))),
        float(result.nees[SETTLED:].mean()),
        cpu_s,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="robot_like")
    parser.add_argument("--routes", type=int, default=10, help="0, 1, ... of them")
    parser.add_argument("--pixel-noise", type=float, default=0.3, help="px, of the tracks")
    parser.add_argument("--outliers", type=float, default=0.0, help="share of corrupted tracks")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    if options.routes < 2:
        raise ConfigError(f"--routes {options.routes}: give 2 or more, an error needs a spread")
    settings = read_settings(options.set)
    write = sys.stdout.write
    write("| back end | speed error, mean | ATE m | NEES | CPU s |\n|---|---|---|---|---|\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        for name, choice in BACKENDS.items():
            work = partial(
                drive,
                preset=options.preset,
                config=override(load_config(), {**choice, **settings}),
                pixel_noise_px=options.pixel_noise,
                outliers=options.outliers,
            )
            drives = list(pool.map(work, range(options.routes)))
            bias = np.array([d.speed_error for d in drives])
            error = bias.std(ddof=1) / np.sqrt(len(bias))
            ate, nees, cpu = np.mean([(d.ate_m, d.nees, d.cpu_s) for d in drives], axis=0)
            write(
                f"| {name} | {bias.mean():+.2%} ± {error:.2%} | {ate:.3f} | {nees:.1f} "
                f"| {cpu:.1f} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
