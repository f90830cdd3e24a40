"""The folder of one run: what was asked, what came out, and whether it is whole.

``status.json`` is written first, with the state ``running``, and last, with ``done`` or
``failed``: a folder that still says ``running`` belongs to a run that is under way or was killed.
Every file appears whole or not at all.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from p2gd_fgo import __version__
from p2gd_fgo.atomic_files import atomic_path, write_text
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.trajectory_files import write_tum
from p2gd_fgo.types import Event, FloatArray, IntArray, TrackRecord, Trajectory

RunState = Literal["running", "done", "failed"]
TrajectoryName = Literal["estimate.tum", "truth.tum", "smoothed.tum"]
FrameTimes = Mapping[str, tuple[float, float]]  # stage to (process CPU ms, wall ms)

STATUS, CONFIG, METRICS = "status.json", "config.yaml", "metrics.json"
TIMING, EVENTS = "timing.csv", "events.jsonl"
EVO_RESULT, FIGURE, TRACKS = "evo_result.zip", "trajectory.png", "tracks.npz"
FRAMES = "frames.csv"
FILES = (
    *(STATUS, CONFIG, METRICS, TIMING, EVENTS, EVO_RESULT, FIGURE, TRACKS, FRAMES),
    *("estimate.tum", "truth.tum", "smoothed.tum"),
)
IMAGE_FIGURES = "figures"
"""Folder in a run directory: pictures of single images, ``<what>_<image number>.png``."""

_IMAGE_FIGURE = re.compile(r"(p2gd|features)_\d{6,}\.png")
_PROGRAM = "p2gd-fgo"


class RunDirectory:
    """Writer of a run's files.

    Parameters
    ----------
    out
        The folder; made with its parents.
    overwrite
        Whether a folder that already holds a run may be used again. The files of that run are
        removed at once, so that nothing of it can be taken for this run's; any other file stays.

    Raises
    ------
    ConfigError
        The folder isn't empty and ``overwrite`` is off, or holds something else than a run, or
        can't be made.
    """

    def __init__(self, out: Path, overwrite: bool) -> None:
        self.path = Path(out)
        check_free(self.path, overwrite)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._started = _now()
            self._write_status("running", None)
            for name in FILES:
                if name != STATUS:
                    (self.path / name).unlink(missing_ok=True)
            for figure in self.path.glob(f"{IMAGE_FIGURES}/*.png"):
                if _IMAGE_FIGURE.fullmatch(figure.name):
                    figure.unlink()
        except OSError as error:
            raise ConfigError(
                f"--out {self.path}: can't be written: {error.strerror}; name another folder"
            ) from None

    def file(self, name: str) -> Path:
        """Path of a file in the folder, for writers of other rooms (figure, evo's result)."""
        return self.path / name

    def image_figure(self, what: str, index: int) -> Path:
        """Path of a picture of image ``index``; its folder is made."""
        path = self.path / IMAGE_FIGURES / f"{what}_{index:06d}.png"
        path.parent.mkdir(exist_ok=True)
        return path

    def write_config(self, yaml_text: str) -> None:
        """Save the resolved configuration."""
        write_text(self.path / CONFIG, yaml_text)

    def write_trajectory(self, name: TrajectoryName, trajectory: Trajectory) -> None:
        """Save a trajectory as TUM; the same trajectory gives the same bytes."""
        write_tum(self.path / name, trajectory)

    def write_metrics(self, metrics: Mapping[str, object]) -> None:
        """Save numbers as JSON with sorted keys; NaN and infinity become null."""
        text = json.dumps(_plain(metrics), indent=2, sort_keys=True, allow_nan=False)
        write_text(self.path / METRICS, text + "\n")

    def write_tracks(self, record: TrackRecord) -> None:
        """Save the fields of the record as arrays of these names, ``normalized`` as float32.

        The same record gives the same bytes.
        """
        with atomic_path(self.path / TRACKS) as temporary:
            np.savez_compressed(
                temporary,
                stamps_ns=record.stamps_ns,
                counts=record.counts,
                asked=record.asked,
                ids=record.ids,
                normalized=record.normalized.astype(np.float32),
            )

    def write_timing(self, stamps_ns: IntArray, rows: Sequence[FrameTimes]) -> None:
        """Save one line per image: ``stamp_ns``, then CPU and wall ms of every stage.

        The columns are the stages of all rows in the order of their first appearance; where a
        stage didn't run the field is empty. ``stamps_ns`` (N,), ``rows`` N mappings.
        """
        stages = list(dict.fromkeys(stage for row in rows for stage in row))
        header = ["stamp_ns", *(f"{s}_{kind}_ms" for s in stages for kind in ("cpu", "wall"))]
        lines = [",".join(header)]
        for stamp, row in zip(stamps_ns.tolist(), rows, strict=True):
            times = (f"{row[s][0]:.4f},{row[s][1]:.4f}" if s in row else "," for s in stages)
            lines.append(",".join([str(stamp), *times]))
        write_text(self.path / TIMING, "\n".join(lines) + "\n")

    def write_frames(self, stamps_ns: IntArray, columns: Mapping[str, FloatArray]) -> None:
        """Save one line per image: ``stamp_ns``, then the columns, (F,) each; NaN is left empty."""
        lines = [",".join(["stamp_ns", *columns])]
        for stamp, *row in zip(stamps_ns.tolist(), *columns.values(), strict=True):
            values = ("" if math.isnan(value) else f"{value:.6g}" for value in row)
            lines.append(",".join([str(stamp), *values]))
        write_text(self.path / FRAMES, "\n".join(lines) + "\n")

    def write_events(self, events: Iterable[Event]) -> None:
        """Save events, one JSON object a line: ``stamp_ns, kind, message, data``."""
        lines = (json.dumps(_plain(asdict(event)), ensure_ascii=False) for event in events)
        write_text(self.path / EVENTS, "".join(f"{line}\n" for line in lines))

    def finish(self, state: Literal["done", "failed"], reason: str | None = None) -> None:
        """Mark the run as ended; ``reason`` is one sentence, required where it failed."""
        if state == "failed" and not reason:
            raise ValueError("a failed run needs a reason")
        self._write_status(state, reason)

    def _write_status(self, state: RunState, reason: str | None) -> None:
        status = {
            "program": _PROGRAM,
            "version": __version__,
            "state": state,
            "reason": reason,
            "started_utc": self._started,
            "finished_utc": None if state == "running" else _now(),
            "pid": os.getpid(),
        }
        write_text(self.path / STATUS, json.dumps(status, indent=2) + "\n")


def read_status(path: Path) -> dict[str, Any] | None:
    """Read ``status.json`` of a run's folder; None where it is no run of this program."""
    try:
        status = json.loads((path / STATUS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(status, dict) or status.get("program") != _PROGRAM:
        return None
    return status


def check_free(path: Path, overwrite: bool) -> None:
    """Refuse a folder that a run may not be written to.

    Raises
    ------
    ConfigError
        As :class:`RunDirectory`; nothing is touched.
    """
    if not path.exists():
        return
    if not path.is_dir():
        raise ConfigError(f"--out {path}: a file is in the way; name a folder")
    if not any(path.iterdir()):
        return
    status = read_status(path)
    if status is None:
        raise ConfigError(
            f"--out {path}: holds files that are no run, which are never overwritten; name another "
            "folder"
        )
    if not overwrite:
        raise ConfigError(
            f"--out {path}: holds a run ({status.get('state')}) already; give --overwrite to "
            "replace it, or another folder"
        )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _plain(value: object) -> object:
    """Turn mappings, sequences and numbers into what JSON takes."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
