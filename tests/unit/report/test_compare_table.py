"""The comparison's table holds all rows and numbers, in 120 columns and in 80."""

from __future__ import annotations

import io
import math
from typing import get_args

import numpy as np
import pytest
from rich.console import Console

from p2gd_fgo.config import BackendConfig, DistributionConfig
from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.evaluation.metrics import Metrics
from p2gd_fgo.evaluation.tracking_quality import TrackingQuality
from p2gd_fgo.report.compare_table import ComparedRun, compare_table
from p2gd_fgo.types import Trajectory

BACKENDS = get_args(BackendConfig.model_fields["kind"].annotation)
DISTRIBUTIONS = get_args(DistributionConfig.model_fields["kind"].annotation)
HEADER = [("sequence", "kitti_0039"), ("seed", "0")]


def drive(noise: float) -> Trajectory:
    s = np.arange(400) * 0.1
    T = np.tile(np.eye(4), (400, 1, 1))
    T[:, 0, 3], T[:, 1, 3] = 60 * np.sin(s / 10), 60 * np.cos(s / 10)
    T[:, :3, 3] += noise * np.random.default_rng(0).normal(size=(400, 3))
    return Trajectory((s * 1e9).astype(np.int64), T)


def metrics(noise: float, *, truth: bool = True) -> Metrics:
    reference = drive(0.0) if truth else None
    return evaluate(drive(noise), reference, frames_total=500, config=EvaluationConfig())


def quality(single: float) -> TrackingQuality:
    shares = {1: single, 5: 0.1, 10: 0.1, 15: 0.1, 20: 0.1}
    return TrackingQuality(
        "truth", 398, 12345, 12.34, shares, 98.7, 1.234, 118.9, 145.7, 12.3, 4.5, 180.0, 178.3,
        0, 0,
    )  # fmt: skip


def run(backend: str, distribution: str, noise: float = 0.02, **changes: object) -> ComparedRun:
    fields: dict[str, object] = {
        "metrics": metrics(noise), "tracking": quality(0.518), "frame_ms": 123.4,
        "status": "done", "reason": None,
    }  # fmt: skip
    return ComparedRun(backend, distribution, **(fields | changes))  # type: ignore[arg-type]


def shown(runs: list[ComparedRun], width: int = 120) -> str:
    file = io.StringIO()
    Console(file=file, width=width).print(compare_table(HEADER, runs, width))
    text = file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text and "nan" not in text
    return text


def rows(text: str, runs: list[ComparedRun]) -> list[str]:
    starts = [(r.backend, r.distribution) for r in runs]
    return [line for line in text.splitlines() if tuple(line.split()[:2]) in starts]


@pytest.mark.parametrize("noise", [1e-4, 0.02, 3.0, 4000.0])
def test_one_row_for_each_run_in_120_columns(noise: float) -> None:
    runs = [run(b, d, noise) for b in BACKENDS for d in DISTRIBUTIONS]
    text = shown(runs)
    assert len(rows(text, runs)) == len(runs)
    for row in rows(text, runs):
        cells = row.split()
        assert len(cells) == 16
        assert cells[8:] == ["12.34", "1.23", "98.7", "51.8", "145.7", "123.4", "80.0", "done"]


def test_numbers_stand_in_their_columns() -> None:
    runs = [run("smoother", "grid", 0.02), run("smoother", "p2gd", 3.0)]
    for row, each in zip(rows(shown(runs), runs), runs, strict=True):
        assert each.metrics and each.metrics.accuracy
        accuracy, cells = each.metrics.accuracy, [float(c) for c in row.split()[2:8]]
        rte = {entry.length_m: entry.percent for entry in accuracy.rte}
        ate, origin, are = (
            accuracy.ate_m["yaw_pos"], accuracy.ate_m["origin"], accuracy.are_deg["yaw_pos"],
        )  # fmt: skip
        assert ate and origin and are and each.metrics.ate_percent
        wanted = [ate.rmse, each.metrics.ate_percent, origin.rmse, are.rmse, rte[10.0], rte[200.0]]
        assert cells == pytest.approx(wanted, rel=0.006, abs=6e-4)


def test_the_head_says_what_the_numbers_are() -> None:
    text = shown([run("smoother", "grid"), run("smoother", "p2gd")])
    for word in (
        "kitti_0039",
        "yaw_pos (position + yaw)",
        "2, one per row",
        "rotations from truth",
    ):
        assert word in text
    assert [f"{n} m" in text for n in (2, 10, 50, 100, 200)] == [False, True, False, False, True]


def test_failed_and_refused_runs_have_their_row() -> None:
    reason = "at 1317381600000000 ns: the covariance is not finite " * 3
    runs = [
        run("smoother", "grid"),
        run("smoother", "p2gd", status="failed", reason=reason),
        ComparedRun("smoother", "anms", None, None, math.nan, "refused", "no truth"),
    ]
    text = shown(runs)
    assert [row.split()[-1] for row in rows(text, runs)] == ["done", "FAILED", "REFUSED"]
    assert "smoother-p2gd failed: at 1317381600000000 ns" in text
    assert "smoother-anms refused: no truth" in text


def test_without_truth_the_errors_are_dashes() -> None:
    runs = [run("smoother", "grid", metrics=metrics(0.1, truth=False))]
    (row,) = rows(shown(runs), runs)
    assert row.split()[2:6] == ["–"] * 4 and row.split()[-1] == "done"
    assert "no length fits" in shown(runs)


def test_a_narrow_terminal_gets_two_tables() -> None:
    runs = [run(b, d) for b in BACKENDS for d in DISTRIBUTIONS]
    assert len(rows(shown(runs, 80), runs)) == 2 * len(runs)
