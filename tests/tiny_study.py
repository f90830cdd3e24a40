"""A study that runs in seconds: one rendered route in small images, two seeds, grid and P2GD."""

from __future__ import annotations

from pathlib import Path

SCENARIO = """
duration_s: 3
world: {kind: campus, block_m: [20, 24], detail: 0.25}
vehicle: {kind: robot, speed: [0.8, 1.5], standstill_s: 0, imu_height_m: 0.6}
camera: {width: 128, height: 96, focal: [80, 80], center: [64, 48], position: [0.3, 0, 0]}
imu: {rate_hz: 100}
"""

STUDY = """
name: tiny
question: does it run
base:
  settings: {initialization.kind: given, frontend.min_distance_px: 5, frontend.max_features: 80}
sequences:
  - {simulate: tiny.yaml, routes: [7]}
axes:
  backend: [msckf]
  distribution: [grid, p2gd]
  seed: [0, 1]
pairing: {axis: distribution, baseline: grid}
timeout_s: 300
profiles:
  one: {axes: {seed: [0]}}
"""


def write_study(folder: Path, text: str = STUDY) -> Path:
    """Write scenario and study into a folder; the path of the study."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "tiny.yaml").write_text(SCENARIO)
    (folder / "study.yaml").write_text(text)
    return folder / "study.yaml"
