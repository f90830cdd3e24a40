"""The pieces of the way of a run that lies in its directory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.config import Config, load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.datasets.base import stamps_on_imu_clock
from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.frame_measures import read_frames
from p2gd_fgo.evaluation.segments import LENGTH_M, Segment, segments
from p2gd_fgo.run_directory import CONFIG, FRAMES, read_status
from p2gd_fgo.trajectory_files import read_tum
from p2gd_fgo.types import FloatArray, IntArray

MASKS = "mav0/mask0/data"
"""Where a rendered recording has its masks."""

_EVERY = 5  # of the images: traffic doesn't come and go in half a second


def run_segments(
    directory: Path,
    *,
    length_m: float = LENGTH_M,
    moving: tuple[IntArray, FloatArray] | None = None,
) -> tuple[Segment, ...]:
    """Cut the way of a run into pieces, see :func:`segments`.

    Parameters
    ----------
    directory
        Of the run; it has a truth.
    length_m
        Of a piece.
    moving
        As :func:`moving_objects` gives it.

    Raises
    ------
    DataError
        No run, or one without truth or with less than 3 poses.
    """
    if read_status(directory) is None:
        raise DataError(f"{directory}: no run directory, it has no status.json of this program")
    truth = directory / "truth.tum"
    if not truth.is_file():
        raise DataError(f"{directory}: the run had no truth, there are no errors to place")
    config = load_config(directory / CONFIG)
    return segments(
        read_tum(directory / "estimate.tum"),
        read_tum(truth),
        alignment=config.evaluation.alignment,
        length_m=length_m,
        frames=read_frames(directory / FRAMES),
        moving=moving,
    )


def has_masks(config: Config) -> bool:
    """Whether the recording has masks where a rendered one has them."""
    return config.dataset.path is not None and Path(config.dataset.path, MASKS).is_dir()


def moving_objects(
    config: Config, masks: str = MASKS, *, every: int = _EVERY
) -> tuple[IntArray, FloatArray]:
    """How much of the image moving objects cover, by the masks of the recording.

    Parameters
    ----------
    config
        Names the recording; whether the run itself used the masks makes no difference.
    masks
        Their folder, absolute or in the recording.
    every
        Only each so many-th image is read.

    Returns
    -------
    stamps_ns, share
        (G,) on the IMU's clock, and the share of the pixels (G,) that are 0 in the mask.

    Raises
    ------
    DataError
        The recording can't be opened, or has no masks there.
    """
    settings = {"dataset.masks": masks}
    sequence = open_sequence(override(config, settings).dataset, max_gap_s=config.imu.max_gap_s)
    on_imu_clock = stamps_on_imu_clock(sequence, config.dataset.time_offset_s)
    stamps, shares = [], []
    for index in range(0, len(sequence.image_stamps_ns), every):
        mask = sequence.mask(index)
        if mask is not None:
            stamps.append(int(on_imu_clock[index]))
            shares.append(float(np.mean(mask == 0)))
    return np.array(stamps, dtype=np.int64), np.array(shares)
