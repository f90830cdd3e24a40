"""A simulated recording at feature level: IMU samples and tracks, with the whole truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.geometry.camera import Camera, RadTanCamera
from p2gd_fgo.simulation.features import (
    CAR_FEATURES,
    ROBOT_FEATURES,
    FeatureModel,
    simulate_features,
)
from p2gd_fgo.simulation.imu import MEMS_NOISE, synthesize_imu
from p2gd_fgo.simulation.routes import CAR, ROBOT, VehicleModel, make_route
from p2gd_fgo.types import NANOSECONDS, BoolArray, FloatArray, ImuBatch, IntArray, Observations

_IMAGE_NS = NANOSECONDS // 10
_IMU_MARGIN = 2  # samples before the first image and after the last
_GYRO_BIAS, _ACCEL_BIAS = 0.003, 0.03  # rad/s and m/s², 1 sigma at the start


@dataclass(frozen=True, slots=True, eq=False)
class Platform:
    """A vehicle and its sensors."""

    vehicle: VehicleModel
    features: FeatureModel
    camera: Camera
    T_imu_cam: FloatArray
    imu_rate_hz: int


def _forward_camera(x: float, y: float, z: float) -> FloatArray:
    """T_imu_cam (4, 4): looks along the body's x axis, mounted at (x, y, z)."""
    T = np.eye(4)
    T[:3, :3] = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    T[:3, 3] = x, y, z
    return T


CAR_PLATFORM = Platform(
    CAR,
    CAR_FEATURES,
    RadTanCamera(1280, 560, 816.9, 811.6, 608.5, 263.5, -0.0561, 0.1395, -0.00122, -0.00097),
    _forward_camera(1.7, 0.25, -0.1),
    100,
)
ROBOT_PLATFORM = Platform(
    ROBOT,
    ROBOT_FEATURES,
    RadTanCamera(800, 600, 500.0, 500.0, 400.0, 300.0, -0.1, 0.05, 0.0, 0.0),
    _forward_camera(0.3, 0.05, 0.1),
    200,
)


@dataclass(frozen=True, slots=True, eq=False)
class FeatureRecording:
    """What the sensors gave, and what was true at the N images.

    Attributes
    ----------
    calibration
        Of camera and IMU; ``imu_noise`` is what the samples were made with, or would be.
    image_stamps_ns
        (N,)
    imu
        From before the first image to after the last.
    observations
        N of them.
    T_world_imu, velocity, gyro_bias, accel_bias
        (N, 4, 4) and (N, 3): the truth.
    still
        (N,) inside a stop.
    """

    calibration: Calibration
    image_stamps_ns: IntArray
    imu: ImuBatch
    observations: list[Observations]
    T_world_imu: FloatArray
    velocity: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    still: BoolArray


def record_features(
    platform: Platform,
    duration_s: float,
    rng: np.random.Generator,
    *,
    noise: bool = True,
    stops_s: tuple[tuple[float, float], ...] = (),
    outlier_share: float = 0.0,
    image_offset_ns: int = 0,
) -> FeatureRecording:
    """Drive a random route of ``platform`` and record 10 images a second.

    Parameters
    ----------
    noise
        Pixel noise, IMU noise and IMU biases; without, all measurements are exact.
    stops_s
        (begin, end) of standstills, seconds after the first image.
    outlier_share
        Of the tracks.
    image_offset_ns
        How far the images lie off the IMU's sampling grid.
    """
    trajectory = make_route(platform.vehicle, duration_s, rng, stops_s=stops_s)
    images = np.arange(round(duration_s * NANOSECONDS / _IMAGE_NS)) * _IMAGE_NS
    step_ns = NANOSECONDS // platform.imu_rate_hz
    first = int(trajectory.span_ns[0]) + NANOSECONDS // 2
    grid = np.arange(-_IMU_MARGIN, int(images[-1]) // step_ns + 1 + _IMU_MARGIN) * step_ns
    imu = synthesize_imu(
        trajectory,
        first + grid,
        MEMS_NOISE if noise else None,
        rng,
        gyro_bias=rng.normal(0.0, _GYRO_BIAS, 3) if noise else None,
        accel_bias=rng.normal(0.0, _ACCEL_BIAS, 3) if noise else None,
    )
    model = replace(
        platform.features,
        outlier_share=outlier_share,
        pixel_noise_px=platform.features.pixel_noise_px if noise else 0.0,
    )
    stamps = first + images + image_offset_ns
    seconds = images / NANOSECONDS
    truth = trajectory.sample(stamps)
    at_image = np.searchsorted(imu.batch.stamps_ns, stamps)
    return FeatureRecording(
        Calibration(platform.camera, platform.T_imu_cam, MEMS_NOISE),
        stamps,
        imu.batch,
        simulate_features(trajectory, stamps, platform.camera, platform.T_imu_cam, model, rng),
        truth.T_world_imu,
        truth.velocity,
        imu.gyro_bias[at_image],
        imu.accel_bias[at_image],
        np.any([(seconds >= a) & (seconds <= z) for a, z in stops_s], axis=0)
        if stops_s
        else np.zeros(len(stamps), dtype=bool),
    )
