"""The configuration's models: every field with its unit, meaning and bounds.

This module imports neither numpy nor OpenCV: the command line reads the configuration first, so
that the thread counts can be set before those libraries are loaded.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from p2gd_fgo.config.base import Model, Positive, Vector3
from p2gd_fgo.config.features import DistributionConfig, FrontendConfig, PriorsConfig

Row4 = tuple[float, float, float, float]
Seconds = Annotated[float, Field(ge=0, le=1e9)]


class DatasetConfig(Model):
    """Which recording, and which part of it."""

    path: str | None = Field(None, description="of the recording: a folder or a bag")
    format: Literal["auto", "asl", "kaist", "kitti_raw", "bag", "tum"] = Field(
        "auto",
        description="auto: guessed from the path; asl: EuRoC, TUM-VI; bag: ROS 1, ROS 2, MCAP; "
        "see docs/datasets.md",
    )
    camera: str = Field(
        "cam0",
        min_length=1,
        max_length=100,
        description="folder of the camera, or its key in the calibration; bag: the key",
    )
    calibration: str | None = Field(
        None,
        description="file or folder of Kalibr, OpenVINS or ASL YAML; null: the recording's own (a "
        "relative path starts at the working directory)",
    )
    image_topic: str | None = Field(None, description="bag: of the camera; null: the only one")
    imu_topic: str | None = Field(None, description="bag: of the IMU; null: the only one")
    truth_topic: str | None = Field(
        None, description="bag: of odometry or poses; null: the only one; none: no truth"
    )
    T_truth_imu: tuple[Row4, Row4, Row4, Row4] | None = Field(
        None,
        description="bag, tum: takes IMU points to the frame whose poses the truth holds; null: "
        "they are the IMU's",
    )
    start_s: Seconds = Field(0.0, description="skip this much at the start")
    duration_s: Annotated[float, Field(gt=0, le=1e9)] | None = Field(
        None, description="use this much; null: to the end"
    )
    time_offset_s: float | None = Field(
        None, description="t_imu = t_cam + offset; null: the recording's own, or 0"
    )
    mask: str | None = Field(
        None, description="grey image of the camera's size; features only where it is not 0"
    )
    masks: str | None = Field(
        None,
        description="folder of one mask per image, named as the images; features only where it "
        "is not 0 (a relative path starts at the recording)",
    )


class ImuConfig(Model):
    """Noise of the IMU (continuous-time densities) and gravity."""

    gyro_noise_density: Positive | None = Field(
        None, description="rad/s/sqrt(Hz); null: the recording's calibration"
    )
    gyro_random_walk: Positive | None = Field(
        None, description="rad/s²/sqrt(Hz); null: the recording's calibration"
    )
    accel_noise_density: Positive | None = Field(
        None, description="m/s²/sqrt(Hz); null: the recording's calibration"
    )
    accel_random_walk: Positive | None = Field(
        None, description="m/s³/sqrt(Hz); null: the recording's calibration"
    )
    inflation: Positive = Field(1.0, description="factor on all four densities")
    gyro_correlation_s: Positive | None = Field(
        None,
        description="the bias is a first-order Gauss-Markov process of this time constant, driven "
        "by the random walk's density; null: a random walk",
    )
    accel_correlation_s: Positive | None = Field(None, description="as gyro_correlation_s")
    gravity: Positive = Field(9.81, description="m/s², the world's z axis points up")
    latitude_deg: Annotated[float, Field(ge=-90, le=90)] | None = Field(
        None, description="take the Earth's rotation out, felt at this latitude; null: leave it in"
    )
    heading_deg: Annotated[float, Field(ge=-180, le=180)] = Field(
        0.0, description="of the world's x axis, from east to north, for latitude_deg"
    )
    max_gap_s: Positive = Field(
        0.1,
        description="a longer time without samples is a hole: recorded as an event, and what "
        "happened in it is uncertain by the two following",
    )
    gap_sigma_accel: Positive = Field(
        2.0, description="m/s², 1 sigma, of the acceleration in a hole against a straight line"
    )
    gap_sigma_rate_deg: Positive = Field(
        60.0, description="deg/s, 1 sigma, of the rotation rate in a hole against a straight line"
    )


class StaticStartConfig(Model):
    """Start from standing still: gravity gives the tilt, the gyro its bias."""

    window_s: Positive = Field(1.0, description="length of standstill needed")
    max_wait_s: Positive = Field(20.0, description="refuse the recording after this long")
    sigma_yaw_deg: Positive = Field(0.1, description="1 sigma (a free choice of the frame)")
    sigma_position: Positive = Field(0.01, description="m, 1 sigma (a free choice of the frame)")
    sigma_velocity: Positive = Field(0.02, description="m/s, 1 sigma")
    sigma_gyro_bias: Positive = Field(0.001, description="rad/s, 1 sigma, of the gyro's mean")
    sigma_accel_bias: Positive = Field(
        0.1, description="m/s², 1 sigma; with gravity's direction it decides roll and pitch"
    )
    sigma_gravity: Positive = Field(0.02, description="m/s², 1 sigma, of the accelerometer's mean")


class DynamicStartConfig(Model):
    """Start in motion: images and IMU of a window explain each other."""

    min_window_s: Positive = Field(4.0, description="shortest stretch of data to try")
    max_window_s: Positive = Field(5.0, description="longest; older data is forgotten")
    every_s: Positive = Field(0.5, description="between two tries")
    max_images: int = Field(25, ge=5, le=200, description="of a window, evenly spread")
    max_wait_s: Positive = Field(20.0, description="refuse the recording after this long")
    min_tracks: int = Field(30, ge=8, description="seen twice or more in the window")
    sigma_gyro_bias: Positive = Field(0.1, description="rad/s, 1 sigma, before anything was seen")
    sigma_accel_bias: Positive = Field(0.1, description="m/s², 1 sigma, before anything was seen")
    min_gyro_noise: Positive = Field(
        2e-3, description="rad/s/√Hz; the gyro counts as no better: vibration, scale, alignment"
    )
    sigma_extrinsic_deg: Positive = Field(
        0.5, description="1 sigma of the rotation between camera and IMU, estimated too"
    )
    max_speed_sigma: Positive = Field(
        0.05, description="share of the speed: 1 sigma of speed and scale; larger: wait for more"
    )
    patience_s: Positive = Field(4.5, description="from then on late_speed_sigma holds")
    late_speed_sigma: Positive = Field(0.3, description="max_speed_sigma after patience_s")
    still_speed_sigma: Positive = Field(
        0.05, description="m/s; a 1 sigma below this is small enough at any speed"
    )
    max_tilt_sigma_deg: Positive = Field(1.0, description="1 sigma of roll and pitch")
    max_bias_sigmas: Positive = Field(4.0, description="biases beyond this many sigmas: no start")
    max_residual: Positive = Field(
        2.0, description="RMS of pixel and IMU residuals, in their standard deviations"
    )
    min_inliers: Annotated[float, Field(gt=0, le=1)] = Field(
        0.6, description="share of the sightings that agree with the motion"
    )
    sigma_yaw_deg: Positive = Field(0.1, description="1 sigma (a free choice of the frame)")
    sigma_position: Positive = Field(0.01, description="m, 1 sigma (a free choice of the frame)")

    @model_validator(mode="after")
    def _ordered(self) -> DynamicStartConfig:
        if self.min_window_s > self.max_window_s:
            raise ValueError(
                f"min_window_s is {self.min_window_s:g}, but max_window_s {self.max_window_s:g}: "
                "give at most that"
            )
        return self


class GivenStartConfig(Model):
    """Start from a known state, as in the paper."""

    source: Literal["truth", "config"] = Field("truth", description="where the state comes from")
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m, source: config")
    rotation_vector: Vector3 = Field((0.0, 0.0, 0.0), description="rad, world from IMU")
    velocity: Vector3 = Field((0.0, 0.0, 0.0), description="m/s in the world, source: config")
    gyro_bias: Vector3 | None = Field(
        None, description="rad/s; null: from truth where it has one, else 0"
    )
    accel_bias: Vector3 | None = Field(
        None, description="m/s²; null: from truth where it has one, else 0"
    )
    sigma_tilt_deg: Positive = Field(0.2, description="roll and pitch, 1 sigma")
    sigma_yaw_deg: Positive = Field(0.1, description="1 sigma (a free choice of the frame)")
    sigma_position: Positive = Field(0.01, description="m, 1 sigma (a free choice of the frame)")
    sigma_velocity: Positive = Field(0.05, description="m/s, 1 sigma")
    sigma_gyro_bias: Positive = Field(0.002, description="rad/s, 1 sigma")
    sigma_accel_bias: Positive = Field(0.02, description="m/s², 1 sigma")
    loosening: Annotated[float, Field(ge=1)] = Field(
        5.0, description="factor on the sigma of what truth doesn't give and is derived or guessed"
    )
    noise: bool = Field(
        False, description="draw the start's error from these sigmas, by seed and recording"
    )


class InitializationConfig(Model):
    """How the estimator is started."""

    kind: Literal["auto", "static", "dynamic", "given"] = Field(
        "static",
        description="static: from a standstill; dynamic: in motion; auto: static if still, dynamic "
        "if moving; given: from truth or config",
    )
    static: StaticStartConfig = StaticStartConfig()
    dynamic: DynamicStartConfig = DynamicStartConfig()
    given: GivenStartConfig = GivenStartConfig()


class StationaryConfig(Model):
    """When the body counts as standing still: the IMU and the image must both say so."""

    enabled: bool = Field(True, description="detect standing still while running")
    window_s: Positive = Field(0.5, description="IMU samples and images looked at")
    max_gyro_std: Positive = Field(0.01, description="rad/s, standard deviation in the window")
    max_accel_std: Positive = Field(0.15, description="m/s², standard deviation in the window")
    max_disparity_px: Positive = Field(
        0.5, description="a feature that moved by less across the window stays where it is"
    )
    share_to_stop: Annotated[float, Field(gt=0, le=1)] = Field(
        0.5, description="of the features must stay for a standstill to begin"
    )
    share_to_stay: Annotated[float, Field(gt=0, le=1)] = Field(
        0.25, description="of the features must stay for it to go on, whatever drives by"
    )
    max_drift_px: Positive = Field(
        0.15,
        description="across the window, of what the features that stay have in common (shift, "
        "growth of the image): more is a body that creeps",
    )
    min_features: int = Field(10, ge=1, description="features needed for these tests")
    hold_after_s: Positive | None = Field(
        3.0, description="of standing, then the reported position stays; null: it may creep"
    )


class SmootherConfig(Model):
    """The GTSAM fixed-lag smoother."""

    iterations: int = Field(2, ge=1, le=20, description="Gauss-Newton steps a frame at most")
    step_tolerance: Positive = Field(
        0.2, description="stop after a step below this many standard deviations (RMS over states)"
    )
    landmark_distance: Positive = Field(
        75.0, description="m; farther points show too little parallax in a window to be used"
    )
    outlier_px: Positive = Field(
        5.0, description="a track with a larger reprojection error is not used"
    )
    gate_probability: Annotated[float, Field(gt=0.5, lt=1)] = Field(
        0.999, description="chi-square gate of a track, at each image and when it is marginalised"
    )
    sigma_still_velocity: Positive = Field(0.01, description="m/s, when standing still")
    sigma_still_position: Positive = Field(0.001, description="m per image, when standing still")
    sigma_still_rotation_deg: Positive = Field(
        0.02, description="degrees per image, when standing still"
    )


class MsckfConfig(Model):
    """The multi-state constraint Kalman filter."""

    fej: bool = Field(False, description="first-estimate Jacobians; off for cars, as in the paper")
    look_ahead: bool = Field(
        True,
        description="linearise where tracks that are not due yet put the images; not with fej",
    )
    min_track_length: int = Field(3, ge=2, description="sightings; shorter tracks are not used")
    refinement_steps: int = Field(
        3, ge=0, le=20, description="of Gauss-Newton on each point, after the linear solution"
    )
    max_condition: Positive = Field(
        100000.0, description="of a point's linear triangulation; its rays are too parallel beyond"
    )
    landmark_distance: Positive = Field(
        75.0, description="m; farther points show too little parallax in a window to be used"
    )
    outlier_px: Positive = Field(
        5.0, description="a track with a larger reprojection error is not used"
    )
    gate_probability: Annotated[float, Field(gt=0.5, lt=1)] = Field(
        0.999, description="chi-square gate of a track"
    )
    sigma_still_velocity: Positive = Field(0.01, description="m/s, when standing still")
    sigma_still_position: Positive = Field(0.001, description="m per image, when standing still")
    sigma_still_rotation_deg: Positive = Field(
        0.02, description="degrees per image, when standing still"
    )


class BackendConfig(Model):
    """The estimator behind the front end."""

    kind: Literal["smoother", "msckf", "dead_reckoning"] = Field(
        "smoother",
        description="smoother: GTSAM fixed-lag; msckf: Kalman filter; dead_reckoning: IMU alone",
    )
    window: int = Field(20, ge=3, le=200, description="images in the sliding window")
    pixel_noise_px: Positive = Field(1.0, description="1 sigma of a feature's position")
    smoother: SmootherConfig = SmootherConfig()
    msckf: MsckfConfig = MsckfConfig()


class EvaluationConfig(Model):
    """How a run is judged against truth."""

    alignment: Literal["yaw_pos", "se3", "sim3", "origin"] = Field(
        "yaw_pos", description="of the main ATE and ARE; the others are printed beside it"
    )
    rte_lengths_m: tuple[Positive, ...] = Field(
        (1.0, 2.0, 10.0, 50.0, 100.0, 200.0),
        description="segment lengths of RTE and RRE, on the reference's path; those that fit",
    )
    rte_tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.1, description="a pair may miss its length by this share"
    )


class RuntimeConfig(Model):
    """Threads and seed."""

    threads: int = Field(1, ge=1, le=256, description="of OpenCV, BLAS and OpenMP")
    seed: int = Field(0, ge=0, description="varies what a rerun would vary")


class Config(Model):
    """All of a run."""

    name: str | None = Field(
        None, pattern=r"^[^./\\][^/\\]*$", description="of the run; null: the recording's folder"
    )
    dataset: DatasetConfig = DatasetConfig()
    imu: ImuConfig = ImuConfig()
    frontend: FrontendConfig = FrontendConfig()
    distribution: DistributionConfig = DistributionConfig()
    priors: PriorsConfig = PriorsConfig()
    initialization: InitializationConfig = InitializationConfig()
    stationary: StationaryConfig = StationaryConfig()
    backend: BackendConfig = BackendConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    runtime: RuntimeConfig = RuntimeConfig()

    @model_validator(mode="after")
    def _tracks_fit_the_window(self) -> Config:
        length = self.frontend.max_track_length
        if length is not None and length > self.backend.window:
            raise ValueError(
                f"frontend.max_track_length is {length}, but backend.window holds only "
                f"{self.backend.window} images: give at most that"
            )
        return self
