"""Builds the source of prior poses that the configuration names."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.priors.base import PriorSource
from p2gd_fgo.priors.constant_velocity import ConstantVelocityPriors
from p2gd_fgo.priors.image_times import ImageTimes
from p2gd_fgo.priors.recorded import RecordedPriors, with_white_noise
from p2gd_fgo.priors.resampling import at_stamps
from p2gd_fgo.trajectory_files import read_tum
from p2gd_fgo.types import NANOSECONDS, IntArray, PriorPoses, Trajectory, Truth
from p2gd_fgo.user_paths import user_path

_NOISE_STREAM = 2  # beside the streams that the same seed feeds elsewhere


class NoPriors:
    """Nothing of its own: no planner, or one that hands poses in with the images."""

    independent = True

    def __init__(self, image_times: ImageTimes, description: str) -> None:
        self.image_times = image_times
        self.description = description

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        """Nothing."""
        return None


def make_prior_source(
    config: PriorsConfig,
    horizon: int,
    *,
    truth: Truth | None,
    image_stamps_ns: IntArray | None,
    seed: int,
) -> PriorSource:
    """Build ``config.source``.

    Parameters
    ----------
    horizon
        Images ahead.
    truth
        For ``truth`` and ``noisy_truth``; ``auto`` takes it where it exists.
    image_stamps_ns
        All images of the recording, on the IMU's clock; None where they are not known beforehand.
    seed
        Draws the noise.

    Raises
    ------
    ConfigError
        ``truth`` or ``noisy_truth`` without a truth or beforehand unknown images; ``file``
        without a file.
    DataError
        The file can't be read, or its time doesn't overlap the images'.
    """
    times = ImageTimes(image_stamps_ns)
    recorded = truth is not None and image_stamps_ns is not None
    name = config.source
    if name == "auto":
        name = "truth" if recorded else "constant_velocity"
    if name == "constant_velocity":
        return ConstantVelocityPriors(times, horizon)
    if name == "stream":
        return NoPriors(times, "handed in with the images")
    if name == "none":
        return NoPriors(times, "none")
    if name == "file":
        path = _file(config)
        planned = read_tum(path)
        _check_overlap(path, planned, image_stamps_ns)
        return RecordedPriors(_at(planned, image_stamps_ns), times, horizon, f"file {path}")
    if truth is None or image_stamps_ns is None:
        raise ConfigError(
            f"priors.source is '{name}', but there is no recording with truth: take "
            "'constant_velocity', 'file' or 'stream'"
        )
    trajectory, description = at_stamps(truth.trajectory, image_stamps_ns), "truth"
    if name == "noisy_truth":
        sigmas = config.position_noise, config.yaw_noise_deg
        rng = np.random.default_rng([seed, _NOISE_STREAM])
        trajectory = with_white_noise(trajectory, *sigmas, rng)
        description = f"truth + {sigmas[0]:g} m, {sigmas[1]:g}° white noise"
    return RecordedPriors(trajectory, times, horizon, description)


def _file(config: PriorsConfig) -> Path:
    if config.file is None:
        raise ConfigError("priors.source is 'file', but priors.file is null: name a TUM trajectory")
    return user_path(config.file, "priors.file")


def _check_overlap(path: Path, planned: Trajectory, image_stamps_ns: IntArray | None) -> None:
    if image_stamps_ns is None or len(image_stamps_ns) == 0:
        return
    first, last = planned.stamps_ns[[0, -1]].tolist()
    begin, end = image_stamps_ns[[0, -1]].tolist()
    if last <= begin or first >= end:
        raise DataError(
            f"priors.file {path}: its poses ({first / NANOSECONDS:.3f} to "
            f"{last / NANOSECONDS:.3f} s) and the images ({begin / NANOSECONDS:.3f} to "
            f"{end / NANOSECONDS:.3f} s) don't overlap in time: shift its stamps to the IMU's clock"
        )


def _at(trajectory: Trajectory, image_stamps_ns: IntArray | None) -> Trajectory:
    """Interpolated once for all images where these are known, else at every image."""
    return trajectory if image_stamps_ns is None else at_stamps(trajectory, image_stamps_ns)
