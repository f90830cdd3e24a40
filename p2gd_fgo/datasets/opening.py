"""From a configuration to a recording, whatever its format."""

from __future__ import annotations

from pathlib import Path

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl import find_mav0, open_asl
from p2gd_fgo.datasets.bag import open_bag
from p2gd_fgo.datasets.bag_reading import bag_files
from p2gd_fgo.datasets.base import Sequence
from p2gd_fgo.datasets.kaist import is_kaist, open_kaist
from p2gd_fgo.datasets.kitti_raw import is_kitti_raw, open_kitti_raw
from p2gd_fgo.datasets.tum import is_tum, open_tum
from p2gd_fgo.errors import DataError
from p2gd_fgo.user_paths import user_path

_FIELDS_OF = {
    "image_topic": ("bag",),
    "imu_topic": ("bag",),
    "truth_topic": ("bag",),
    "T_truth_imu": ("bag", "tum"),
}


def open_sequence(config: DatasetConfig, *, max_gap_s: float = 0.1) -> Sequence:
    """Open the recording that the configuration names.

    Parameters
    ----------
    config
        Path, format (``auto``: guessed from the path), camera, calibration, topics, part, time
        offset and masks.
    max_gap_s
        ``imu.max_gap_s``: longer holes in the IMU become an event.

    Raises
    ------
    DataError
        No path, nothing there, no known format in it, or a recording that can't be used.
    """
    path = recording_path(config)
    name = recording_format(config)
    _check_fields(config, name)
    if name == "bag":
        return open_bag(path, config, max_gap_s)
    if name == "kaist":
        return open_kaist(path, config, max_gap_s)
    if name == "kitti_raw":
        return open_kitti_raw(path, config, max_gap_s)
    if name == "tum":
        return open_tum(path, config, max_gap_s)
    return open_asl(find_mav0(path, config.camera) or path, config, max_gap_s)


def _check_fields(config: DatasetConfig, name: str) -> None:
    """Refuse settings that this format would pass over in silence."""
    for field, formats in _FIELDS_OF.items():
        if getattr(config, field) is not None and name not in formats:
            raise DataError(
                f"dataset.{field} is set, but {config.path} is a recording of format '{name}' and "
                f"the field is for {' and '.join(formats)}: leave it away"
            )


def recording_path(config: DatasetConfig) -> Path:
    """``dataset.path``, which exists.

    Raises
    ------
    DataError
        It isn't set or there is nothing.
    """
    if config.path is None:
        raise DataError("dataset.path is not set: give the folder of a recording, or a bag")
    path = user_path(config.path, "dataset.path")
    if not path.exists():
        raise DataError(f"dataset.path: {path} doesn't exist")
    return path


def recording_format(config: DatasetConfig) -> str:
    """``dataset.format``, guessed from what lies at the path where it is ``auto``.

    Raises
    ------
    DataError
        Nothing that is known.
    """
    path = recording_path(config)
    if path.is_file() and config.format in ("auto", "bag") and bag_files(path):
        return "bag"
    if path.is_file():
        raise DataError(
            f"dataset.path: {path} is a file, not the folder of a recording or a bag "
            "(.bag, .db3, .mcap)"
        )
    if config.format != "auto":
        return config.format
    if find_mav0(path, config.camera) is not None:
        return "asl"
    guesses = {"kaist": is_kaist, "kitti_raw": is_kitti_raw, "tum": is_tum, "bag": bag_files}
    found = next((name for name, fits in guesses.items() if fits(path)), None)
    if found is None:
        raise DataError(
            f"dataset.path: {path} holds no known format of recording: an ASL folder (EuRoC, "
            f"TUM-VI) would hold mav0/ or {config.camera}/, KAIST Urban image/stereo_left/, KITTI "
            "raw oxts/ and image_00/, a TUM-style folder rgb.txt, or there would be a bag"
        )
    return found
