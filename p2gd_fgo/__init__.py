"""Visual-inertial odometry lab: P2GD feature distribution on a smoother and a filter.

Conventions, everywhere in the package
--------------------------------------
Frames
    ``T_a_b`` is the 4x4 matrix that takes points from b to a; ``p_a`` is a vector in a. The world
    has z up, gravity is (0, 0, -g). The body is the IMU. The camera looks along its z axis, x to
    the right, y down; ``T_imu_cam`` is the only extrinsic inside.
Time
    int64 nanoseconds. ``time_offset_s``: t_imu = t_cam + offset.
Units
    SI and radians; any other unit is in the name (``_deg``, ``_px``, ``_ns``, ``_ms``).
Rotations
    3x3 matrices inside; quaternions only in files (TUM: w last, EuRoC csv: w first).
Errors of states
    (δθ, δp, δv, δb_g, δb_a), R = R̂ Exp(δθ), the rest additive, δp and δv in the world.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from p2gd_fgo.config import Config, load_config, override
    from p2gd_fgo.datasets import Calibration, ImuNoise, Sequence, open_sequence
    from p2gd_fgo.evaluation.evaluate import evaluate
    from p2gd_fgo.experiment import Experiment, run_experiment
    from p2gd_fgo.geometry.camera import EquidistantCamera, RadTanCamera
    from p2gd_fgo.odometry import Odometry
    from p2gd_fgo.pipeline import Observer, run_sequence
    from p2gd_fgo.recorder import RunResult
    from p2gd_fgo.trajectory_files import read_trajectory, write_tum
    from p2gd_fgo.types import Estimate, ImuBatch, NavState, PriorPoses, Trajectory, Waiting

__version__ = "0.1.0"

# Loaded at first use: reading a configuration must not load numpy, so that the thread counts can be
# set before.
_HOMES = {
    "Calibration": "datasets",
    "Config": "config",
    "EquidistantCamera": "geometry.camera",
    "Estimate": "types",
    "Experiment": "experiment",
    "ImuBatch": "types",
    "ImuNoise": "datasets",
    "NavState": "types",
    "Observer": "pipeline",
    "Odometry": "odometry",
    "PriorPoses": "types",
    "RadTanCamera": "geometry.camera",
    "RunResult": "recorder",
    "Sequence": "datasets",
    "Trajectory": "types",
    "Waiting": "types",
    "evaluate": "evaluation.evaluate",
    "load_config": "config",
    "open_sequence": "datasets",
    "override": "config",
    "read_trajectory": "trajectory_files",
    "run_experiment": "experiment",
    "run_sequence": "pipeline",
    "write_tum": "trajectory_files",
}

__all__ = [
    "Calibration",
    "Config",
    "EquidistantCamera",
    "Estimate",
    "Experiment",
    "ImuBatch",
    "ImuNoise",
    "NavState",
    "Observer",
    "Odometry",
    "PriorPoses",
    "RadTanCamera",
    "RunResult",
    "Sequence",
    "Trajectory",
    "Waiting",
    "evaluate",
    "load_config",
    "open_sequence",
    "override",
    "read_trajectory",
    "run_experiment",
    "run_sequence",
    "write_tum",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
