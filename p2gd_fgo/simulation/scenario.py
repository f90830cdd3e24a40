"""What a simulated recording is made of: typed, frozen, and enough to make it again bit for bit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from p2gd_fgo.config.base import Model, NonNegative, Positive, Vector3

Share = Annotated[float, Field(ge=0, le=1)]
Pair = tuple[NonNegative, NonNegative]


class WorldScenario(Model):
    """Where the drive takes place."""

    kind: Literal["city", "campus", "courtyard"] = Field("city", description="builder of the world")
    seed: int | None = Field(None, ge=0, description="null: the scenario's seed")
    block_m: tuple[Positive, Positive] = Field(
        (65.0, 110.0), description="m, shortest and longest way between two crossings"
    )
    open_share: Share = Field(0.12, description="share of the street sides without houses")
    contrast: Positive = Field(
        1.0, le=2.0, description="of all textures; below 1 they fade towards their mean"
    )
    sun: NonNegative = Field(0.65, le=2.0, description="brightness that the sun adds")
    sky: tuple[Positive, Positive] = Field(
        (215.0, 175.0), description="grey level at the horizon and at the zenith"
    )
    ambient: Positive = Field(1.0, le=2.0, description="factor on the light from the sky")
    detail: Positive = Field(
        1.0, le=2.0, description="factor on the textures' resolution, 0.5 for small images"
    )

    @model_validator(mode="after")
    def _ordered(self) -> WorldScenario:
        if self.block_m[0] > self.block_m[1]:
            raise ValueError(f"block_m {self.block_m} runs from long to short: swap the two")
        if self.block_m[0] < 8.0:
            raise ValueError(f"block_m starts at {self.block_m[0]:g} m: give at least 8 m")
        return self


class TrafficScenario(Model):
    """What moves beside the camera's own vehicle."""

    leading: bool = Field(False, description="a car ahead in the own lane")
    cars_per_min: NonNegative = Field(0.0, le=120.0, description="oncoming and crossing cars")
    people: int = Field(0, ge=0, le=200, description="walking along the route")
    occluders_per_min: NonNegative = Field(
        0.0, le=30.0, description="carts and boards pushed across, close before the camera"
    )


class VehicleScenario(Model):
    """What carries the camera, and how it is driven."""

    kind: Literal["car", "robot"] = Field("car", description="size and suspension")
    speed: tuple[Positive, Positive] = Field(
        (7.0, 12.0), description="m/s, slowest and fastest wanted speed between turns"
    )
    acceleration: Positive = Field(1.8, le=10.0, description="m/s², at most")
    lateral_acceleration: Positive = Field(2.2, le=10.0, description="m/s², at most, in turns")
    turn_rate_deg: Positive = Field(30.0, le=180.0, description="deg/s, at most")
    turn_radius_m: Positive = Field(9.0, le=60.0, description="m, of a turn at a crossing")
    turn_share: Share = Field(0.55, description="share of the crossings where it turns")
    lane_changes: Share = Field(0.3, description="share of the blocks with a change of lane")
    standstill_s: NonNegative = Field(2.0, description="before the drive")
    stop_every_m: float | None = Field(None, ge=1.0, description="m, mean way between stops")
    stop_s: tuple[Positive, Positive] = Field((2.0, 6.0), description="length of the stops")
    sway: NonNegative = Field(1.0, le=5.0, description="factor on roll, pitch and heave")
    imu_height_m: Positive = Field(1.7, le=10.0, description="m, over the ground")

    @model_validator(mode="after")
    def _ordered(self) -> VehicleScenario:
        for name in ("speed", "stop_s"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} ({low:g}, {high:g}) runs from high to low: swap the two")
        if self.speed[1] > 40.0:
            raise ValueError(f"speed {self.speed[1]:g} m/s is too fast: give at most 40 m/s")
        return self


class RouteScenario(Model):
    """A drive from the seed, or one that was recorded."""

    file: str | None = Field(
        None, description="TUM or EuRoC csv with poses of the IMU; a relative path starts at the "
        "scenario's file"
    )  # fmt: skip
    sha256: str | None = Field(None, description="of the file, written with the recording")
    start_s: NonNegative = Field(0.0, description="skip this much of the file")
    smooth_s: Positive = Field(0.15, le=5.0, description="1 sigma of the smoothing in time")
    level: bool = Field(True, description="take out hills: the worlds are flat")


class CameraScenario(Model):
    """The lens, where it sits, and what it does to the picture."""

    rate_hz: int = Field(10, ge=1, le=100, description="images a second")
    width: int = Field(1280, ge=32, le=4096, description="px")
    height: int = Field(560, ge=32, le=4096, description="px")
    focal: tuple[Positive, Positive] = Field((816.90379, 811.56804), description="px, fx and fy")
    center: Pair = Field((608.50726, 263.476), description="px, cx and cy")
    distortion: tuple[float, ...] = Field(
        (-0.056143028, 0.13952563, -0.0012155907, -0.00097281390),
        min_length=4, max_length=5, description="radtan k1 k2 p1 p2 [k3]",
    )  # fmt: skip
    position: Vector3 = Field((1.71, 0.25, -0.12), description="m, in the IMU's frame")
    tilt_deg: float = Field(0.0, ge=-85, le=85, description="looking down is positive")
    turn_deg: float = Field(0.0, ge=-180, le=180, description="looking left is positive")
    noise_sigma: NonNegative = Field(2.0, le=50.0, description="grey levels, of each pixel")
    shot_noise: NonNegative = Field(0.0, le=5.0, description="variance added per grey level")
    vignetting: Share = Field(0.15, description="loss of light in the corners")
    exposure_ms: NonNegative = Field(0.0, le=100.0, description="shutter time: motion blur")
    exposure_swing: Share = Field(0.0, description="slow changes of the brightness, +- this share")
    exposure_gain: Positive = Field(1.0, le=10.0, description="factor on the brightness")
    depth_every_px: int | None = Field(
        None, ge=4, description="px; also write the true depth at the pixels of such a lattice"
    )

    @model_validator(mode="after")
    def _fits(self) -> CameraScenario:
        if not (self.center[0] < self.width and self.center[1] < self.height):
            raise ValueError(
                f"center {self.center} lies outside the {self.width} x {self.height} image"
            )
        return self


class ImuScenario(Model):
    """The IMU's errors. None of them changes an image."""

    rate_hz: int = Field(100, ge=10, le=1000, description="samples a second")
    seed: int | None = Field(None, ge=0, description="null: the scenario's seed")
    gyro_noise_density: NonNegative = Field(1.7453e-4, description="rad/s/sqrt(Hz)")
    gyro_random_walk: NonNegative = Field(1.0e-5, description="rad/s²/sqrt(Hz)")
    accel_noise_density: NonNegative = Field(5.886e-3, description="m/s²/sqrt(Hz)")
    accel_random_walk: NonNegative = Field(1.0e-4, description="m/s³/sqrt(Hz)")
    gyro_bias_sigma: NonNegative = Field(0.003, description="rad/s, 1 sigma at the start")
    accel_bias_sigma: NonNegative = Field(0.03, description="m/s², 1 sigma at the start")
    bias_model: Literal["walk", "gauss_markov"] = Field(
        "walk", description="walk: without end; gauss_markov: pulled back to zero"
    )
    gyro_correlation_s: Positive = Field(300.0, description="gauss_markov: time constant")
    accel_correlation_s: Positive = Field(300.0, description="gauss_markov: time constant")
    earth_rotation: bool = Field(False, description="the gyro and the accelerometer feel it")
    latitude_deg: float = Field(37.0, ge=-90, le=90, description="for earth_rotation")
    heading_deg: float = Field(
        0.0, ge=-180, le=180, description="for earth_rotation: of the world's x axis, from east "
        "to north"
    )  # fmt: skip
    gyro_scale_error: float = Field(0.0, ge=-0.5, le=0.5, description="1 sigma of each axis")
    accel_scale_error: float = Field(0.0, ge=-0.5, le=0.5, description="1 sigma of each axis")
    misalignment_deg: NonNegative = Field(0.0, le=10.0, description="1 sigma of each axis pair")
    time_offset_s: float = Field(
        0.0, ge=-0.5, le=0.5, description="t_imu = t_cam + offset, put into the images' stamps"
    )
    time_offset_known: bool = Field(True, description="write the offset into the calibration")
    max_rate_deg: Positive | None = Field(None, description="deg/s, where the gyro saturates")
    max_force: Positive | None = Field(None, description="m/s², where the accelerometer saturates")


class Scenario(Model):
    """One simulated recording."""

    name: str = Field("", description="for tables")
    seed: int = Field(0, ge=0, description="of everything that has no seed of its own")
    duration_s: Positive = Field(60.0, le=7200.0, description="from the first to the last image")
    world: WorldScenario = WorldScenario()
    traffic: TrafficScenario = TrafficScenario()
    vehicle: VehicleScenario = VehicleScenario()
    route: RouteScenario = RouteScenario()
    camera: CameraScenario = CameraScenario()
    imu: ImuScenario = ImuScenario()

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        if self.imu.rate_hz % self.camera.rate_hz:
            raise ValueError(
                f"imu.rate_hz {self.imu.rate_hz} is no multiple of camera.rate_hz "
                f"{self.camera.rate_hz}: choose one"
            )
        if self.duration_s * self.camera.rate_hz < 2:
            raise ValueError(f"duration_s {self.duration_s:g} holds less than two images")
        if self.vehicle.imu_height_m + self.camera.position[2] < 0.1:
            raise ValueError(
                f"camera.position {self.camera.position[2]:g} m below an IMU at "
                f"{self.vehicle.imu_height_m:g} m puts the camera into the ground"
            )
        return self
