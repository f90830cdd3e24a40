"""Does `auto` start, how soon, and how well? Prints a table of starts and one of counts.

Every recording is cut open at five times, standing and moving, and run for as long as the start may
take and ten seconds more.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import norm

from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import load_config, override
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.errors import ConfigError, EstimatorError, InitializationError
from p2gd_fgo.geometry.pose import covered, interpolate
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.types import NANOSECONDS, Estimate, FloatArray, NavState, Trajectory

SETTLE_S = 10.0  # after the start
SCALE_S = 3.0  # of the online path that the scale is measured on
LEAST_WAY_M = 1.0  # a shorter one has no scale


@dataclass(frozen=True)
class Outcome:
    """Of one start: NaN where there is no such number."""

    after_s: float
    speed: float
    speed_error: float
    tilt_deg: float
    nees: float
    scale: float  # of the path that the estimate then holds
    online_scale: float  # of the path as it was estimated image by image
    scale_sigma: float  # of the speed, relative, as the covariance then says
    note: str


def run(path: Path, start_s: float, settings: dict[str, object]) -> Outcome:
    base = {"initialization.kind": "auto", "dataset.start_s": start_s}
    config = override(load_config(), {**base, "dataset.path": str(path), **settings})
    sequence = open_sequence(config.dataset)
    given = config.initialization.kind == "given"  # for comparison
    odometry = Odometry(sequence.calibration, config, truth=sequence.truth if given else None)
    stamps = sequence.image_stamps_ns.tolist()
    estimates: list[Estimate] = []
    note, failed = "", ""
    odometry.add_imu(sequence.imu)
    for index, stamp in enumerate(stamps):
        try:
            answer = odometry.add_image(stamp, sequence.image(index))
        except (InitializationError, EstimatorError) as error:
            failed = f"{type(error).__name__}: {error}"
            break
        if isinstance(answer, Estimate):
            if not estimates:
                first, note = answer, odometry.start_note or ""
            estimates.append(answer)
            if answer.state.stamp_ns - first.state.stamp_ns >= SETTLE_S * NANOSECONDS:
                break
    if not estimates:
        nan = float("nan")
        return Outcome(
            nan, nan, nan, nan, nan, nan, nan, nan, failed or "no start before the recording's end"
        )
    state = first.state
    after_s = (state.stamp_ns - odometry.offset_ns - stamps[0]) / NANOSECONDS
    speed, speed_error, tilt_deg, nees = start_error(sequence, first)
    online = np.nan if failed else online_scale(sequence, estimates)
    scale = np.nan if failed else path_scale(sequence, estimates[-1].window)
    if np.isnan(scale):  # it stands, and where it came from has left the window
        scale = online
    sigma = speed_sigma(estimates[-1])
    return Outcome(
        after_s, speed, speed_error, tilt_deg, nees, scale, online, sigma, failed or note
    )


def speed_sigma(estimate: Estimate) -> float:
    """Standard deviation of the speed that an estimate claims, as a share of it."""
    v = estimate.state.velocity
    along = v / np.linalg.norm(v)
    return float(np.sqrt(along @ estimate.covariance[6:9, 6:9] @ along) / np.linalg.norm(v))


def truth_at(sequence: Sequence, stamps: list[int]) -> FloatArray:
    truth = sequence.truth
    assert truth is not None
    return interpolate(truth.trajectory, np.array(stamps))


def start_error(sequence: Sequence, first: Estimate) -> tuple[float, float, float, float]:
    """True speed, error of the speed, angle between the verticals, NEES of v and tilt (5)."""
    state: NavState = first.state
    half = NANOSECONDS // 20
    around = [state.stamp_ns - half, state.stamp_ns, state.stamp_ns + half]
    truth = sequence.truth
    assert truth is not None
    if not covered(truth.trajectory, np.array(around)).all():
        return np.nan, np.nan, np.nan, np.nan
    T = truth_at(sequence, around)
    velocity = (T[2, :3, 3] - T[0, :3, 3]) / (2 * half / NANOSECONDS)
    if truth.velocity is not None:
        at = int(np.argmin(np.abs(truth.trajectory.stamps_ns - state.stamp_ns)))
        velocity = truth.velocity[at]
    R, R_true = state.T_world_imu[:3, :3], T[1, :3, :3]
    axis = np.cross(R[2], R_true[2])  # Exp(δ) R_trueᵀ e = Rᵀ e in the body's frame
    tilt = float(np.degrees(np.arcsin(min(float(np.linalg.norm(axis)), 1.0))))
    # In the frame of the body everything is comparable whatever the heading.
    error = np.concatenate([R_true.T @ velocity - R.T @ state.velocity, axis])
    P = first.covariance
    J = np.zeros((6, 15))  # δ(Rᵀ v) = Rᵀ δv + hat(Rᵀ v) δθ; δ(Rᵀ e) across the vertical
    v = R.T @ state.velocity
    J[:3, 0:3] = [[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]
    J[:3, 6:9] = R.T
    across = np.linalg.svd(R[2][None])[2][1:]
    J[3:, 0:3] = np.eye(3)
    pick = np.zeros((5, 6))
    pick[:3, :3], pick[3:, 3:] = np.eye(3), across
    e, C = pick @ error, pick @ J @ P @ J.T @ pick.T
    speed = float(np.linalg.norm(velocity))
    nees = float(e @ np.linalg.solve(C, e))
    return speed, float(np.linalg.norm(state.velocity)) - speed, tilt, nees


def path_scale(sequence: Sequence, path: Trajectory) -> float:
    """Estimated over true spread of the positions; NaN if the path leads nowhere."""
    truth = sequence.truth
    assert truth is not None
    known = covered(truth.trajectory, path.stamps_ns)
    if not known.any():
        return float("nan")
    true = truth_at(sequence, path.stamps_ns[known].tolist())[:, :3, 3]
    ours = path.T_world_imu[known, :3, 3]
    if np.linalg.norm(np.ptp(true, axis=0)) < LEAST_WAY_M:
        return float("nan")
    spread = np.linalg.norm(true - true.mean(0))
    return float(np.linalg.norm(ours - ours.mean(0)) / spread)


def online_scale(sequence: Sequence, estimates: list[Estimate]) -> float:
    """Of each image's newest position: corrections of earlier errors are part of this path."""
    stamps = np.array([e.state.stamp_ns for e in estimates])
    poses = np.array([e.state.T_world_imu for e in estimates])
    for length_s in (SCALE_S, 2 * SCALE_S, SETTLE_S):
        late = stamps >= stamps[-1] - length_s * NANOSECONDS
        scale = path_scale(sequence, Trajectory(stamps[late], poses[late]))
        if np.isfinite(scale):
            return scale
    return float("nan")


def read_starts(text: str) -> list[float]:
    """Seconds of ``--starts 0,3.5``."""
    try:
        starts = [float(part) for part in text.split(",")]
    except ValueError:
        starts = [float("nan")]
    if not all(0.0 <= start < float("inf") for start in starts):
        raise ConfigError(
            f"--starts {text}: give seconds from the recording's beginning, not negative and "
            "separated by commas, such as 0,3.5,9"
        )
    return starts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--starts", default="0,2.5,5,7.5,10", help="seconds, comma-separated")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    options = parser.parse_args()
    settings = read_settings(options.set)
    starts = read_starts(options.starts)
    write = sys.stdout.write
    write(
        "| recording | from s | start after s | speed m/s | error m/s | tilt ° | NEES (5) "
        "| scale after 10 s | online | claimed ± | how |\n" + "|---" * 11 + "|\n"
    )
    outcomes: list[tuple[Path, Outcome]] = []
    for path in options.recordings:
        for start_s in starts:
            o = run(path, start_s, settings)
            outcomes.append((path, o))
            write(
                f"| {path.name} | {start_s:g} | {o.after_s:.1f} | {o.speed:.2f} | "
                f"{o.speed_error:+.2f} | {o.tilt_deg:.2f} | {o.nees:.1f} | {o.scale:.3f} | "
                f"{o.online_scale:.3f} | {o.scale_sigma:.3f} | {o.note} |\n"
            )
            sys.stdout.flush()
    write(summary([(path.name, o) for path, o in outcomes]))


def summary(outcomes: list[tuple[str, Outcome]]) -> str:
    """Counts in markdown, a row for each preset: recordings are `preset-…` or `preset_…`."""
    lines = [
        "",
        "| preset | starts | within 5 s | scale within 10 % | online path's "
        "| so many by the claimed errors | largest tilt error ° | beyond 3° |",
        "|---" * 8 + "|",
    ]
    presets = [re.sub(r"[-_](\d+|[0-9a-f]{12})$", "", name) for name, _ in outcomes]
    for preset in [*dict.fromkeys(presets), "all"]:
        own = [o for (_, o), p in zip(outcomes, presets, strict=True) if preset in (p, "all")]
        soon = sum(o.after_s <= 5.0 for o in own)
        # What stood for ten seconds has no scale; what never started has none that is right.
        known = [o for o in own if np.isfinite(o.scale) or not np.isfinite(o.after_s)]
        right = sum(abs(o.scale - 1.0) <= 0.1 for o in known)
        online = sum(abs(o.online_scale - 1.0) <= 0.1 for o in known)
        sigmas = np.array([o.scale_sigma for o in known])
        expected = np.nansum(2.0 * norm.cdf(0.1 / sigmas) - 1.0)
        tilts = np.array([o.tilt_deg for o in own])
        lines.append(
            f"| {preset} | {len(own)} | {soon} ({soon / len(own):.0%}) | {right} of {len(known)} "
            f"| {online} | {expected:.1f} | {np.nanmax(tilts, initial=0.0):.2f} "
            f"| {np.sum(tilts > 3.0)} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    run_refusing(main)
