"""What every recording looks like to the pipeline."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import NANOSECONDS, Event, FloatArray, Image, ImuBatch, IntArray, Truth


@dataclass(frozen=True, slots=True)
class ImuNoise:
    """Continuous-time noise densities of an IMU.

    Attributes
    ----------
    gyro_noise_density
        rad/s/√Hz.
    gyro_random_walk
        rad/s²/√Hz, of the bias.
    accel_noise_density
        m/s²/√Hz.
    accel_random_walk
        m/s³/√Hz, of the bias.
    gyro_correlation_s, accel_correlation_s
        Time constant of a first-order Gauss-Markov bias, which is pulled back to zero; infinite: a
        random walk.
    """

    gyro_noise_density: float
    gyro_random_walk: float
    accel_noise_density: float
    accel_random_walk: float
    gyro_correlation_s: float = math.inf
    accel_correlation_s: float = math.inf

    @property
    def biases_walk(self) -> bool:
        """Whether neither bias is pulled back."""
        return math.isinf(self.gyro_correlation_s) and math.isinf(self.accel_correlation_s)

    def bias_decay(self, duration_s: float) -> tuple[float, float]:
        """Share of the gyro's and of the accelerometer's bias that is left after ``duration_s``."""
        return (
            math.exp(-duration_s / self.gyro_correlation_s),
            math.exp(-duration_s / self.accel_correlation_s),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The sensors of a recording.

    Attributes
    ----------
    camera
        Intrinsics and distortion.
    T_imu_cam
        (4, 4) takes camera points to the IMU frame.
    imu_noise
        Densities, or None where the recording doesn't say.
    time_offset_s
        t_imu = t_cam + offset.
    """

    camera: Camera
    T_imu_cam: FloatArray
    imu_noise: ImuNoise | None
    time_offset_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class EncodedImage:
    """A picture as the recording holds it: ``data`` of a file with this ``suffix`` (``.png``)."""

    data: bytes
    suffix: str


@runtime_checkable
class KeepsEncodedImages(Protocol):
    """A recording that can hand out its images as they are, without decoding them."""

    def encoded_image(self, index: int) -> EncodedImage | None:
        """Image ``index`` as a PNG or JPEG whose decoding gives ``image(index)``, or None.

        Raises
        ------
        DataError
            It can't be read.
        """
        ...


class Sequence(Protocol):
    """A recording: stamps, IMU and truth in memory, images read one at a time."""

    @property
    def name(self) -> str:
        """Short name for tables."""
        ...

    @property
    def calibration(self) -> Calibration:
        """The sensors."""
        ...

    @property
    def image_stamps_ns(self) -> IntArray:
        """(N,) strictly increasing, on the camera's clock."""
        ...

    @property
    def imu(self) -> ImuBatch:
        """All samples, strictly increasing in time."""
        ...

    @property
    def truth(self) -> Truth | None:
        """The reference, in the IMU frame, or None."""
        ...

    @property
    def events(self) -> tuple[Event, ...]:
        """What was mended while reading (duplicates dropped and the like)."""
        ...

    def image(self, index: int) -> Image:
        """Decode image ``index`` as (H, W) grey.

        Raises
        ------
        DataError
            The file is missing or can't be decoded.
        """
        ...

    def mask(self, index: int) -> Image | None:
        """Decode the mask of image ``index``, (H, W): features only where it isn't 0.

        None where the recording was opened without masks, or this image has none.

        Raises
        ------
        DataError
            The file can't be decoded or is of another size than the image.
        """
        ...


def stamps_on_imu_clock(sequence: Sequence, time_offset_s: float | None = None) -> IntArray:
    """Stamps (N,) of the images on the IMU's clock: t_imu = t_cam + offset.

    Parameters
    ----------
    time_offset_s
        ``dataset.time_offset_s``; None: the calibration's.
    """
    offset_s = sequence.calibration.time_offset_s if time_offset_s is None else time_offset_s
    return sequence.image_stamps_ns + round(offset_s * NANOSECONDS)
