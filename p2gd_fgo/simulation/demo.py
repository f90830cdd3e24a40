"""The demo: a robot's drive through a courtyard, rendered once into the user's cache."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.asl_writer import write_asl
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.simulation.courtyard import courtyard
from p2gd_fgo.simulation.imu import MEMS_NOISE, synthesize_imu
from p2gd_fgo.simulation.renderer import Renderer, SensorModel
from p2gd_fgo.simulation.routes import ROBOT, make_route
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.simulation.world import World
from p2gd_fgo.types import NANOSECONDS, FloatArray, Image, IntArray, Trajectory, Truth

RENDERER_VERSION = 2
"""Raised with every change that changes the images, so that cached ones are made anew."""

Progress = Callable[[int, int], None]

_IMU_MARGIN_S = 0.1  # IMU samples before the first and after the last image
_START_NS = 1_700_000_000 * NANOSECONDS


@dataclass(frozen=True, slots=True)
class DemoParameters:
    """Everything that the demo's bytes depend on, beside the code.

    Attributes
    ----------
    duration_s, standstill_s
        Of the whole drive, and of its quiet beginning.
    image_rate_hz, imu_rate_hz
        Rates; the first divides the second.
    width, height
        Of the images, px.
    imu_height_m
        Of the IMU over the ground.
    route_seed, world_seed, noise_seed
        Of the drive, of the yard, and of the noise of camera and IMU.
    """

    duration_s: float = 22.0
    standstill_s: float = 2.0
    image_rate_hz: int = 10
    imu_rate_hz: int = 200
    width: int = 640
    height: int = 480
    imu_height_m: float = 0.45
    route_seed: int = 9
    world_seed: int = 4
    noise_seed: int = 1


def demo_sequence(
    cache_dir: Path | None = None,
    progress: Progress | None = None,
    *,
    parameters: DemoParameters | None = None,
) -> Path:
    """Folder of the demo's ASL recording, rendered first if it isn't there yet.

    Parameters
    ----------
    cache_dir
        Where rendered sequences are kept; default ``p2gd_fgo`` in the user's cache directory.
    progress
        Called with (frames done, frames in all).

    Raises
    ------
    DataError
        The cache directory can't be written.
    """
    parameters = parameters or DemoParameters()
    cache = default_cache() if cache_dir is None else cache_dir
    key = json.dumps([RENDERER_VERSION, asdict(parameters)], sort_keys=True)
    folder = cache / f"demo-{hashlib.sha256(key.encode()).hexdigest()[:12]}"
    if folder.is_dir():
        return folder
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache, prefix=".partial-") as scratch:
            made = Path(scratch) / folder.name
            _record(made, parameters, progress or (lambda done, total: None))
            try:
                made.rename(folder)
            except OSError:
                if not folder.is_dir():  # otherwise another process was first, with equal bytes
                    raise
    except OSError as error:
        raise DataError(
            f"the demo can't be written to {cache} ({error.strerror}): "
            "free some space or point XDG_CACHE_HOME to a directory that can be written"
        ) from error
    return folder


def default_cache() -> Path:
    """``$XDG_CACHE_HOME/p2gd_fgo``, or ``~/.cache/p2gd_fgo``."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "p2gd_fgo"


def demo_calibration(parameters: DemoParameters) -> Calibration:
    """Describe a wide lens that looks forward and a little up, ahead of and above the IMU."""
    width, height = parameters.width, parameters.height
    scale = width / 640.0
    camera = RadTanCamera(
        width, height, 421.3 * scale, 420.6 * scale, 0.503 * width, 0.496 * height,
        -0.281, 0.0725, 2.1e-4, 1.9e-5,
    )  # fmt: skip
    tilt, turn = np.radians(-3.0), np.radians(0.7)
    forward = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    c, s = np.cos(tilt), np.sin(tilt)
    pitch = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    c, s = np.cos(turn), np.sin(turn)
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    T_imu_cam = np.eye(4)
    T_imu_cam[:3, :3] = yaw @ pitch @ forward
    T_imu_cam[:3, 3] = [0.12, 0.03, 0.1]
    return Calibration(camera, T_imu_cam, MEMS_NOISE)


def demo_world(parameters: DemoParameters, trajectory: SplineTrajectory) -> World:
    """Build the yard around the drive, its ground ``imu_height_m`` under the world's origin."""
    stamps = np.arange(*trajectory.span_ns, NANOSECONDS // 10, dtype=np.int64)
    route = trajectory.sample(stamps).T_world_imu[:, :2, 3]
    rng = np.random.default_rng(parameters.world_seed)
    return courtyard(route, rng, ground_z=-parameters.imu_height_m)


def demo_trajectory(parameters: DemoParameters) -> SplineTrajectory:
    """Plan the drive."""
    return make_route(
        ROBOT,
        parameters.duration_s,
        np.random.default_rng(parameters.route_seed),
        stops_s=((0.0, parameters.standstill_s),),
        start_ns=_START_NS,
    )


def _record(folder: Path, parameters: DemoParameters, progress: Progress) -> None:
    trajectory = demo_trajectory(parameters)
    calibration = demo_calibration(parameters)
    image_stamps = _stamps(parameters.duration_s, 0.0, parameters.image_rate_hz)
    imu_stamps = _stamps(parameters.duration_s, _IMU_MARGIN_S, parameters.imu_rate_hz)
    imu = synthesize_imu(
        trajectory,
        imu_stamps,
        calibration.imu_noise,
        np.random.default_rng([parameters.noise_seed, 0]),
        gyro_bias=np.array([0.0041, -0.0027, 0.0018]),
        accel_bias=np.array([0.031, -0.022, 0.043]),
    )
    state = trajectory.sample(imu_stamps)
    truth = Truth(
        Trajectory(imu_stamps, state.T_world_imu), state.velocity, imu.gyro_bias, imu.accel_bias
    )
    cameras = trajectory.sample(image_stamps).T_world_imu @ calibration.T_imu_cam
    renderer = Renderer(calibration.camera, demo_world(parameters, trajectory))
    images = _images(renderer, cameras, parameters.noise_seed, progress)
    write_asl(folder, calibration, image_stamps, images, imu.batch, truth)


def _stamps(duration_s: float, margin_s: float, rate_hz: int) -> IntArray:
    period = NANOSECONDS // rate_hz
    first, last = -round(margin_s * rate_hz), round((duration_s + margin_s) * rate_hz)
    return _START_NS + period * np.arange(first, last + 1, dtype=np.int64)


def _images(
    renderer: Renderer, T_world_cam: FloatArray, seed: int, progress: Progress
) -> Iterator[Image]:
    sensor = SensorModel()
    for index, T in enumerate(T_world_cam):
        rng = np.random.default_rng([seed, 1, index])
        yield sensor.expose(renderer.render(T).brightness, rng)
        progress(index + 1, len(T_world_cam))
