"""Whether there is anything to see in an image, and whether it is a new one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.types import Image

_EVERY_PX = 8
_LEAST_SPREAD = 10.0  # grey levels between the darkest and the brightest 5 %: noise, no picture
_JUMP = 1.3  # of the mean brightness from image to image; automatic exposure goes in smaller steps


@dataclass(frozen=True, slots=True)
class ImageHealth:
    """What is wrong with an image.

    Attributes
    ----------
    blank
        Black, white or grey all over: nothing can be tracked in it.
    repeated
        The very image before, bit for bit. No camera takes the same noise twice, so this one was
        taken at another time than its stamp says.
    brightness
        Its mean over that of the last image that wasn't blank; 1 for a blank one.
    """

    blank: bool
    repeated: bool
    brightness: float

    @property
    def usable(self) -> bool:
        """Its features may be tracked and believed."""
        return not (self.blank or self.repeated)

    @property
    def jumped(self) -> bool:
        """Brighter or darker at once."""
        return not 1.0 / _JUMP < self.brightness < _JUMP


class ImageWatch:
    """Compares each image with the one before."""

    def __init__(self) -> None:
        self._previous: Image | None = None
        self._mean: float | None = None

    def look(self, image: Image) -> ImageHealth:
        """Judge the next image, (height, width) grey."""
        sample = image[::_EVERY_PX, ::_EVERY_PX]
        low, high = np.percentile(sample, (5.0, 95.0))
        repeated = self._previous is not None and np.array_equal(self._previous, image)
        self._previous = image
        if high - low < _LEAST_SPREAD:
            return ImageHealth(True, repeated, 1.0)
        mean, before = float(sample.mean()), self._mean
        self._mean = mean
        return ImageHealth(False, repeated, 1.0 if before is None else mean / before)
