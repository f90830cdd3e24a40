"""Builds the back end that the configuration names."""

from __future__ import annotations

import math

from p2gd_fgo.backends.base import Backend
from p2gd_fgo.backends.dead_reckoning import DeadReckoning
from p2gd_fgo.backends.msckf import Msckf
from p2gd_fgo.backends.smoother import Smoother
from p2gd_fgo.config import Config
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.timing import StageTimer


def make_backend(config: Config, calibration: Calibration, timer: StageTimer) -> Backend:
    """Build ``config.backend.kind`` with the recording's calibration.

    Raises
    ------
    ConfigError
        Neither the recording nor the configuration gives the IMU's noise.
    """
    noise = imu_noise(config, calibration)
    if config.backend.kind == "dead_reckoning":
        return DeadReckoning(noise, config.imu.gravity)
    if config.backend.kind == "msckf":
        return Msckf(calibration, noise, config.imu.gravity, config.backend, timer)
    return Smoother(calibration, noise, config.imu.gravity, config.backend, timer)


def imu_noise(config: Config, calibration: Calibration) -> ImuNoise:
    """Noise by the configuration, else by the recording, with the inflation factor.

    Raises
    ------
    ConfigError
        A density is given nowhere.
    """
    names = (
        "gyro_noise_density", "gyro_random_walk", "accel_noise_density", "accel_random_walk",
    )  # fmt: skip
    values = []
    for name in names:
        value = getattr(config.imu, name)
        if value is None and calibration.imu_noise is not None:
            value = getattr(calibration.imu_noise, name)
        if value is None:
            raise ConfigError(
                f"imu.{name} is not known: the recording's calibration does not give it, so set it"
            )
        values.append(value * config.imu.inflation)
    times = (config.imu.gyro_correlation_s, config.imu.accel_correlation_s)
    return ImuNoise(*values, *(math.inf if time is None else time for time in times))
