"""Tracked points in the images looked at, and what the images themselves are like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from p2gd_fgo import datasets
from p2gd_fgo.errors import DataError
from p2gd_fgo.frontend.tracker import KltTracker
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray, Image, IntArray

_FEATURES = 200
_QUALITY = 0.01
_SPACING_SHARE = 0.02  # of the image's width
_WINDOW_PX = 21
_LEVELS = 5
_BACK_PX = 0.5
_CHAIN = 6  # images that one detection serves
_FLAT = 2.0  # grey levels of standard deviation: below it there is nothing to see
_SAME = 1e-3  # mean difference, grey levels, below which two images are one: noise alone is more


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Points seen in two images.

    Attributes
    ----------
    first, second
        Image numbers.
    stretch
        Number of the stretch.
    a, b
        (N, 2) pixels in the first and in the second.
    """

    first: int
    second: int
    stretch: int
    a: FloatArray
    b: FloatArray


@dataclass(slots=True, eq=False)
class FlowSample:
    """What was seen.

    Attributes
    ----------
    pairs
        Of neighbouring images.
    chains
        Of images up to six apart: larger motion, for the lens.
    means, deviations, clipped
        Per image looked at: mean and standard deviation in grey levels, share of pixels at 255.
    black, frozen
        Numbers of images without content, and of images that repeat the one before.
    unreadable
        Numbers of images that can't be decoded.
    example
        Number of the image with most contrast, or None.
    """

    pairs: list[Pair] = field(default_factory=list)
    chains: list[Pair] = field(default_factory=list)
    images: list[int] = field(default_factory=list)
    means: list[float] = field(default_factory=list)
    deviations: list[float] = field(default_factory=list)
    clipped: list[float] = field(default_factory=list)
    black: list[int] = field(default_factory=list)
    frozen: list[int] = field(default_factory=list)
    unreadable: list[int] = field(default_factory=list)

    @property
    def example(self) -> int | None:
        """Number of the image with most contrast."""
        return self.images[int(np.argmax(self.deviations))] if self.images else None


def follow(
    sequence: datasets.Sequence,
    stretches: Sequence[IntArray],
    progress: Callable[[int, int], None] | None = None,
) -> FlowSample:
    """Track corners through every stretch, from image to image, without the gyro's help.

    Parameters
    ----------
    progress
        Called with images done and images in all.
    """
    out = FlowSample()
    tracker = KltTracker(_WINDOW_PX, _LEVELS, _BACK_PX)
    total, done = sum(len(part) for part in stretches), 0
    for number, part in enumerate(stretches):
        walk = _Walk(sequence.calibration.camera, tracker, number, out)
        for index in part.tolist():
            try:
                image = sequence.image(index)
            except DataError:
                out.unreadable.append(index)
                walk.interrupt()
            else:
                walk.step(index, image)
            done += 1
            if progress is not None:
                progress(done, total)
        walk.interrupt()
    return out


class _Walk:
    """One stretch."""

    def __init__(self, camera: Camera, tracker: KltTracker, stretch: int, out: FlowSample) -> None:
        self._camera, self._tracker, self._stretch, self._out = camera, tracker, stretch, out
        self._before: tuple[int, Image] | None = None
        self._born = (0, np.zeros((0, 2)))
        self._now = np.zeros((0, 2))

    def step(self, index: int, image: Image) -> None:
        usable = self._judge(index, image)
        if self._before is not None and usable:
            number, previous = self._before
            if cv2.norm(previous, image, cv2.NORM_L1) / image.size < _SAME:
                self._out.frozen.append(index)  # the next image is compared with the one before
                return
            if len(self._now):
                self._track(number, previous, index, image)
        if not usable:
            self.interrupt()
            return
        if index - self._born[0] >= _CHAIN or len(self._now) < _FEATURES // 2:
            self._finish_chain()
            self._detect(index, image)
        self._before = index, image

    def interrupt(self) -> None:
        self._finish_chain()
        self._before, self._now = None, np.zeros((0, 2))

    def _judge(self, index: int, image: Image) -> bool:
        mean, deviation = cv2.meanStdDev(image)
        out = self._out
        out.images.append(index)
        out.means.append(float(mean[0, 0]))
        out.deviations.append(float(deviation[0, 0]))
        out.clipped.append(float((image == 255).mean()))
        if out.deviations[-1] < _FLAT:
            out.black.append(index)
            return False
        return True

    def _track(self, number: int, previous: Image, index: int, image: Image) -> None:
        flow = self._tracker.track(previous, image, self._now, None)
        kept = flow.consistent & self._camera.inside(flow.pixels)
        before, after = self._now[kept], flow.pixels[kept]
        self._out.pairs.append(Pair(number, index, self._stretch, before, after))
        self._born = self._born[0], self._born[1][kept]
        self._now = after
        self._last = index

    def _detect(self, index: int, image: Image) -> None:
        corners = cv2.goodFeaturesToTrack(
            image, _FEATURES, _QUALITY, _SPACING_SHARE * image.shape[1]
        )
        self._now = np.reshape([] if corners is None else corners, (-1, 2)).astype(np.float64)  # type: ignore[redundant-expr]
        self._born = index, self._now
        self._last = index

    def _finish_chain(self) -> None:
        first, origin = self._born
        if len(self._now) and self._last > first:
            self._out.chains.append(Pair(first, self._last, self._stretch, origin, self._now))
        self._now = np.zeros((0, 2))
