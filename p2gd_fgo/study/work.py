"""Doing one run, in a process of its own: recording in, record and a small run directory out."""

from __future__ import annotations

import json
import shutil
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from p2gd_fgo.atomic_files import write_text
from p2gd_fgo.config import Config, override
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.datasets.base import stamps_on_imu_clock
from p2gd_fgo.errors import DataError, P2gdError
from p2gd_fgo.evaluation.run_segments import MASKS, moving_objects, run_segments
from p2gd_fgo.experiment import run_experiment
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.run_directory import CONFIG, EVENTS, FRAMES, METRICS, STATUS
from p2gd_fgo.run_record import RecordStatus, RunRecord
from p2gd_fgo.study.data import provide
from p2gd_fgo.study.keys import code_hash, versions
from p2gd_fgo.study.runs import Run
from p2gd_fgo.trajectory_files import read_tum, write_tum
from p2gd_fgo.types import Estimate, Image, Trajectory, Waiting

Keep = Literal["small", "all", "none"]
"""What stays of a run's directory: the files in ``SMALL``, everything, or nothing."""

SMALL = (STATUS, CONFIG, METRICS, EVENTS, FRAMES, "estimate.tum", "truth.tum")
CRASH = "crash.txt"
"""Where the traceback of a run is that raised what it must not."""

_PATHS = ("results",)  # entries of ``chosen`` that name a place on this machine
_APART = ("tracking", "cpu_ms")  # parts of metrics.json with a field of their own
_BETWEEN_S = 0.5
_SEGMENT_DIGITS = 5

Progress = Callable[[int, int], None]


def execute(run: Run, folder: Path, keep: Keep, progress: Progress | None = None) -> RunRecord:
    """Do one run and leave in ``folder`` what is kept of it.

    Whatever goes wrong is in the record: nothing is raised.

    Parameters
    ----------
    folder
        Empty or missing; with ``keep`` none it is gone afterwards.
    progress
        Called with images done and images in all, twice a second at most.
    """
    began = time.perf_counter()
    try:
        recording = provide(run.source)
        config = override(run.config, {"dataset.path": str(recording)})
        began = time.perf_counter()
        observer = _Reporter(progress) if progress else None
        run_experiment(config, out=folder, overwrite=True, observer=observer)
        metrics = json.loads((folder / METRICS).read_text(encoding="utf-8"))
    except Exception as error:  # the record says so, and the study goes on
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        (folder / CRASH).write_text(traceback.format_exc(), encoding="utf-8")
        told = str(error) if isinstance(error, P2gdError) else f"{type(error).__name__}: {error}"
        return unfinished(run, "crashed", told, time.perf_counter() - began)
    seconds = time.perf_counter() - began
    for name in _PATHS:
        metrics.get("chosen", {}).pop(name, None)
    pieces = _segments(folder, config) if run.segments else None
    record = _record(run, metrics, pieces, folder, seconds)
    write_text(folder / METRICS, json.dumps(metrics, indent=2, sort_keys=True) + "\n")
    _thin(folder, keep, config)
    return record


def unfinished(run: Run, status: RecordStatus, reason: str, seconds: float) -> RunRecord:
    """The record of a run that gave no metrics."""
    return RunRecord(
        run.key, run.study, dict(run.axes), run.sequence, run.route, run.group, run.seed,
        status, reason, seconds=seconds, code=code_hash(), versions=versions(),
    )  # fmt: skip


def _record(
    run: Run,
    metrics: dict[str, Any],
    pieces: list[dict[str, Any]] | None,
    folder: Path,
    seconds: float,
) -> RunRecord:
    lines = (folder / EVENTS).read_text(encoding="utf-8").splitlines()
    kinds = Counter(json.loads(line)["kind"] for line in lines)
    kept = {name: value for name, value in metrics.items() if name not in _APART}
    return RunRecord(
        run.key, run.study, dict(run.axes), run.sequence, run.route, run.group, run.seed,
        metrics["status"], metrics["reason"], kept, metrics["tracking"],
        pieces, dict(sorted(kinds.items())), seconds, metrics["cpu_ms"],
        code=code_hash(), versions=versions(),
    )  # fmt: skip


def _segments(folder: Path, config: Config) -> list[dict[str, Any]]:
    """Errors of each piece of the way in few digits; none without truth or estimates."""
    try:
        has_masks = (Path(config.dataset.path or "") / MASKS).is_dir()
        moving = moving_objects(config) if has_masks else None
        pieces = run_segments(folder, moving=moving)
    except DataError:
        return []
    return [{name: _short(value) for name, value in p.to_json().items()} for p in pieces]


def _short(value: Any) -> Any:
    return float(f"{value:.{_SEGMENT_DIGITS}g}") if isinstance(value, float) else value


def _thin(folder: Path, keep: Keep, config: Config) -> None:
    """Leave the small files, and of the truth the poses on both sides of every image.

    So every run on a recording has the same, and whatever is computed with it stays the same.
    """
    if keep == "all":
        return
    for path in folder.iterdir():
        if path.is_file() and (keep == "none" or path.name not in SMALL):
            path.unlink()
    if keep == "none":
        folder.rmdir()
        return
    truth = folder / "truth.tum"
    if truth.is_file():
        sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
        known = read_tum(truth)
        stamps = stamps_on_imu_clock(sequence, config.dataset.time_offset_s)
        after = np.searchsorted(known.stamps_ns, stamps)
        rows = np.unique(np.clip([after - 1, after], 0, len(known) - 1))
        write_tum(truth, Trajectory(known.stamps_ns[rows], known.T_world_imu[rows]))


class _Reporter:
    """Observer of a run that tells how many images are done."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._last, self._total = progress, 0.0, 0

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Count the images."""
        self._total = len(sequence.image_stamps_ns)

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Tell it now and then."""
        now = time.monotonic()
        if now - self._last > _BETWEEN_S:
            self._last = now
            self._progress(index + 1, self._total)
