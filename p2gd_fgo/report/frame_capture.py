"""Observers of a run that end in pictures of single images."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence, load_mask
from p2gd_fgo.distribution.base import Explanation
from p2gd_fgo.frontend import CellQuotas
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.pipeline import Observer
from p2gd_fgo.types import (
    NANOSECONDS,
    BoolArray,
    Estimate,
    FloatArray,
    Image,
    IntArray,
    Observations,
    Waiting,
)


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """An image, its features, and what was decided for it.

    Attributes
    ----------
    index, seconds
        Image number in the recording, from 0, and time since its first image.
    stamp_ns
        On the IMU's clock.
    image
        (height, width) grey.
    pixels, new
        (N, 2) its features, and (N,) whether the track begins in it.
    quotas
        (rows, columns), where the distribution gives any.
    explanation
        Of P2GD, where it ran.
    reason
        Why it did not.
    masked
        (height, width) where a mask lets no feature be, None without a mask.
    """

    index: int
    seconds: float
    stamp_ns: int
    image: Image
    pixels: FloatArray
    new: BoolArray
    quotas: IntArray | None
    explanation: Explanation | None
    reason: str
    masked: BoolArray | None = None


class FrameCapture:
    """Observer that keeps what a picture needs, of some images only.

    Parameters
    ----------
    frames
        Image numbers in the recording, from 0.

    Attributes
    ----------
    snapshots
        By image number.
    """

    def __init__(self, frames: Collection[int]) -> None:
        self._frames = frozenset(frames)
        self.snapshots: dict[int, Snapshot] = {}

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Remember when the recording begins, and through which lens."""
        self.camera: Camera = sequence.calibration.camera
        self.config = config
        self._sequence = sequence
        static = config.dataset.mask
        self._mask = load_mask(Path(static), self.camera) if static is not None else None
        self._stamps_ns = sequence.image_stamps_ns
        self._newest_id = -1
        self._started = False

    def stamp_ns(self, index: int) -> int:
        """When image ``index`` of the recording was taken, on the camera's clock."""
        return int(self._stamps_ns[index])

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Keep the image if it is one of those asked for."""
        observations = odometry.observations
        if index in self._frames:
            self.snapshots[index] = self._snapshot(index, outcome, image, odometry, observations)
        self._started = self._started or isinstance(outcome, Estimate)
        self._newest_id = max(self._newest_id, int(observations.ids.max(initial=-1)))

    def _snapshot(
        self,
        index: int,
        outcome: Estimate | Waiting,
        image: Image,
        odometry: Odometry,
        observations: Observations,
    ) -> Snapshot:
        decision = odometry.decision
        assert decision is not None
        selection = decision.selection
        if isinstance(outcome, Waiting):
            reason = outcome.reason
        elif decision.problem is not None:
            reason = decision.problem.message
        elif self._started:
            reason = "no image follows"
        else:
            reason = "the estimator had not started"
        return Snapshot(
            index,
            float(self._stamps_ns[index] - self._stamps_ns[0]) / NANOSECONDS,
            observations.stamp_ns,
            image.copy(),
            np.array(observations.pixels),
            observations.ids > self._newest_id,
            selection.quotas if isinstance(selection, CellQuotas) else None,
            decision.explanation,
            reason,
            self._masked(index),
        )

    def _masked(self, index: int) -> BoolArray | None:
        """What the recording's mask of the image or the mask of all images covers."""
        masks = [m for m in (self._mask, self._sequence.mask(index)) if m is not None]
        return np.any([mask == 0 for mask in masks], axis=0) if masks else None


class Observers:
    """Several observers as one."""

    def __init__(self, *observers: Observer) -> None:
        self._observers = observers

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Tell each."""
        for observer in self._observers:
            observer.begin(sequence, config)

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Tell each."""
        for observer in self._observers:
            observer.frame(index, outcome, image, odometry)
