"""One run of a study, with all that a worker needs to do it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from p2gd_fgo.config import Config
from p2gd_fgo.run_record import Label
from p2gd_fgo.simulation.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Rendered:
    """A recording that is made from its seeds where it is needed.

    Attributes
    ----------
    scenario
        With the seed of the IMU's noise; recordings that differ in it alone share their images.
    images
        How many it has.
    """

    scenario: Scenario
    images: int

    @property
    def width(self) -> int:
        """Of an image, px."""
        return self.scenario.camera.width


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recording that lies in a folder, its number of images and their width in px."""

    folder: Path
    images: int
    width: int


@dataclass(frozen=True, slots=True)
class Run:
    """What is to be done; see :class:`p2gd_fgo.run_record.RunRecord` for the common fields.

    Attributes
    ----------
    config
        Resolved, but for ``dataset.path``.
    source
        The recording.
    timeout_s
        Wall time that it may take, rendering aside.
    segments
        Whether its record holds the errors of each piece of the way.
    """

    key: str
    study: str
    axes: Mapping[str, Label]
    sequence: str
    route: str
    group: str
    seed: int
    config: Config
    source: Rendered | Recorded
    timeout_s: float
    segments: bool = False

    @property
    def label(self) -> str:
        """For progress and errors: recording, then the axes."""
        return " · ".join([self.sequence, *(str(label) for label in self.axes.values())])
