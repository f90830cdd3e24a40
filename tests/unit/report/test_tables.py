"""Tables say what must be said, and fit an 80-column terminal."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console, RenderableType

from p2gd_fgo.config.models import EvaluationConfig
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.evaluation.metrics import Metrics
from p2gd_fgo.evaluation.tracking_quality import TrackingQuality
from p2gd_fgo.report.summaries import summarize_events, summarize_timing
from p2gd_fgo.report.tables import evaluate_table, run_table
from p2gd_fgo.types import Event, Trajectory

HEADER = [("sequence", "kitti_0039"), ("alignment", "yaw_pos")]


def drive(count: int, noise: float) -> Trajectory:
    s = np.arange(count) * 0.1
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 3], T[:, 1, 3] = 50 * np.sin(s / 10), 50 * np.cos(s / 10)
    T[:, :3, 3] += noise * np.random.default_rng(0).normal(size=(count, 3))
    return Trajectory((s * 1e9).astype(np.int64), T)


def metrics(count: int = 400, total: int | None = 400) -> Metrics:
    return evaluate(
        drive(count, 1.0), drive(400, 0.0), frames_total=total, config=EvaluationConfig()
    )


def tracking(tracks: int = 12345) -> TrackingQuality:
    return TrackingQuality(
        rotations="truth",
        frames=398,
        tracks=tracks,
        mean_length=3.9811,
        length_shares={1: 0.5188, 5: 0.043, 10: 0.011, 15: 0.008, 20: 0.0771},
        total_parallax_deg=3.2491,
        two_view_parallax_deg=0.81632,
        total_parallax_per_frame_deg=118.9,
        features_per_frame=145.71,
        tracks_3_per_frame=12.3,
        tracks_10_per_frame=4.5,
        quota_asked_per_frame=180.0,
        quota_served_per_frame=178.3,
        frames_without_rotation=12,
        pairs_left_out=3456,
    )


def text(table: RenderableType, width: int = 80) -> str:
    file = io.StringIO()
    Console(file=file, width=width).print(table)
    return file.getvalue()


@pytest.mark.parametrize("width", [80, 120])
def test_run_table_holds_every_number_and_cuts_none(width: int) -> None:
    result = metrics()
    rows = [{"track": (9.0, 9.0), "frame": (20.0, 21.0)}, {"frame": (22.0, 23.0)}]
    events = [Event(1, "image_unreadable", "image 7 is truncated " * 8)] * 2
    shown = text(
        run_table(HEADER, result, summarize_timing(rows), ("done", None), summarize_events(events)),
        width,
    )
    accuracy = result.accuracy
    assert accuracy is not None
    for ate in accuracy.ate_m.values():
        assert ate is not None and f"{ate.rmse:.3f}" in shown
    for entry in accuracy.rte:
        assert f"{entry.rre_deg:.3f}" in shown and f" {entry.pairs}" in shown
    for word in ("kitti_0039", "yaw_pos ◂", "400 of 400", "21.00", "2 ×", f"{accuracy.scale:.4f}"):
        assert word in shown
    assert "…" not in shown and "FAILED" not in shown and "PARTIAL" not in shown
    assert max(map(len, shown.splitlines())) <= width


def test_failed_and_partial_runs_are_loud() -> None:
    shown = text(run_table(HEADER, metrics(40), {}, ("failed", "no features"), []))
    assert "THE RUN FAILED: no features" in shown
    assert "PARTIAL: only 40 of 400 images" in shown
    assert "10.0 %" in shown
    assert "NOT FINISHED" in text(run_table(HEADER, None, {}, ("running", None), []))


def test_without_truth_there_are_no_errors() -> None:
    bare = evaluate(drive(400, 1.0), None, frames_total=400, config=EvaluationConfig())
    shown = text(run_table(HEADER, bare, {}, ("done", None), []))
    assert "NO TRUTH" in shown and "ATE" not in shown and "400 of 400" in shown


def test_evaluate_table_without_frame_count() -> None:
    shown = text(evaluate_table(metrics(total=None)))
    assert "400 estimates" in shown and "RTE %" in shown


def test_evaluate_table_says_what_is_missing() -> None:
    assert "PARTIAL: only 400 of 1000 images" in text(evaluate_table(metrics(total=1000)))
    shown = text(evaluate_table(metrics(total=100)))
    assert "COMPLETENESS UNKNOWN: 400 poses" in shown and "400 estimates" in shown


def test_undetermined_alignment_shows_a_dash() -> None:
    stamps = np.arange(20, dtype=np.int64) * 100_000_000
    still = Trajectory(stamps, np.tile(np.eye(4), (20, 1, 1)))
    result = evaluate(still, still, frames_total=20, config=EvaluationConfig())
    shown = text(evaluate_table(result))
    assert "–" in shown and "not determined" in shown and "nan" not in shown


@pytest.mark.parametrize("width", [80, 120])
def test_tracking_has_a_section_of_its_own(width: int) -> None:
    shown = text(run_table(HEADER, metrics(), {}, ("done", None), [], tracking()), width)
    for word in (
        *("12345 tracks", "rotations from truth", "3.98", "0.8163", "3.249", "51.9", "145.7"),
        *("178.3", "12 of 398 images", "3456 pairs"),
    ):
        assert word in shown
    assert "…" not in shown and max(map(len, shown.splitlines())) <= width
    assert "tracking" not in text(run_table(HEADER, metrics(), {}, ("done", None), []))
    assert "tracking" not in text(run_table(HEADER, None, {}, ("failed", "x"), [], tracking(0)))


def test_timing_is_the_median_of_frames_that_had_the_stage() -> None:
    rows = [{"smoother": (5.0, 6.0), "frame": (1.0, 1.0)}, {"frame": (3.0, 3.0)}]
    summary = summarize_timing(rows)
    assert list(summary) == ["frame", "smoother"]
    assert (summary["frame"].median_cpu_ms, summary["frame"].frames) == (2.0, 2)
    assert (summary["smoother"].median_cpu_ms, summary["smoother"].frames) == (5.0, 1)
    assert summarize_timing([]) == {}
