"""The IMU samples of a run, cut at its images: what leads from one image to the next."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import ImuConfig
from p2gd_fgo.errors import DataError
from p2gd_fgo.imu import (
    ImuBuffer,
    UnknownMotion,
    across_holes,
    between,
    earth_rate,
    has_hole,
    rotation_over,
    without_earth_rotation,
)
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch, NavState


class ImuIntake:
    """Takes samples as they arrive and hands out intervals between images.

    Parameters
    ----------
    config
        Holes, gravity, and the Earth's rotation.
    history_s
        Samples as old as this are kept for those who look back.
    """

    def __init__(self, config: ImuConfig, history_s: float) -> None:
        self._config = config
        self._buffer = ImuBuffer()
        self._history_ns = round(history_s * NANOSECONDS)
        latitude_deg = config.latitude_deg
        self._earth_rate = (
            None if latitude_deg is None else earth_rate(latitude_deg, config.heading_deg)
        )
        self._last_ns: int | None = None
        self._tracked_ns: int | None = None

    def add(self, imu: ImuBatch) -> None:
        """Append samples.

        Raises
        ------
        DataError
            Not finite or not increasing in time.
        """
        self._buffer.add(imu)

    def samples(self) -> ImuBatch:
        """Everything held, as it was measured."""
        return self._buffer.samples()

    def interval(
        self, stamp_ns: int, state: NavState | None
    ) -> tuple[ImuBatch | None, UnknownMotion | None]:
        """Samples from the last image to the one at ``stamp_ns``, holes in them bridged.

        Parameters
        ----------
        state
            At the last image, if it is known: the Earth's rotation is taken out with it.

        Returns
        -------
        tuple[ImuBatch | None, UnknownMotion | None]
            None at the first image; and what is not known of the motion, where there is a hole.

        Raises
        ------
        DataError
            The samples don't reach the image, or it is not later than the last one.
        """
        held = self._buffer.samples()
        if len(held) == 0 or not held.stamps_ns[0] <= stamp_ns <= held.stamps_ns[-1]:
            raise DataError(
                f"the image at {stamp_ns} ns lies outside the IMU samples handed in: hand in the "
                "samples up to an image, and one beyond, before the image"
            )
        if self._last_ns is None:
            return None, None
        if stamp_ns <= self._last_ns:
            raise DataError(
                f"the image at {stamp_ns} ns is not later than the one before, at {self._last_ns}"
            )
        c = self._config
        imu, unknown = across_holes(
            held,
            between(held, self._last_ns, stamp_ns),
            c.max_gap_s,
            float(np.radians(c.gap_sigma_rate_deg)),
            c.gap_sigma_accel,
        )
        if state is not None and self._earth_rate is not None:
            imu = without_earth_rotation(imu, state, c.gravity, self._earth_rate)
        return imu, unknown

    def turn_since_tracked(
        self, stamp_ns: int, imu: ImuBatch | None, state: NavState | None
    ) -> FloatArray | None:
        """R_tracked_now (3, 3) of the IMU from the last tracked image to the one at ``stamp_ns``.

        None before the start: a gyro bias of some 0.1 rad/s, not yet known, points the tracker
        further away than no prediction at all. None too where the gyro missed a part of the turn.

        Parameters
        ----------
        imu
            The :meth:`interval` to this image.
        state
            The last estimate.
        """
        if imu is None or state is None or self._tracked_ns is None:
            return None
        held = self._buffer.samples()
        if self._tracked_ns != self._last_ns:  # images were skipped in between
            if int(held.stamps_ns[0]) > self._tracked_ns:
                return None
            imu = between(held, self._tracked_ns, stamp_ns)
        if has_hole(held, imu, self._config.max_gap_s):
            return None
        return rotation_over(imu, state.gyro_bias)

    def tracked(self, stamp_ns: int) -> None:
        """The image's features were tracked."""
        self._tracked_ns = stamp_ns

    def passed(self, stamp_ns: int) -> None:
        """The image has been processed: the next interval begins here."""
        self._last_ns = stamp_ns
        self._buffer.drop_before(stamp_ns - self._history_ns)
