"""Write a scenario as an ASL folder: frames in parallel, resumable, and never half a file."""

from __future__ import annotations

import multiprocessing
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from p2gd_fgo.atomic_files import atomic_path, write_text
from p2gd_fgo.datasets.asl_writer import write_png, write_sensors
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.simulation.demo import default_cache
from p2gd_fgo.simulation.imu_errors import synthesize
from p2gd_fgo.simulation.presets import dump_scenario, images_hash, scenario_hash
from p2gd_fgo.simulation.production import Plan, Studio, plan, with_route_hash
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.types import NANOSECONDS, IntArray, Trajectory, Truth

WORLD_VERSION = 1
"""Raised with every change that changes a scenario's images, so that old folders are not reused."""

Progress = Callable[[int, int], None]

_FRAME_FOLDERS = ("cam0", "mask0")
_HASH_FILE = "images.hash"
_CHUNK = 4  # frames a task


@dataclass(frozen=True, slots=True)
class Recorded:
    """Where a recording is, how many frames it has, and how many were rendered now."""

    folder: Path
    frames: int
    rendered: int


def record(
    scenario: Scenario,
    folder: Path | None = None,
    *,
    jobs: int = 1,
    overwrite: bool = False,
    reuse: Path | None = None,
    progress: Progress | None = None,
) -> Recorded:
    """Render what is missing in ``folder``, and write sensors, truth and scenario.

    A folder that holds other images is left alone; one whose images differ by nothing but the IMU's
    section keeps them. The same scenario always gives the same bytes, on any number of processes.

    Parameters
    ----------
    folder
        Default: in the user's cache, by the scenario's hash.
    jobs
        Processes.
    overwrite
        Replace other images in ``folder``.
    reuse
        Another recording with the same images; they are linked instead of rendered.

    Raises
    ------
    ConfigError
        ``folder`` holds other images; ``reuse`` has other images; the camera sees nothing.
    DataError
        A route that can't be used, or a folder that can't be written.
    """
    scenario = with_route_hash(scenario)
    prepared = plan(scenario)
    folder = folder or default_folder(scenario)
    key = images_hash(scenario, WORLD_VERSION)
    try:
        if reuse is not None:
            _check_reusable(reuse, key)
        _claim(folder, key, overwrite)
        if reuse is not None:
            _link(reuse, folder)
        stamps = image_names(prepared)
        frames = _Frames(folder, scenario.camera.depth_every_px)
        todo = [k for k, stamp in enumerate(stamps.tolist()) if not frames.complete(stamp)]
        say = progress or (lambda done, total: None)
        done = len(stamps) - len(todo)
        say(done, len(stamps))
        for count in _render(prepared, frames, todo, jobs):
            done += count
            say(done, len(stamps))
        _write_rest(folder, prepared)
    except OSError as error:
        raise DataError(
            f"{folder}: the recording can't be written ({error.strerror}): free some space or give "
            "another --out"
        ) from error
    return Recorded(folder, len(stamps), len(todo))


def default_folder(scenario: Scenario) -> Path:
    """Folder in the user's cache that only this scenario uses."""
    scenario = with_route_hash(scenario)
    name = f"{scenario.name or 'scenario'}-{scenario_hash(scenario, WORLD_VERSION)}"
    return default_cache() / "simulated" / name


def image_names(prepared: Plan) -> IntArray:
    """Stamps (N,) on the camera's clock: t_imu = t_cam + offset."""
    offset = round(prepared.scenario.imu.time_offset_s * NANOSECONDS)
    return prepared.image_stamps_ns - offset


def contact_sheet(folder: Path, count: int, path: Path, width: int = 1280) -> None:
    """Put ``count`` images of a recording, evenly spread, on one JPEG in two columns."""
    files = sorted((folder / "mav0" / "cam0" / "data").glob("*.png"))
    chosen = [files[k] for k in np.linspace(0, len(files) - 1, count).round().astype(int)]
    views = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in chosen]
    write_sheet([view for view in views if view is not None], path, width)


def write_sheet(images: list[np.ndarray], path: Path, width: int = 1280) -> None:
    """Write images (H, W) as one JPEG in two columns, ``width`` px wide."""
    height = round(images[0].shape[0] * (width // 2) / images[0].shape[1])
    small = [cv2.resize(v, (width // 2, height), interpolation=cv2.INTER_AREA) for v in images]
    if len(small) % 2:
        small.append(np.zeros_like(small[0]))
    sheet = np.vstack([np.hstack(small[k : k + 2]) for k in range(0, len(small), 2)])
    with atomic_path(path) as part:
        cv2.imwrite(str(part), sheet, [cv2.IMWRITE_JPEG_QUALITY, 80])


@dataclass(frozen=True, slots=True)
class _Frames:
    """The files of each frame."""

    folder: Path
    depth_every_px: int | None

    def paths(self, stamp: int) -> list[Path]:
        mav0 = self.folder / "mav0"
        paths = [mav0 / name / "data" / f"{stamp}.png" for name in _FRAME_FOLDERS]
        if self.depth_every_px is not None:
            paths.append(mav0 / "depth0" / "data" / f"{stamp}.csv")
        return paths

    def complete(self, stamp: int) -> bool:
        return all(path.is_file() for path in self.paths(stamp))

    def write(self, studio: Studio, index: int, stamp: int) -> None:
        rendering = studio.view(index)
        image, mask, *depth = self.paths(stamp)
        if depth:
            depth[0].parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(depth[0]) as part:
                part.write_text(_depths(rendering.inverse_depth, self.depth_every_px), "ascii")
        with atomic_path(mask) as part:
            write_png(part, rendering.mask())
        with atomic_path(image) as part:
            write_png(part, studio.expose(rendering, index), compress=False)


_studio: Studio | None = None
_job: tuple[_Frames, IntArray] | None = None


def _start(prepared: Plan | None, frames: _Frames) -> None:
    """Begin a worker: take the world that was built before the fork, or build it."""
    global _studio, _job
    if prepared is not None:
        _studio = Studio(prepared)
        _job = (frames, image_names(prepared))


def _work(indices: list[int]) -> int:
    assert _studio is not None and _job is not None
    frames, stamps = _job
    for index in indices:
        frames.write(_studio, index, int(stamps[index]))
    return len(indices)


def _render(prepared: Plan, frames: _Frames, todo: list[int], jobs: int) -> Iterator[int]:
    """Render the frames in ``todo``; yields how many each task has finished."""
    global _studio, _job
    if not todo:
        return
    chunks = [todo[k : k + _CHUNK] for k in range(0, len(todo), _CHUNK)]
    try:
        if jobs < 2:
            _start(prepared, frames)
            yield from map(_work, ([k] for k in todo))
            return
        fork = "fork" in multiprocessing.get_all_start_methods()
        context = multiprocessing.get_context("fork" if fork else "spawn")
        if fork:
            _start(prepared, frames)
        start = (None if fork else prepared, frames)
        with ProcessPoolExecutor(jobs, context, _start, start) as pool:
            yield from pool.map(_work, chunks)
    finally:
        _studio, _job = None, None


def _claim(folder: Path, key: str, overwrite: bool) -> None:
    """Make the folder this recording's, or refuse."""
    mark = folder / _HASH_FILE
    if mark.is_file() and mark.read_text(encoding="ascii").strip() == key:
        pass
    elif folder.exists() and any(folder.iterdir()):
        if not overwrite:
            raise ConfigError(
                f"{folder} holds other files or another recording: give a new --out, or --overwrite"
            )
        if not mark.is_file():
            raise ConfigError(
                f"{folder} is no simulated recording, so --overwrite leaves it: give a new --out"
            )
        shutil.rmtree(folder / "mav0", ignore_errors=True)
    for name in _FRAME_FOLDERS:
        (folder / "mav0" / name / "data").mkdir(parents=True, exist_ok=True)
    write_text(mark, key + "\n")


def _check_reusable(source: Path, key: str) -> None:
    mark = source / _HASH_FILE
    if not source.is_dir():
        raise ConfigError(f"--reuse {source}: no such folder: give a simulated recording")
    if not mark.is_file() or mark.read_text(encoding="ascii").strip() != key:
        raise ConfigError(
            f"--reuse {source}: its images are of another scenario; only the imu section may differ"
        )


def _link(source: Path, folder: Path) -> None:
    for file in (source / "mav0").glob("*0/data/*.*"):
        target = folder / file.relative_to(source)
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists():
            try:
                target.hardlink_to(file)
            except OSError:
                shutil.copyfile(file, target)


def _write_rest(folder: Path, prepared: Plan) -> None:
    scenario, trajectory = prepared.scenario, prepared.drive.trajectory
    seed = scenario.seed if scenario.imu.seed is None else scenario.imu.seed
    imu = synthesize(trajectory, prepared.imu_stamps_ns, scenario.imu, seed)
    state = trajectory.sample(prepared.imu_stamps_ns)
    truth = Truth(
        Trajectory(prepared.imu_stamps_ns, state.T_world_imu),
        state.velocity,
        imu.gyro_bias,
        imu.accel_bias,
    )
    write_sensors(folder, prepared.calibration, image_names(prepared), imu.batch, truth)
    if scenario.route.file is not None:
        name = "route" + Path(scenario.route.file).suffix
        if Path(scenario.route.file).resolve() != (folder / name).resolve():
            shutil.copyfile(scenario.route.file, folder / name)
        route = scenario.route.model_copy(update={"file": name})
        scenario = scenario.model_copy(update={"route": route})
    write_text(folder / "scenario.yaml", dump_scenario(scenario))


def _depths(inverse_depth: np.ndarray, every: int | None) -> str:
    """Column, row and depth of the pixels of a lattice; the sky is left out."""
    assert every is not None
    rows, columns = (np.arange(every // 2, size, every) for size in inverse_depth.shape)
    lines = ["#column,row,depth [m]"]
    for row in rows.tolist():
        for column in columns.tolist():
            w = float(inverse_depth[row, column])
            if w > 0.0:
                lines.append(f"{column},{row},{1.0 / w:.9g}")
    return "\n".join(lines) + "\n"


def sample_sheet(scenario: Scenario, count: int, path: Path) -> None:
    """Render ``count`` images of a scenario, evenly spread, onto one JPEG and nothing else.

    Raises
    ------
    ConfigError, DataError
        As :func:`record`.
    """
    studio = Studio(plan(with_route_hash(scenario)))
    frames = len(studio.plan.image_stamps_ns)
    chosen = np.linspace(0, frames - 1, count).round().astype(int).tolist()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_sheet([studio.expose(studio.view(k), k) for k in chosen], path)
