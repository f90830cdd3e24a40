"""P2GD with broken prior poses against the grid: ``run.py FOLDER``, a table in markdown."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402

from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.config import Config, load_config, override  # noqa: E402
from p2gd_fgo.datasets import open_sequence  # noqa: E402
from p2gd_fgo.evaluation.evaluate import evaluate  # noqa: E402
from p2gd_fgo.evaluation.tracking_quality import (  # noqa: E402
    camera_rotations,
    tracking_quality,
)
from p2gd_fgo.geometry.pose import inverse  # noqa: E402
from p2gd_fgo.pipeline import prior_source, run_sequence  # noqa: E402
from p2gd_fgo.priors import PriorSource  # noqa: E402
from p2gd_fgo.types import NANOSECONDS, PriorPoses, Trajectory  # noqa: E402

HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
WHITE_NOISE = {"priors.source": "noisy_truth", "priors.position_noise": 10.0}
MISSING_S = 5.0


def _not_a_number(ahead: PriorPoses) -> PriorPoses:
    return replace(ahead, T_imu0_imu=np.full_like(ahead.T_imu0_imu, np.nan))


def _twice_as_far(ahead: PriorPoses) -> PriorPoses:
    T = ahead.T_imu0_imu.copy()
    T[:, :3, 3] *= 2.0
    return replace(ahead, T_imu0_imu=T)


def _turned_about(ahead: PriorPoses) -> PriorPoses:
    return replace(ahead, T_imu0_imu=HALF_TURN @ ahead.T_imu0_imu @ HALF_TURN)


def _planner_faces_back(ahead: PriorPoses) -> PriorPoses:
    return replace(ahead, T_imu0_imu=HALF_TURN @ ahead.T_imu0_imu)


def _backwards(ahead: PriorPoses) -> PriorPoses:
    return replace(ahead, T_imu0_imu=inverse(ahead.T_imu0_imu))


def _last_first(ahead: PriorPoses) -> PriorPoses:
    return replace(ahead, T_imu0_imu=ahead.T_imu0_imu[::-1])


def _descending_stamps(ahead: PriorPoses) -> PriorPoses:
    return PriorPoses(ahead.stamps_ns[::-1], ahead.T_imu0_imu[::-1])


BREAKS: dict[str, Callable[[PriorPoses], PriorPoses]] = {
    "NaN": _not_a_number,
    "path scaled by 2": _twice_as_far,
    "path turned by 180°": _turned_about,
    "every pose turned by 180°": _planner_faces_back,
    "time reversed: driven backwards": _backwards,
    "time reversed: last pose first": _last_first,
    "time reversed: stamps too": _descending_stamps,
}


class Broken:
    """Another source's prior poses, spoilt."""

    def __init__(self, source: PriorSource, spoil: Callable[[PriorPoses], PriorPoses]) -> None:
        self.independent = source.independent
        self.image_times = source.image_times
        self.description = f"{source.description}, broken"
        self._source, self._spoil = source, spoil

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        ahead = self._source.poses(stamp_ns, recent)
        return None if ahead is None else self._spoil(ahead)


class Missing:
    """Another source's prior poses, but for a while."""

    def __init__(self, source: PriorSource, begin_ns: int, end_ns: int) -> None:
        self.independent = source.independent
        self.image_times = source.image_times
        self.description = f"{source.description}, with a hole"
        self._source, self._begin_ns, self._end_ns = source, begin_ns, end_ns

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        if self._begin_ns <= stamp_ns < self._end_ns:
            return None
        return self._source.poses(stamp_ns, recent)


@dataclass(frozen=True, slots=True)
class Outcome:
    """ATE yaw_pos in m, total parallax of a feature in degrees, status, events about priors."""

    ate: float
    parallax_deg: float
    status: str
    said: tuple[str, ...]


def job(task: tuple[str, int], config: Config) -> Outcome:
    name, seed = task
    kind = "grid" if name == "grid" else "p2gd"
    changes: dict[str, object] = {"runtime.seed": seed, "distribution.kind": kind}
    if name.startswith("10 m"):
        changes |= WHITE_NOISE
    config = override(config, changes)
    sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
    source = prior_source(sequence, config)
    if name in BREAKS:
        source = Broken(source, BREAKS[name])
    elif name.startswith("missing"):
        first, last = sequence.image_stamps_ns[[0, -1]].tolist()
        begin_ns = (first + last) // 2 - round(0.5 * MISSING_S * NANOSECONDS)
        source = Missing(source, begin_ns, begin_ns + round(MISSING_S * NANOSECONDS))
    result = run_sequence(sequence, config, priors=source)
    assert sequence.truth is not None
    truth = sequence.truth.trajectory
    metrics = evaluate(
        result.estimate,
        truth,
        frames_total=result.frames_total,
        config=config.evaluation,
    )
    assert metrics.accuracy is not None
    ate = metrics.accuracy.ate_m["yaw_pos"]
    assert ate is not None
    rotations = camera_rotations(
        result.tracks.stamps_ns, truth, result.estimate, sequence.calibration.T_imu_cam
    )
    parallax_deg = tracking_quality(result.tracks, rotations).total_parallax_deg
    begin_ns = int(result.estimate.stamps_ns[0])
    said = tuple(
        f"{(event.stamp_ns - begin_ns) / NANOSECONDS:.1f} s {event.kind}, {event.data['images']} "
        f"images: {event.message}"
        for event in result.events
        if event.kind.startswith("priors_")
    )
    return Outcome(ate.rmse, parallax_deg, result.status, said)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="recording with truth")
    parser.add_argument("--config", type=Path, default=Path("configs/kitti_raw.yaml"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--no-check", action="store_true", help="priors.check off")
    options = parser.parse_args()
    settings = {"dataset.path": str(options.folder), "priors.check": not options.no_check}
    config = override(load_config(options.config), settings)
    names = ["grid", "truth", "10 m white noise on every pose", *BREAKS, "missing for 5 s"]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    tasks = [(name, seed) for name in names for seed in seeds]
    with ProcessPoolExecutor(options.jobs) as pool:
        done = dict(zip(tasks, pool.map(partial(job, config=config), tasks), strict=True))
    baseline = float(np.median([done["grid", seed].ate for seed in seeds]))
    write = sys.stdout.write
    head = " | ".join(f"seed {seed}" for seed in seeds)
    write(
        f"| priors | {head} | median | of the grid's | worst of the grid's | total parallax ° | "
        "ended |\n"
    )
    write("|---" * (len(seeds) + 6) + "|\n")
    for name in names:
        runs = [done[name, seed] for seed in seeds]
        ates = [run.ate for run in runs]
        cells = " | ".join(f"{ate:.2f}" for ate in ates)
        parallax = np.median([run.parallax_deg for run in runs])
        ended = sum(run.status == "done" for run in runs)
        write(
            f"| {name} | {cells} | **{np.median(ates):.2f}** | {np.median(ates) / baseline:.2f} | "
            f"{max(ates) / baseline:.2f} | {parallax:.2f} | {ended}/{len(runs)} |\n"
        )
    write(f"\nEvents about priors (seed {seeds[0]}):\n")
    for name in names:
        said = done[name, seeds[0]].said
        write(f"- {name}: {'; '.join(said[:3]) or 'none'}{'; ...' if len(said) > 3 else ''}\n")


if __name__ == "__main__":
    run_refusing(main)
