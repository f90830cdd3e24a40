"""Half an hour of driving on a turning Earth, with and without compensation; prints a table."""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402

from p2gd_fgo.backends.factory import make_backend  # noqa: E402
from p2gd_fgo.config import load_config, override  # noqa: E402
from p2gd_fgo.evaluation.feature_runs import run_features  # noqa: E402
from p2gd_fgo.imu import earth_rate  # noqa: E402
from p2gd_fgo.simulation.features import CAR_FEATURES  # noqa: E402
from p2gd_fgo.simulation.presets import find_preset, load_scenario  # noqa: E402
from p2gd_fgo.simulation.world_features import record_world_features  # noqa: E402
from p2gd_fgo.timing import StageTimer  # noqa: E402

LATITUDE_DEG, HEADING_DEG = 37.0, 30.0
QUIET = {
    "imu.gyro_noise_density": 0.0,
    "imu.accel_noise_density": 0.0,
    "imu.gyro_random_walk": 0.0,
    "imu.accel_random_walk": 0.0,
    "imu.gyro_bias_sigma": 0.0,
    "imu.accel_bias_sigma": 0.0,
}


def job(task: tuple[str, bool, bool], minutes: float) -> tuple[float, float, float]:
    """Largest position error in m, yaw error at the end in degrees, path in m."""
    backend, turning, compensated = task
    settings: dict[str, object] = {
        "duration_s": 60.0 * minutes,
        "imu.earth_rotation": turning,
        "imu.latitude_deg": LATITUDE_DEG,
        "imu.heading_deg": HEADING_DEG,
    }
    scenario = load_scenario(find_preset("kaist_like"), settings | QUIET)
    model = replace(CAR_FEATURES, pixel_noise_px=0.0, camera_height_m=scenario.vehicle.imu_height_m)
    recording = record_world_features(scenario, model=model, build=False)
    assumed = load_scenario(find_preset("kaist_like"), {}).imu  # what a filter must believe
    names = ("gyro_noise_density", "gyro_random_walk", "accel_noise_density", "accel_random_walk")
    densities = {f"imu.{name}": getattr(assumed, name) for name in names}
    config = override(load_config(), {"backend.kind": backend} | densities)
    run = run_features(
        make_backend(config, recording.calibration, StageTimer()),
        recording,
        earth_rate=earth_rate(LATITUDE_DEG, HEADING_DEG) if compensated else None,
    )
    p = recording.T_world_imu[:, :3, 3]
    path = float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())
    rotation = run.errors[-1, :3]
    return float(run.position_error.max()), float(np.degrees(np.linalg.norm(rotation))), path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    tasks = [
        (backend, turning, compensated)
        for backend in ("msckf", "smoother")
        for turning, compensated in ((False, False), (True, False), (True, True))
    ]
    write = sys.stdout.write
    write("| back end | Earth | compensated | path m | largest error m | rotation at the end ° |\n")
    write("|---|---|---|---|---|---|\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        done = pool.map(partial(job, minutes=options.minutes), tasks)
        for (backend, turning, compensated), (error_m, rotation_deg, path_m) in zip(
            tasks, done, strict=True
        ):
            write(
                f"| {backend} | {'turns' if turning else 'stands'} | "
                f"{'yes' if compensated else 'no'} | {path_m:.0f} | {error_m:.3g} | "
                f"{rotation_deg:.3g} |\n"
            )


if __name__ == "__main__":
    main()
