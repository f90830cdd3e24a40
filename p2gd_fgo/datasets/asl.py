"""ASL folders: EuRoC MAV and TUM-VI.

::

    mav0/cam0/{sensor.yaml, data.csv, data/*.png}      stamp, file name
    mav0/imu0/{sensor.yaml, data.csv}                  stamp, gyro (3), accel (3)
    mav0/state_groundtruth_estimate0/data.csv          optional, or mocap0/data.csv
    mav0/mask0/data/*.png                              optional, see p2gd_fgo.datasets.masks
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.asl_calibration import load_calibration
from p2gd_fgo.datasets.asl_truth import load_truth
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.datasets.csv_tables import read_image_list, read_table
from p2gd_fgo.datasets.images import check_size, decode_grey
from p2gd_fgo.datasets.integrity import check_coverage, increasing_order
from p2gd_fgo.datasets.masks import MaskFolder, open_masks
from p2gd_fgo.datasets.slicing import cut_imu, cut_truth, select_images
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import NANOSECONDS, Event, Image, ImuBatch, IntArray, Truth

_IMU_WIDTH = 7


@dataclass(frozen=True, slots=True, eq=False)
class AslSequence:
    """A recording in the ASL format; see :class:`p2gd_fgo.datasets.base.Sequence`.

    Attributes
    ----------
    image_paths
        (N,) the files behind ``image_stamps_ns``; some may be missing.
    masks
        Where the images' masks are, if there are any.
    """

    name: str
    calibration: Calibration
    image_stamps_ns: IntArray
    image_paths: tuple[Path, ...]
    imu: ImuBatch
    truth: Truth | None
    events: tuple[Event, ...]
    masks: MaskFolder | None = None

    def image(self, index: int) -> Image:
        """Decode image ``index`` as (H, W) grey, 16-bit files by their upper 8 bits.

        Raises
        ------
        DataError
            The file is missing, truncated, no image or of another size than the calibration's.
        """
        path = self.image_paths[index]
        image = decode_grey(path)
        check_size(image, self.calibration.camera, path)
        return image

    def mask(self, index: int) -> Image | None:
        """Decode the mask of image ``index`` as (H, W), 0 where no feature is wanted, or None.

        Raises
        ------
        DataError
            The file can't be decoded or is of another size than the calibration's.
        """
        return None if self.masks is None else self.masks.mask(self.image_paths[index])


def find_mav0(folder: Path, camera: str) -> Path | None:
    """Find the folder that holds the sensors: ``folder/mav0`` or ``folder`` itself."""
    if (folder / "mav0").is_dir():
        return folder / "mav0"
    return folder if (folder / camera).is_dir() or (folder / "cam0").is_dir() else None


def open_asl(
    mav0: Path,
    *,
    camera: str = "cam0",
    start_s: float = 0.0,
    duration_s: float | None = None,
    time_offset_s: float | None = None,
    max_gap_s: float = 0.1,
    masks: Path | None = None,
) -> AslSequence:
    """Read everything but the images.

    Parameters
    ----------
    mav0
        Folder of the sensors, as :func:`find_mav0` gives it.
    camera
        Folder of the camera in it.
    start_s, duration_s
        The part to use, by image stamps; IMU and truth are kept for a second around it.
    time_offset_s
        t_imu = t_cam + offset, instead of what the camera's ``sensor.yaml`` says.
    max_gap_s
        Longer holes in the IMU become an event.
    masks
        Folder of the images' masks.

    Raises
    ------
    DataError
        Files are missing or malformed, the sensors don't overlap in time, no image exists, or the
        first one, or its mask, isn't of the calibration's size.
    """
    folder = mav0 / camera
    if not folder.is_dir():
        present = sorted(p.name for p in mav0.glob("cam*") if p.is_dir())
        raise DataError(
            f"{folder}: no such folder; dataset.camera may be {', '.join(present) or 'none here'}"
        )
    calibration = load_calibration(
        folder / "sensor.yaml", mav0 / "imu0" / "sensor.yaml", time_offset_s
    )
    stamps, paths = _images(folder, calibration)
    imu, imu_events = _imu(mav0 / "imu0" / "data.csv")
    truth, truth_events = load_truth(mav0)
    chosen = select_images(stamps, start_s, duration_s)
    offset_ns = round(calibration.time_offset_s * NANOSECONDS)
    on_imu_clock = stamps[chosen] + offset_ns
    if chosen != slice(0, len(stamps)):
        span = int(on_imu_clock[0]), int(on_imu_clock[-1])
        imu = cut_imu(imu, *span)
        truth = None if truth is None else cut_truth(truth, *span)
    coverage = check_coverage(on_imu_clock, imu, truth, max_gap_s)
    home = mav0.resolve()
    return AslSequence(
        name=home.parent.name if home.name == "mav0" else home.name,
        calibration=calibration,
        image_stamps_ns=stamps[chosen],
        image_paths=tuple(paths[chosen]),
        masks=None if masks is None else open_masks(masks, paths[chosen], calibration.camera),
        imu=imu,
        truth=truth,
        events=(*imu_events, *truth_events, *coverage),
    )


def _images(folder: Path, calibration: Calibration) -> tuple[IntArray, list[Path]]:
    stamps, names = read_image_list(folder / "data.csv")
    paths = [folder / "data" / name for name in names]
    first = next((path for path in paths if path.is_file()), None)
    if first is None:
        raise DataError(
            f"{folder / 'data.csv'}: none of the {len(paths)} listed images exists, the first "
            f"would be {paths[0]}"
        )
    try:
        image = decode_grey(first)
    except DataError:  # one bad file is survived; image() says so again when it's asked for
        return stamps, paths
    check_size(image, calibration.camera, first)
    return stamps, paths


def _imu(path: Path) -> tuple[ImuBatch, list[Event]]:
    table = read_table(path, (_IMU_WIDTH,))
    bad = ~np.isfinite(table.values)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise DataError(
            f"{table.where(int(row))}: column {column + 2} is {table.values[row, column]}: every "
            "IMU value must be finite"
        )
    order, events = increasing_order(table.stamps_ns, "imu")
    if len(order) < 2:
        raise DataError(f"{path}: only {len(order)} IMU sample, at least 2 needed")
    values = table.values[order]
    return ImuBatch(table.stamps_ns[order], values[:, :3].copy(), values[:, 3:].copy()), events
