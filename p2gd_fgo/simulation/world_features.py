"""Feature tracks of a scenario without its images: landmarks on the world's surfaces, hidden by it.

Routes, sensors and IMU errors are the scenario's; a minute takes seconds instead of minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import inverse, transform
from p2gd_fgo.simulation.feature_recording import FeatureRecording
from p2gd_fgo.simulation.features import (
    CAR_FEATURES,
    ROBOT_FEATURES,
    FeatureModel,
    simulate_features,
)
from p2gd_fgo.simulation.imu_errors import synthesize
from p2gd_fgo.simulation.production import build_world, lens, plan
from p2gd_fgo.simulation.raster import DISC, TRIANGLE
from p2gd_fgo.simulation.renderer import Renderer
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.simulation.world import World
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray

_SHRINK = 4  # of the depth images that say what is hidden
_DEPTH_TOLERANCE = 0.04  # relative
_LARGEST_M = 120.0  # longer surfaces are ground and hills far away
_STILL = 1e-3  # m/s


def record_world_features(
    scenario: Scenario, *, model: FeatureModel | None = None, build: bool = True
) -> FeatureRecording:
    """Drive a scenario's route and record its features.

    Parameters
    ----------
    model
        Number and behaviour of the features; None: by the vehicle.
    build
        Whether to build the world: landmarks then lie on its surfaces and are hidden by them, as
        the images would have it. Otherwise they are scattered along the route, which is the thing
        for drives of half an hour.

    Raises
    ------
    DataError
        A route file that can't be used.
    """
    prepared = plan(scenario)
    trajectory, camera = prepared.drive.trajectory, prepared.calibration.camera
    T_imu_cam, stamps = prepared.calibration.T_imu_cam, prepared.image_stamps_ns
    car = scenario.vehicle.kind == "car"
    model = model or replace(
        CAR_FEATURES if car else ROBOT_FEATURES,
        camera_height_m=scenario.vehicle.imu_height_m,
    )
    rng = np.random.default_rng([scenario.seed, 6])
    state = trajectory.sample(stamps)
    landmarks = unhidden = None
    if build:
        world = build_world(prepared)
        length = float(prepared.drive.arc_m[-1]) + 50.0
        count = int(3.0 * model.landmarks_per_m * length)
        places = state.T_world_imu[:, :3, 3]
        landmarks = surface_landmarks(world, places, model.max_range_m, count, rng)
        unhidden = _DepthTest(world, lens(scenario.camera)).unhidden
    seed = scenario.seed if scenario.imu.seed is None else scenario.imu.seed
    imu = synthesize(trajectory, prepared.imu_stamps_ns, scenario.imu, seed)
    observations = simulate_features(
        trajectory, stamps, camera, T_imu_cam, model, rng, landmarks=landmarks, unhidden=unhidden
    )
    at = np.searchsorted(prepared.imu_stamps_ns, stamps)
    offset = round(scenario.imu.time_offset_s * NANOSECONDS)
    if offset:
        observations = [replace(o, stamp_ns=o.stamp_ns - offset) for o in observations]
    return FeatureRecording(
        prepared.calibration,
        stamps - offset,
        imu.batch,
        observations,
        state.T_world_imu,
        state.velocity,
        imu.gyro_bias[at],
        imu.accel_bias[at],
        np.linalg.norm(state.velocity, axis=1) < _STILL,
    )


def surface_landmarks(
    world: World, places: FloatArray, reach_m: float, count: int, rng: np.random.Generator
) -> FloatArray:
    """Points (count, 3) on the world's surfaces within reach of places (N, 3).

    A surface gets them by the root of its area over its distance: what is near and small has more
    corners per square metre than what is far and large.
    """
    s = world.surfaces
    middle = s.corner + 0.5 * (s.edge_u + s.edge_v)
    size = s.size_m
    distance = np.full(len(s), np.inf)
    for place in places[:: max(len(places) // 200, 1)]:
        distance = np.minimum(distance, np.linalg.norm(middle - place, axis=1))
    near = (distance < reach_m) & (size.max(1) < _LARGEST_M)
    weight = np.where(near, np.sqrt(size.prod(1)) / (distance + 3.0), 0.0)
    chosen = rng.choice(len(s), count, p=weight / weight.sum())
    uv = rng.random((count, 2))
    shape = s.shape[chosen]
    beyond = (shape == TRIANGLE) & (uv.sum(1) > 1.0)
    uv[beyond] = 1.0 - uv[beyond]
    inner = shape == DISC
    radius = 0.5 * np.sqrt(uv[inner, 0])
    angle = 2.0 * np.pi * uv[inner, 1]
    uv[inner] = 0.5 + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    return np.asarray(
        s.corner[chosen] + uv[:, :1] * s.edge_u[chosen] + uv[:, 1:] * s.edge_v[chosen]
    )


class _DepthTest:
    """What is hidden, by a small depth image of the world for each pose."""

    def __init__(self, world: World, camera: RadTanCamera) -> None:
        self._camera = replace(
            camera,
            width=camera.width // _SHRINK,
            height=camera.height // _SHRINK,
            fx=camera.fx / _SHRINK,
            fy=camera.fy / _SHRINK,
            cx=camera.cx / _SHRINK,
            cy=camera.cy / _SHRINK,
        )
        self._renderer = Renderer(self._camera, world)

    def unhidden(self, T_world_cam: FloatArray, points: FloatArray) -> BoolArray:
        """Which points (N, 3) in view nothing stands before."""
        inverse_depth = self._renderer.inverse_depth(T_world_cam)
        seen = transform(inverse(T_world_cam), points)
        pixels = np.rint(self._camera.project(seen)).astype(int)
        columns = np.clip(pixels[:, 0], 0, self._camera.width - 1)
        rows = np.clip(pixels[:, 1], 0, self._camera.height - 1)
        nearest = inverse_depth[rows, columns]
        return np.asarray(nearest * seen[:, 2] < 1.0 + _DEPTH_TOLERANCE)
