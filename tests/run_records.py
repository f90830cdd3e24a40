"""Runs that never ran: records with a known effect, and run directories with known errors."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from p2gd_fgo.config import Config, dump_yaml, override
from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.report.summaries import summarize_timing
from p2gd_fgo.run_directory import RunDirectory
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.types import Event, TrackRecord, Trajectory

STAGES = {"track": 4.0, "extract": 1.5, "propagate": 0.5, "distribute": 0.8, "update": 7.0}
LENGTHS_M = (1.0, 10.0, 50.0, 100.0)


def metrics(ate_m: float, are_deg: float, rte: float, completeness: float = 1.0) -> dict[str, Any]:
    """As ``metrics.json`` has them, every alignment a factor on the main one's."""
    factors = {"yaw_pos": 1.0, "se3": 0.9, "sim3": 0.8, "origin": 1.5}

    def by_alignment(value: float) -> dict[str, Any]:
        return {
            kind: {"rmse": f * value, "mean": f * value, "median": f * value, "max": 2 * f * value}
            for kind, f in factors.items()
        }

    return {
        "alignment": "yaw_pos", "frames": round(600 * completeness), "frames_total": 600,
        "completeness": completeness, "duration_s": 60.0, "path_length_m": 400.0,
        "ate_m": by_alignment(ate_m), "are_deg": by_alignment(are_deg),
        "rte": [
            {"length_m": n, "percent": rte * (10 / n) ** 0.3, "rmse_m": rte * n / 100,
             "rre_deg": 0.1 * (n / 10) ** 0.4, "pairs": 300}
            for n in LENGTHS_M
        ],
    }  # fmt: skip


def tracking(length: float, parallax: float) -> dict[str, Any]:
    """As the record of a run has them."""
    return {
        "rotations": "truth", "frames": 600, "tracks": 9000, "mean_length": length,
        "length_shares": {"1": 0.35, "5": 0.046, "10": 0.016, "15": 0.009, "20": 0.09},
        "total_parallax_deg": parallax, "two_view_parallax_deg": parallax / length,
        "total_parallax_per_frame_deg": 15 * parallax, "features_per_frame": 20 * length,
        "tracks_3_per_frame": 9.0, "tracks_10_per_frame": 4.0,
    }  # fmt: skip


def records(
    groups: Iterable[str] = ("kaist_like", "robot_like"),
    routes: int = 12,
    seeds: int = 3,
    backends: Iterable[str] = ("smoother", "msckf"),
    effects: dict[str, float] | None = None,
    noise: float = 0.15,
) -> list[RunRecord]:
    """A study's records.

    Parameters
    ----------
    effects
        Factor on the errors by distribution; by default the grid 1 and P2GD 0.75.
    noise
        Standard deviation of the log of a run's errors; routes differ by three times as much.
    """
    rng = np.random.default_rng(7)
    factors = effects or {"grid": 1.0, "p2gd": 0.75}
    out = []
    for group in groups:
        for number in range(200, 200 + routes):
            hard = float(np.exp(3 * noise * rng.normal()))
            for seed in range(seeds):
                for backend in backends:
                    for distribution, factor in factors.items():
                        ate, are, rte = factor * hard * np.exp(noise * rng.normal(size=3))
                        out.append(
                            record(
                                group, f"{group}-{number}", seed, backend, distribution,
                                metrics(0.8 * ate, 0.5 * are, 1.2 * rte),
                            )
                        )  # fmt: skip
    return out


def record(
    group: str,
    route: str,
    seed: int,
    backend: str,
    distribution: str,
    found: dict[str, Any],
    **changes: Any,
) -> RunRecord:
    """One record; ``changes`` are fields of it."""
    rng = np.random.default_rng(zlib.crc32(f"{route}/{seed}/{backend}/{distribution}".encode()))
    length = (5.0 if distribution == "grid" else 5.6) + 0.2 * rng.normal()
    pace = 1.0 + 0.03 * rng.normal()
    times = {stage: pace * ms for stage, ms in STAGES.items()}
    times["frame"] = sum(times.values()) + 0.4
    fields: dict[str, Any] = {
        "key": f"{group}/{route}/{seed}/{backend}/{distribution}", "study": "made_up",
        "axes": {"sequence": route, "backend": backend, "distribution": distribution, "seed": seed},
        "sequence": route, "route": route, "group": group, "seed": seed, "status": "done",
        "metrics": found, "tracking": tracking(length, 2.4 * length),
        "cpu_ms": {
            stage: {"median_cpu_ms": ms, "p95_cpu_ms": 1.4 * ms, "frames": 600}
            for stage, ms in times.items()
        },
        "events": {"started": 1}, "seconds": 9.0, "code": "c0de" * 10,
        "versions": {"p2gd_fgo": "0.1.0", "gtsam": "4.3.0"},
    }  # fmt: skip
    return RunRecord(**(fields | changes))


def write_records(path: Path, made: Iterable[RunRecord]) -> Path:
    """As a study writes them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{each.to_json()}\n" for each in made))
    return path


def drive(seconds: float = 40.0) -> Trajectory:
    """Poses at 10 Hz round a circle of 60 m radius at 6 m/s."""
    t = np.arange(0.0, seconds, 0.1)
    T = np.tile(np.eye(4), (len(t), 1, 1))
    T[:, 0, 3], T[:, 1, 3] = 60 * np.sin(t / 10), 60 - 60 * np.cos(t / 10)
    c, s = np.cos(t / 10), np.sin(t / 10)
    T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = c, -s, s, c
    return Trajectory((t * 1e9).astype(np.int64), T)


def write_run(
    path: Path,
    *,
    recording: str = "/data/kitti_0039",
    noise_m: float = 0.05,
    seed: int = 0,
    failed: str | None = None,
    truth: bool = True,
    **settings: object,
) -> Path:
    """A run directory; ``settings`` are fields of its configuration, as ``backend__kind``."""
    chosen = {key.replace("__", "."): value for key, value in settings.items()}
    config = override(Config(), {"dataset.path": recording, "runtime.seed": seed} | chosen)
    rng = np.random.default_rng(seed)
    reference = drive()
    T = reference.T_world_imu.copy()
    T[:, :3, 3] += noise_m * np.cumsum(rng.normal(size=(len(T), 3)), axis=0)
    kept = len(T) // 3 if failed else len(T)
    estimate = Trajectory(reference.stamps_ns[:kept], T[:kept])
    found = evaluate(
        estimate, reference if truth else None, frames_total=len(T), config=EvaluationConfig()
    )
    times = [{s: (ms, ms) for s, ms in {"frame": 14.2, **STAGES}.items()}] * kept
    counts = np.full(kept, 30)
    ids = np.concatenate([np.arange(30) + 10 * k for k in range(kept)])
    tracks = TrackRecord(
        estimate.stamps_ns, counts, counts, ids, rng.normal(size=(len(ids), 2)).astype(np.float64)
    )
    directory = RunDirectory(path, overwrite=False)
    directory.write_config(dump_yaml(config))
    directory.write_trajectory("estimate.tum", estimate)
    if truth:
        directory.write_trajectory("truth.tum", reference)
    directory.write_tracks(tracks)
    directory.write_timing(estimate.stamps_ns, times)
    directory.write_events([Event(0, "started", "started static, after 1.0 s")])
    directory.write_metrics(
        found.to_json()
        | {
            "tracking": tracking(3.0, 6.0),
            "cpu_ms": {stage: asdict(time) for stage, time in summarize_timing(times).items()},
            "chosen": {"sequence": f"{Path(recording).name} · {len(T)} images in 40.0 s, 10.0 Hz"},
            "status": "failed" if failed else "done",
            "seed": seed,
        }
    )
    directory.finish("failed" if failed else "done", failed)
    return path
