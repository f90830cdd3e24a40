"""A run with all that belongs to it: recording in, run directory and metrics out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
from pydantic import BaseModel

from p2gd_fgo.config import Config, config_hash, dump_yaml, override, resolve
from p2gd_fgo.datasets import Sequence, open_sequence
from p2gd_fgo.datasets.base import stamps_on_imu_clock
from p2gd_fgo.datasets.opening import recording_path
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.evaluation.evaluate import ErrorSeries, error_series, evaluate
from p2gd_fgo.evaluation.evo_bridge import write_result
from p2gd_fgo.evaluation.frame_measures import frame_measures
from p2gd_fgo.evaluation.metrics import Metrics
from p2gd_fgo.evaluation.tracking_quality import (
    TrackingQuality,
    camera_rotations,
    tracking_quality,
)
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.pipeline import NoObserver, Observer, run_sequence
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.report.figures import trajectory_figure
from p2gd_fgo.report.frame_capture import FrameCapture, Observers
from p2gd_fgo.report.image_figures import write_image_figures
from p2gd_fgo.report.summaries import StageTime, summarize_timing
from p2gd_fgo.run_directory import EVO_RESULT, FIGURE, RunDirectory, check_free
from p2gd_fgo.types import NANOSECONDS, Estimate, Event, FloatArray, Image, Trajectory, Waiting

_ALWAYS_DETERMINED = "yaw_pos"
_FRONTEND_SHOWN = ("tracker", "equalize", "continue_consumed")


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """What a run gave.

    Attributes
    ----------
    name
        Of the run.
    result
        Trajectories, times, events.
    metrics
        Errors against truth, or counts alone without it.
    tracking
        Length and parallax of the tracks.
    timing
        CPU by stage.
    events
        What a reader must know: of the run, and of its judgement.
    header
        What was chosen, for tables: name and value.
    path
        The run directory.
    """

    name: str
    result: RunResult
    metrics: Metrics
    tracking: TrackingQuality
    timing: Mapping[str, StageTime]
    events: tuple[Event, ...]
    header: list[tuple[str, str]]
    path: Path


def run_experiment(
    config: Config,
    *,
    out: Path | None = None,
    overwrite: bool = False,
    observer: Observer | None = None,
    figures: Collection[int] = (),
) -> Experiment:
    """Run ``config.dataset.path``, judge the estimate and write the run directory.

    Parameters
    ----------
    out
        The run directory; by default ``results/<name>/<hash of the configuration>``.
    overwrite
        Whether an existing run there may be replaced.
    observer
        Told about the run as it goes on.
    figures
        Image numbers, from 0, of which a picture is drawn: features, quotas and, where P2GD ran,
        what it saw and predicted.

    Raises
    ------
    ConfigError, DataError
        Bad input, before the first image. What goes wrong later is in the result's ``status``.
    """
    cv2.setNumThreads(config.runtime.threads)
    sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
    _check_figures(figures, len(sequence.image_stamps_ns))
    config = resolve(config, sequence.calibration.camera.width)
    name = config.name or sequence.name
    source = str(recording_path(config.dataset).resolve())
    path = out or Path("results", name, config_hash(config, source))
    check_free(path, overwrite)
    config = override(config, {"dataset.path": source})  # found again from any working directory
    capture, opening = FrameCapture(figures), _Opening(path, overwrite)
    watching = Observers(opening, observer or NoObserver(), capture)
    try:
        result = run_sequence(sequence, config, watching)
        assert opening.directory is not None
        pictured = write_image_figures(
            opening.directory, capture, figures, run=name, priors=result.priors
        )
        return _judged(name, sequence, config, result, opening.directory, pictured)
    except BaseException as error:
        if opening.directory is not None:
            with suppress(OSError):  # of a full disk, say, which is told below
                opening.directory.finish("failed", f"stopped by {type(error).__name__}: {error}")
        if isinstance(error, OSError):
            raise DataError(
                f"{path}: the run can't be written ({error.strerror}): free some space, or give "
                "another --out"
            ) from error
        raise


def _judged(
    name: str,
    sequence: Sequence,
    config: Config,
    result: RunResult,
    directory: RunDirectory,
    pictured: Collection[Event],
) -> Experiment:
    """Judge a run and write what is known of it into its directory."""
    truth = sequence.truth.trajectory if sequence.truth else None
    metrics, errors, events = _judge(result, truth)
    header = describe(sequence, config, result, directory.path)
    tracking = _tracking(sequence, result, truth)
    events = (*events, *pictured)
    timing = summarize_timing(result.timing)

    directory.write_trajectory("estimate.tum", result.estimate)
    directory.write_trajectory("smoothed.tum", result.smoothed)
    if truth is not None:
        directory.write_trajectory("truth.tum", truth)
    directory.write_timing(result.timing_stamps_ns, result.timing)
    directory.write_tracks(result.tracks)
    directory.write_frames(result.tracks.stamps_ns, _frames(sequence, result, truth))
    directory.write_events(events)
    directory.write_metrics(
        metrics.to_json()
        | {
            "name": name,
            "status": result.status,
            "reason": result.reason,
            "start": result.start_note,
            "backend": config.backend.kind,
            "distribution": config.distribution.kind,
            "seed": config.runtime.seed,
            "counts": result.counts,
            "tracking": tracking.to_json(),
            "cpu_ms": {stage: asdict(time) for stage, time in timing.items()},
            "chosen": dict(header),
        }
    )
    if errors is not None:
        write_result(
            directory.file(EVO_RESULT),
            errors.estimate,
            errors.reference,
            alignment=errors.alignment,
            name=name,
        )
    trajectory_figure(
        directory.file(FIGURE),
        result.estimate,
        None if truth is None else _during(truth, sequence, config),
        errors,
        title=f"{name} · {config.backend.kind} · {config.distribution.kind}",
        note="" if result.status == "done" else f"failed: {result.reason}",
    )
    directory.finish(result.status, result.reason)
    return Experiment(name, result, metrics, tracking, timing, events, header, directory.path)


class _Opening:
    """Makes the run directory when the first image is due: bad input leaves an old run alone."""

    def __init__(self, path: Path, overwrite: bool) -> None:
        self._path, self._overwrite = path, overwrite
        self.directory: RunDirectory | None = None

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Make it."""
        self.directory = RunDirectory(self._path, self._overwrite)
        self.directory.write_config(dump_yaml(config))

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Nothing."""


def describe(
    sequence: Sequence, config: Config, result: RunResult, out: Path
) -> list[tuple[str, str]]:
    """What was chosen, for the head of the table."""
    stamps = sequence.image_stamps_ns
    seconds = float(stamps[-1] - stamps[0]) / NANOSECONDS
    rate = (len(stamps) - 1) / seconds if seconds > 0 else 0.0
    camera, f, b = sequence.calibration.camera, config.frontend, config.backend
    assert f.grid is not None
    backend: str = b.kind
    if b.kind in ("smoother", "msckf"):
        backend += f" · window {b.window} · pixel noise {b.pixel_noise_px:g} px"
    if b.kind == "msckf" and b.msckf.fej:
        backend += " · first-estimate Jacobians"
    start = result.start_note or f"{config.initialization.kind}, refused"
    return [
        ("sequence", f"{sequence.name} · {len(stamps)} images in {seconds:.1f} s, {rate:.1f} Hz"),
        ("camera", f"{camera.width}x{camera.height} · {type(camera).__name__}"),
        ("back end", backend),
        ("distribution", _distribution(config)),
        ("priors", result.priors if config.distribution.kind == "p2gd" else "not used"),
        (
            "features",
            f"{f.max_features} · grid {f.grid[0]}x{f.grid[1]} · {f.min_distance_px:g} px apart · "
            f"tracks up to {f.max_track_length} images{_unusual(f, _FRONTEND_SHOWN)}",
        ),
        ("start", start),
        ("seed", str(config.runtime.seed)),
        ("results", str(out)),
    ]


def _check_figures(figures: Collection[int], images: int) -> None:
    for index in figures:
        if not 0 <= index < images:
            raise ConfigError(
                f"a picture of image {index} was asked for, but the recording has {images} images: "
                f"give numbers from 0 to {images - 1}"
            )


def _tracking(sequence: Sequence, result: RunResult, truth: Trajectory | None) -> TrackingQuality:
    record = result.tracks
    estimate = result.smoothed if len(result.smoothed) else result.estimate
    T_imu_cam = sequence.calibration.T_imu_cam
    rotations = camera_rotations(record.stamps_ns, truth, estimate, T_imu_cam)
    return tracking_quality(record, rotations)


def _during(truth: Trajectory, sequence: Sequence, config: Config) -> Trajectory:
    """The truth while images were taken: a recording cut short is drawn no further."""
    first, last = stamps_on_imu_clock(sequence, config.dataset.time_offset_s)[[0, -1]]
    inside = (truth.stamps_ns >= first) & (truth.stamps_ns <= last)
    return Trajectory(truth.stamps_ns[inside], truth.T_world_imu[inside])


def _frames(
    sequence: Sequence, result: RunResult, truth: Trajectory | None
) -> dict[str, FloatArray]:
    poses = truth if truth is not None else result.smoothed
    return frame_measures(result, poses, sequence.calibration.T_imu_cam)


def _distribution(config: Config) -> str:
    """Its name, and every option that is not the default."""
    chosen, masks = config.distribution, config.dataset
    text: str = chosen.kind
    if chosen.kind == "p2gd":
        text += _unusual(chosen.p2gd, set(type(chosen.p2gd).model_fields) - {"horizon", "scene"})
        text += _unusual(chosen.p2gd.scene, set(type(chosen.p2gd.scene).model_fields))
    text += " · refill" if chosen.refill else ""
    return (
        text
        + (f" · mask {masks.mask}" if masks.mask else "")
        + (f" · masks {masks.masks}" if masks.masks else "")
    )


def _unusual(model: BaseModel, names: Collection[str]) -> str:
    """The fields of these names that don't have their default, as " · name value"."""
    fields = type(model).model_fields
    values = {name: getattr(model, name) for name in fields if name in names}
    return "".join(
        f" · {name} {value}" for name, value in values.items() if value != fields[name].default
    )


def _judge(
    result: RunResult, truth: Trajectory | None
) -> tuple[Metrics, ErrorSeries | None, tuple[Event, ...]]:
    """Metrics, errors over time where there are any, and the events with what was found."""
    evaluation = result.config.evaluation
    estimate, total = result.estimate, result.frames_total
    if truth is None or len(estimate) == 0:
        counted = evaluate(estimate, None, frames_total=total, config=evaluation)
        return counted, None, result.events
    try:
        metrics = evaluate(estimate, truth, frames_total=total, config=evaluation)
    except DataError as error:
        counted = evaluate(estimate, None, frames_total=total, config=evaluation)
        event = Event(int(estimate.stamps_ns[-1]), "not_evaluated", str(error))
        return counted, None, (*result.events, event)
    try:
        errors = error_series(estimate, truth, evaluation.alignment)
    except DataError:
        errors = error_series(estimate, truth, _ALWAYS_DETERMINED)
    return metrics, errors, result.events
