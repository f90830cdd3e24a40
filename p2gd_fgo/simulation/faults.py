"""Recordings with something wrong in the middle, for tests and experiments.

Each function takes a recording, where the fault begins (seconds after its first image) and how
long it lasts, and returns a recording that answers the same protocol. Nothing is written to disk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from p2gd_fgo.datasets.base import Calibration, Sequence
from p2gd_fgo.datasets.integrity import increasing_order
from p2gd_fgo.types import NANOSECONDS, BoolArray, Event, Image, ImuBatch, IntArray, Truth

Repaint = Callable[[float, Image], Image]
"""From seconds since the fault's begin and an image to the image that is seen instead."""

_TEXTURE_CELL_PX = 6


@dataclass(frozen=True, slots=True, eq=False)
class FaultySequence:
    """Another recording's images in another order, some of them painted over.

    Attributes
    ----------
    base
        Where images and masks come from.
    order
        (N,) the base's index of each image.
    image_stamps_ns, imu, events
        Of this recording; see :class:`p2gd_fgo.datasets.base.Sequence`.
    span_ns
        First and last stamp of the images that ``repaint`` is asked for.
    repaint
        What is seen instead; None: the images are the base's.
    """

    base: Sequence
    order: IntArray
    image_stamps_ns: IntArray
    imu: ImuBatch
    events: tuple[Event, ...]
    span_ns: tuple[int, int] = (0, 0)
    repaint: Repaint | None = None

    @property
    def name(self) -> str:
        """The base's."""
        return self.base.name

    @property
    def calibration(self) -> Calibration:
        """The base's."""
        return self.base.calibration

    @property
    def truth(self) -> Truth | None:
        """The base's."""
        return self.base.truth

    def image(self, index: int) -> Image:
        """The base's image, painted over if the fault lasts at its time."""
        image = self.base.image(int(self.order[index]))
        stamp_ns = int(self.image_stamps_ns[index])
        if self.repaint is None or not self.span_ns[0] <= stamp_ns <= self.span_ns[1]:
            return image
        return self.repaint((stamp_ns - self.span_ns[0]) / NANOSECONDS, image)

    def mask(self, index: int) -> Image | None:
        """The base's."""
        return self.base.mask(int(self.order[index]))


def without_images(sequence: Sequence, begin_s: float, duration_s: float) -> FaultySequence:
    """No image for a while."""
    hit = _during(sequence, begin_s, duration_s)
    return _reordered(sequence, np.flatnonzero(~hit))


def black_images(sequence: Sequence, begin_s: float, duration_s: float) -> FaultySequence:
    """All pixels 0: the lens is covered, or the exposure fails."""
    return _repainted(sequence, begin_s, duration_s, lambda t, image: np.zeros_like(image))


def frozen_image(sequence: Sequence, begin_s: float, duration_s: float) -> FaultySequence:
    """A driver that hands out the same picture again and again, with new stamps."""
    hit = np.flatnonzero(_during(sequence, begin_s, duration_s))
    frozen = _reordered(sequence, np.arange(len(sequence.image_stamps_ns)))
    frozen.order[hit] = hit[0]
    return frozen


def brightness_jump(
    sequence: Sequence, begin_s: float, duration_s: float, gain: float
) -> FaultySequence:
    """All grey levels times ``gain`` from one image to the next, and back again."""

    def expose(t: float, image: Image) -> Image:
        return np.asarray(cv2.convertScaleAbs(image, alpha=gain), dtype=np.uint8)

    return _repainted(sequence, begin_s, duration_s, expose)


def passing_truck(
    sequence: Sequence, begin_s: float, duration_s: float, share: float = 0.6
) -> FaultySequence:
    """A textured wall that comes in from the right, crosses slowly and leaves to the left.

    For the middle half of the time it covers at least ``share`` of the view, and its texture moves
    as one: to the images it looks like a world that the camera moves through.
    """
    camera = sequence.calibration.camera
    height = round(0.85 * camera.height)
    width = round(share * camera.width * camera.height / height)
    wall = _texture(width, height)
    room = camera.width - width
    way = np.array([camera.width, room, 0.0, -width], dtype=np.float64)

    def cover(t: float, image: Image) -> Image:
        left = round(float(np.interp(t / duration_s, [0.0, 0.25, 0.75, 1.0], way)))
        out = image.copy()
        first, last = max(left, 0), min(left + width, camera.width)
        if first < last:
            out[camera.height - height :, first:last] = wall[:, first - left : last - left]
        return out

    return _repainted(sequence, begin_s, duration_s, cover)


def imu_hole(sequence: Sequence, begin_s: float, duration_s: float) -> FaultySequence:
    """No IMU sample for a while."""
    imu = sequence.imu
    begin_ns = int(sequence.image_stamps_ns[0]) + round(begin_s * NANOSECONDS)
    since = imu.stamps_ns - begin_ns
    keep = (since < 0) | (since > round(duration_s * NANOSECONDS))
    hole = ImuBatch(imu.stamps_ns[keep], imu.gyro[keep], imu.accel[keep])
    return replace(_reordered(sequence, np.arange(len(sequence.image_stamps_ns))), imu=hole)


def doubled_stamps(sequence: Sequence, share: float, rng: np.random.Generator) -> FaultySequence:
    """A share of IMU samples and images comes twice, mended as a reader does."""
    imu = sequence.imu
    imu_rows = _some_twice(len(imu), share, rng)
    image_rows = _some_twice(len(sequence.image_stamps_ns), share, rng)
    imu_order, imu_events = increasing_order(imu.stamps_ns[imu_rows], "imu")
    image_order, image_events = increasing_order(sequence.image_stamps_ns[image_rows], "image")
    rows = imu_rows[imu_order]
    return replace(
        _reordered(sequence, image_rows[image_order]),
        imu=ImuBatch(imu.stamps_ns[rows], imu.gyro[rows], imu.accel[rows]),
        events=(*sequence.events, *imu_events, *image_events),
    )


def shifted_stamps(sequence: Sequence, seconds: float) -> FaultySequence:
    """The camera's clock is ahead by ``seconds``, and the calibration knows nothing of it."""
    plain = _reordered(sequence, np.arange(len(sequence.image_stamps_ns)))
    return replace(plain, image_stamps_ns=plain.image_stamps_ns + round(seconds * NANOSECONDS))


def _during(sequence: Sequence, begin_s: float, duration_s: float) -> BoolArray:
    since = sequence.image_stamps_ns - sequence.image_stamps_ns[0] - round(begin_s * NANOSECONDS)
    return np.asarray((since >= 0) & (since <= round(duration_s * NANOSECONDS)))


def _reordered(sequence: Sequence, order: IntArray) -> FaultySequence:
    return FaultySequence(
        sequence, order, sequence.image_stamps_ns[order], sequence.imu, sequence.events
    )


def _repainted(
    sequence: Sequence, begin_s: float, duration_s: float, repaint: Repaint
) -> FaultySequence:
    begin_ns = int(sequence.image_stamps_ns[0]) + round(begin_s * NANOSECONDS)
    plain = _reordered(sequence, np.arange(len(sequence.image_stamps_ns)))
    span_ns = begin_ns, begin_ns + round(duration_s * NANOSECONDS)
    return replace(plain, span_ns=span_ns, repaint=repaint)


def _some_twice(count: int, share: float, rng: np.random.Generator) -> IntArray:
    times = 1 + (rng.random(count) < share)
    return np.repeat(np.arange(count), times)


def _texture(width: int, height: int) -> Image:
    """Random grey cells: corners everywhere, and the same ones every time."""
    rng = np.random.default_rng(0)
    cells = rng.integers(
        30, 226, (height // _TEXTURE_CELL_PX + 2, width // _TEXTURE_CELL_PX + 2), dtype=np.uint8
    )
    wall = cv2.resize(cells, None, fx=_TEXTURE_CELL_PX, fy=_TEXTURE_CELL_PX)
    return np.asarray(cv2.GaussianBlur(wall, (5, 5), 1.0)[:height, :width], dtype=np.uint8)
