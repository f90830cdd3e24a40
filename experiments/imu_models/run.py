"""Half an hour of driving with an IMU that feels more than the motion; prints a table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402

from p2gd_fgo.backends.factory import make_backend  # noqa: E402
from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.config import load_config, override  # noqa: E402
from p2gd_fgo.evaluation.feature_runs import run_features  # noqa: E402
from p2gd_fgo.imu import earth_rate  # noqa: E402
from p2gd_fgo.simulation.features import CAR_FEATURES  # noqa: E402
from p2gd_fgo.simulation.presets import find_preset, load_scenario  # noqa: E402
from p2gd_fgo.simulation.world_features import record_world_features  # noqa: E402
from p2gd_fgo.timing import StageTimer  # noqa: E402

PRESET = "kaist_like"
LATITUDE_DEG, HEADING_DEG = 37.0, 30.0
DENSITIES = ("gyro_noise_density", "gyro_random_walk", "accel_noise_density", "accel_random_walk")
QUIET: dict[str, object] = dict.fromkeys(
    [f"imu.{name}" for name in (*DENSITIES, "gyro_bias_sigma", "accel_bias_sigma")], 0.0
)
TURNING: dict[str, object] = {
    "imu.earth_rotation": True,
    "imu.latitude_deg": LATITUDE_DEG,
    "imu.heading_deg": HEADING_DEG,
}
TAU_S = 30.0
PULLED: dict[str, object] = {
    "imu.bias_model": "gauss_markov",
    "imu.gyro_correlation_s": TAU_S,
    "imu.accel_correlation_s": TAU_S,
    "imu.gyro_bias_sigma": 0.01,
    "imu.accel_bias_sigma": 0.1,
}
# Driven so that the biases keep the sigmas that they start with.
KEPT: dict[str, object] = {
    "imu.gyro_random_walk": 0.01 * np.sqrt(2.0 / TAU_S),
    "imu.accel_random_walk": 0.1 * np.sqrt(2.0 / TAU_S),
}


@dataclass(frozen=True)
class Case:
    """What the IMU feels, and what the estimator believes."""

    world: str
    belief: str
    imu: dict[str, object]
    config: dict[str, object]
    earth: bool = False


def cases(question: str) -> Iterator[Case]:
    if question == "earth":
        yield Case("Earth stands", "stands", {}, {})
        yield Case("Earth turns", "stands", TURNING, {})
        yield Case("Earth turns", "turns", TURNING, {}, earth=True)
        return
    times = {"imu.gyro_correlation_s": TAU_S, "imu.accel_correlation_s": TAU_S}
    densities: dict[str, object] = {}
    imu = PULLED
    if question == "driven":
        imu = PULLED | KEPT
        densities = KEPT
    yield Case(f"bias {question}", "random walk", imu, densities)
    yield Case(f"bias {question}", "Gauss-Markov", imu, densities | times)


def job(task: tuple[str, Case, int], minutes: float) -> tuple[float, float, float, float]:
    """Largest and RMS position error in m, rotation error at the end in degrees, path in m."""
    backend, case, seed = task
    settings = {"duration_s": 60.0 * minutes, "seed": seed} | QUIET | case.imu
    scenario = load_scenario(find_preset(PRESET), settings)
    model = replace(CAR_FEATURES, pixel_noise_px=0.0, camera_height_m=scenario.vehicle.imu_height_m)
    recording = record_world_features(scenario, model=model, build=False)
    assumed = load_scenario(find_preset(PRESET), {}).imu  # a filter must believe in some noise
    densities: dict[str, object] = {f"imu.{name}": getattr(assumed, name) for name in DENSITIES}
    config = override(load_config(), {"backend.kind": backend} | densities | case.config)
    run = run_features(
        make_backend(config, recording.calibration, StageTimer()),
        recording,
        earth_rate=earth_rate(LATITUDE_DEG, HEADING_DEG) if case.earth else None,
    )
    p = recording.T_world_imu[:, :3, 3]
    path = float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())
    rotation_deg = float(np.degrees(np.linalg.norm(run.errors[-1, :3])))
    return float(run.position_error.max()), run.position_rmse, rotation_deg, path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("question", choices=["earth", "decaying", "driven"])
    parser.add_argument("--backend", nargs="+", default=["msckf", "smoother"])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    tasks = [
        (backend, case, seed)
        for backend in options.backend
        for case in cases(options.question)
        for seed in range(options.seeds)
    ]
    write = sys.stdout.write
    write("| back end | world | believed | route | path m | largest error m | RMS m | end ° |\n")
    write("|---|---|---|---|---|---|---|---|\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        done = pool.map(partial(job, minutes=options.minutes), tasks)
        for (backend, case, seed), (largest, rms, rotation_deg, path) in zip(
            tasks, done, strict=True
        ):
            write(
                f"| {backend} | {case.world} | {case.belief} | {seed} | {path:.0f} | "
                f"{largest:.3g} | {rms:.3g} | {rotation_deg:.3g} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
