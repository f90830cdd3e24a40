"""Is the rendered world fast enough, and its IMU exact? Prints two tables."""

from __future__ import annotations

import argparse
import resource
import sys
import time

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402

from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.geometry import so3  # noqa: E402
from p2gd_fgo.imu import integrate  # noqa: E402
from p2gd_fgo.simulation.imu_errors import synthesize  # noqa: E402
from p2gd_fgo.simulation.presets import PRESETS, find_preset, load_scenario  # noqa: E402
from p2gd_fgo.simulation.production import Studio, plan  # noqa: E402
from p2gd_fgo.types import NavState  # noqa: E402

NAMES = sorted(path.stem for path in PRESETS.glob("*.yaml"))
DURATION_S = 60.0
GRAVITY = 9.81
QUIET: dict[str, object] = {
    f"imu.{name}": 0.0
    for name in (
        "gyro_noise_density", "gyro_random_walk", "accel_noise_density", "accel_random_walk",
        "gyro_bias_sigma", "accel_bias_sigma",
    )
}  # fmt: skip


def frames_per_second(name: str, seed: int, frames: int) -> tuple[float, str]:
    """Of process CPU, mask and sensor included, over images spread along the way."""
    scenario = load_scenario(find_preset(name), {"duration_s": DURATION_S, "seed": seed})
    studio = Studio(plan(scenario))
    studio.expose(studio.view(0), 0)  # compiles
    chosen = np.linspace(1, len(studio.plan.image_stamps_ns) - 1, frames).astype(int).tolist()
    begin = time.process_time()
    for k in chosen:
        view = studio.view(k)
        studio.expose(view, k)
        view.mask()
    rate = frames / (time.process_time() - begin)
    return rate, f"{scenario.camera.width}x{scenario.camera.height}"


def integration_error(name: str, seed: int) -> tuple[float, float]:
    """Metres and degrees at the end of the noiseless IMU's integral from the truth's start."""
    settings = QUIET | {"duration_s": DURATION_S, "seed": seed}
    prepared = plan(load_scenario(find_preset(name), settings))
    stamps, trajectory = prepared.imu_stamps_ns, prepared.drive.trajectory
    truth = trajectory.sample(stamps)
    start = NavState(
        int(stamps[0]), truth.T_world_imu[0], truth.velocity[0], np.zeros(3), np.zeros(3)
    )
    imu = synthesize(trajectory, stamps, prepared.scenario.imu, seed).batch
    end, wanted = integrate(start, imu, GRAVITY).T_world_imu, truth.T_world_imu[-1]
    turn = so3.log(end[:3, :3].T @ wanted[:3, :3])
    return float(np.linalg.norm(end[:3, 3] - wanted[:3, 3])), float(
        np.degrees(np.linalg.norm(turn))
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--frames", type=int, default=20)
    options = parser.parse_args()
    write = sys.stdout.write
    write("| preset | image | frames/s | peak MB | integral of 60 s, worst m | worst ° |\n")
    write("|---|---|---|---|---|---|\n")
    for name in NAMES:
        rate, size = frames_per_second(name, 3, options.frames)
        errors = np.array([integration_error(name, seed) for seed in range(options.seeds)])
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        worst = errors.max(axis=0)
        write(
            f"| {name} | {size} | {rate:.1f} | {peak_mb:.0f} | {worst[0]:.1e} | {worst[1]:.1e} |\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
