"""ASL folders: EuRoC MAV and TUM-VI.

::

    mav0/cam0/{sensor.yaml, data.csv, data/*.png}      stamp, file name
    mav0/imu0/{sensor.yaml, data.csv}                  stamp, gyro (3), accel (3)
    mav0/state_groundtruth_estimate0/data.csv          optional, or mocap0/data.csv
    mav0/mask0/data/*.png                              optional, see p2gd_fgo.datasets.masks
    dso/{camchain.yaml, imu_config.yaml}               TUM-VI, where sensor.yaml is missing
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl_calibration import load_asl_calibration
from p2gd_fgo.datasets.asl_truth import load_truth
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.calibration_fields import imu_noise, read_yaml
from p2gd_fgo.datasets.calibration_files import find_calibration, named_calibration, with_offset
from p2gd_fgo.datasets.csv_tables import read_image_list, read_table
from p2gd_fgo.datasets.folder_sequence import FolderSequence, check_first_image
from p2gd_fgo.datasets.imu_samples import imu_from_table
from p2gd_fgo.datasets.masks import configured_masks
from p2gd_fgo.datasets.part import choose_part
from p2gd_fgo.errors import DataError

_IMU_WIDTH = 7


class AslSequence(FolderSequence):
    """A recording in the ASL format."""

    __slots__ = ()


def find_mav0(folder: Path, camera: str) -> Path | None:
    """Find the folder that holds the sensors: ``folder/mav0`` or ``folder`` itself."""
    if (folder / "mav0").is_dir():
        return folder / "mav0"
    named = (folder / camera / "data.csv").is_file()  # KITTI raw's cameras are folders, too
    return folder if named or any((folder / n).is_dir() for n in ("cam0", "imu0")) else None


def open_asl(mav0: Path, config: DatasetConfig, max_gap_s: float) -> AslSequence:
    """Read everything but the images.

    Parameters
    ----------
    mav0
        Folder of the sensors, as :func:`find_mav0` gives it.
    config
        Camera, part, time offset, masks, and the calibration where ``sensor.yaml`` isn't there.
    max_gap_s
        Longer holes in the IMU become an event.

    Raises
    ------
    DataError
        Files are missing or malformed, the sensors don't overlap in time, no image exists, or the
        first one, or its mask, isn't of the calibration's size.
    """
    folder = mav0 / config.camera
    if not folder.is_dir():
        present = sorted(p.name for p in mav0.glob("cam*") if p.is_dir())
        raise DataError(
            f"{folder}: no such folder; dataset.camera may be {', '.join(present) or 'none here'}"
        )
    calibration = with_offset(_calibration(mav0, config), config.time_offset_s)
    stamps, names = read_image_list(folder / "data.csv")
    paths = [folder / "data" / name for name in names]
    check_first_image(AslSequence, paths, calibration)
    imu, imu_events = imu_from_table(read_table(mav0 / "imu0" / "data.csv", (_IMU_WIDTH,)), 0, 3)
    truth, truth_events = load_truth(mav0)
    part = choose_part(stamps, imu, truth, calibration.time_offset_s, config, max_gap_s)
    home = mav0.resolve()
    return AslSequence(
        name=home.parent.name if home.name == "mav0" else home.name,
        calibration=calibration,
        image_stamps_ns=stamps[part.chosen],
        image_paths=tuple(paths[part.chosen]),
        masks=configured_masks(config, paths[part.chosen], calibration.camera),
        imu=part.imu,
        truth=part.truth,
        events=(*imu_events, *truth_events, *part.events),
    )


def _calibration(mav0: Path, config: DatasetConfig) -> Calibration:
    inertial = mav0 / "imu0" / "sensor.yaml"
    if config.calibration is not None:
        given = named_calibration(config)
        if given.imu_noise is None and inertial.is_file():
            return replace(given, imu_noise=imu_noise(read_yaml(inertial), str(inertial)))
        return given
    camera = mav0 / config.camera / "sensor.yaml"
    if not camera.is_file():  # TUM-VI's exports hold Kalibr's files in a folder beside mav0
        found = find_calibration(mav0.parent / "dso", config.camera)
        if found is not None:
            return found
    return load_asl_calibration(camera, inertial)
