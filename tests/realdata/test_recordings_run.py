"""Whole runs on the recordings, cut short."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.evaluation.evaluate import evaluate
from p2gd_fgo.pipeline import run_sequence


@pytest.mark.realdata
def test_the_static_start_refuses_a_car_in_motion(recordings: Path) -> None:
    config = override(
        Config(),
        {
            "dataset.path": str(recordings / "kitti_0039"),
            "dataset.duration_s": 25.0,
            "initialization.static.max_wait_s": 10.0,
        },
    )
    result = run_sequence(open_sequence(config.dataset), config)
    assert result.status == "failed"
    assert len(result.estimate) == 0
    assert result.reason is not None
    assert "no standstill of 1 s in 10.0 s" in result.reason
    motion = re.search(r"image motion ([\d.]+) px .*\(threshold 0\.5 px", result.reason)
    assert motion is not None and float(motion[1]) > 5.0
    assert re.search(r"gyro deviation [\d.]+ rad/s \(threshold 0\.01\)", result.reason)
    assert "initialization.kind=given" in result.reason


@pytest.mark.realdata
def test_a_real_flight_is_followed_to_centimetres(recordings: Path) -> None:
    config = override(
        Config(),
        {
            "dataset.path": str(recordings / "euroc_mh01"),
            "dataset.duration_s": 8.0,
            "initialization.kind": "given",
        },
    )
    sequence = open_sequence(config.dataset)
    result = run_sequence(sequence, config)
    assert result.status == "done"
    assert sequence.truth is not None
    found = evaluate(
        result.estimate,
        sequence.truth.trajectory,
        frames_total=result.frames_total,
        config=config.evaluation,
    )
    assert found.completeness == 1.0
    assert found.accuracy is not None
    ate = found.accuracy.ate_m["yaw_pos"]
    assert ate is not None and ate.rmse < 0.02


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("config", "recording"),
    [("euroc/MH_01_easy", "euroc_mh01"), ("kitti_raw/2011_09_26_0039", "kitti_0039")],
)
def test_a_shipped_configuration_runs_its_recording(
    recordings: Path, config: str, recording: str
) -> None:
    path = Path(__file__).parents[2] / "configs" / f"{config}.yaml"
    chosen = {"dataset.path": str(recordings / recording), "dataset.duration_s": 2.0}
    made = override(load_config(path), chosen)
    sequence = open_sequence(made.dataset)
    result = run_sequence(sequence, made)
    assert result.status == "done"
    assert len(result.estimate) == len(sequence.image_stamps_ns)
