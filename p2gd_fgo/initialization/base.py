"""What every way of starting looks like to the odometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from p2gd_fgo.errors import InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.types import FloatArray, ImuBatch, NavState, Waiting


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """A first state and its error covariance (15, 15); ``note`` says in words how it was found."""

    state: NavState
    covariance: FloatArray
    note: str


class Initializer(Protocol):
    """Asked at every image until it gives a start."""

    def attempt(self, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer) -> Start | Waiting:
        """Start at this image if possible.

        Parameters
        ----------
        stamp_ns
            Time of the image on the IMU's clock.
        imu
            The samples held, up to at least the image.
        buffer
            Features up to the image.

        Raises
        ------
        InitializationError
            The recording is refused; the message gives the value and the threshold.
        """
        ...

    def refusal(self) -> InitializationError:
        """Why the recording ended without a start."""
        ...
