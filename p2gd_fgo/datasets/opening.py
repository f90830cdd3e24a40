"""From a configuration to a recording, whatever its format."""

from __future__ import annotations

from pathlib import Path

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl import find_mav0, open_asl
from p2gd_fgo.datasets.base import Sequence
from p2gd_fgo.errors import DataError


def open_sequence(config: DatasetConfig, *, max_gap_s: float = 0.1) -> Sequence:
    """Open the recording that the configuration names.

    Parameters
    ----------
    config
        Path, format (``auto``: guessed from the folder), camera, part, time offset and masks.
    max_gap_s
        ``imu.max_gap_s``: longer holes in the IMU become an event.

    Raises
    ------
    DataError
        No path, no such folder, no known format in it, or a recording that can't be used.
    """
    if config.path is None:
        raise DataError("dataset.path is not set: give the folder of a recording")
    folder = Path(config.path).expanduser()
    if not folder.is_dir():
        reason = "is a file, not the folder of a recording" if folder.exists() else "doesn't exist"
        raise DataError(f"dataset.path: {folder} {reason}")
    mav0 = find_mav0(folder, config.camera)
    if mav0 is None:
        raise DataError(
            f"{folder}: no known format of recording: an ASL folder (EuRoC, TUM-VI) would hold "
            f"mav0/ or {config.camera}/"
        )
    return open_asl(
        mav0,
        camera=config.camera,
        start_s=config.start_s,
        duration_s=config.duration_s,
        time_offset_s=config.time_offset_s,
        max_gap_s=max_gap_s,
        masks=None if config.masks is None else folder / Path(config.masks).expanduser(),
    )
