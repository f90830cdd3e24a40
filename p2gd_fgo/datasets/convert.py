"""Write any recording as an ASL folder."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2gd_fgo.datasets.asl_writer import write_png, write_sensors
from p2gd_fgo.datasets.base import KeepsEncodedImages, Sequence
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Truth

_WRITTEN = ("cam0", "mask0", "imu0", "state_groundtruth_estimate0")


@dataclass(frozen=True, slots=True)
class Conversion:
    """What became of a recording.

    Attributes
    ----------
    images
        Written in all.
    copied
        Of these, files that were PNG or JPEG already and were taken over byte by byte; the others
        were decoded and written as lossless PNG.
    masks
        Written.
    notes
        Sentences on what was left out.
    """

    images: int
    copied: int
    masks: int
    notes: tuple[str, ...]


def convert_to_asl(
    sequence: Sequence,
    folder: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Conversion:
    """Write images, IMU, calibration, truth and masks to ``folder``/mav0, whole or not at all.

    Parameters
    ----------
    overwrite
        Replace what an earlier conversion wrote there.
    progress
        Called with the images done and their number.

    Raises
    ------
    DataError
        The folder holds something already (with ``overwrite``: that is of no conversion); not one
        image can be read; the disk is full.
    """
    folder = folder.absolute()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        if not overwrite:
            raise DataError(f"{folder} exists already: give a new folder, or --overwrite")
        foreign = _foreign(folder)
        if foreign is not None:
            raise DataError(
                f"{folder} holds {foreign}, which no conversion writes, so --overwrite leaves it: "
                "give a new folder"
            )
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        done = _write(sequence, part, progress)
        if folder.is_dir():
            shutil.rmtree(folder)
        part.rename(folder)
    except OSError as error:
        raise DataError(f"{folder}: can't be written: {error.strerror}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return done


def _foreign(folder: Path) -> str | None:
    """The first thing in a folder that isn't of a conversion, by name."""
    if not folder.is_dir():
        return "a file"
    above = [path.name for path in sorted(folder.iterdir()) if path.name != "mav0"]
    inside = (path.name for path in sorted((folder / "mav0").glob("*")))
    others = (*above, *(f"mav0/{name}" for name in inside if name not in _WRITTEN))
    return next(iter(others), None)


def _write(
    sequence: Sequence, folder: Path, progress: Callable[[int, int], None] | None
) -> Conversion:
    data, mask_data = (folder / "mav0" / name / "data" for name in ("cam0", "mask0"))
    data.mkdir(parents=True)
    total = len(sequence.image_stamps_ns)
    kept, suffixes, faults, copied, masks = [], [], [], 0, 0
    for index, stamp in enumerate(sequence.image_stamps_ns.tolist()):
        try:
            mask = sequence.mask(index)
            suffix = _write_image(sequence, index, data / str(stamp))
        except DataError as error:
            faults.append(str(error))
            continue
        kept.append(index)
        suffixes.append(suffix or ".png")
        copied += suffix is not None
        if mask is not None:
            mask_data.mkdir(parents=True, exist_ok=True)
            write_png(mask_data / f"{stamp}.png", mask)
            masks += 1
        if progress is not None:
            progress(index + 1, total)
    if not kept:
        raise DataError(f"{sequence.name}: none of its {total} images can be read: {faults[0]}")
    stamps = sequence.image_stamps_ns[np.array(kept)]
    write_sensors(
        folder, sequence.calibration, stamps, sequence.imu, sequence.truth, suffixes=suffixes
    )
    notes = [f"{len(faults)} images were left out, the first: {faults[0]}"] if faults else []
    if sequence.truth is not None and _loses_biases(sequence.truth):
        notes.append("the truth's biases were left out: the format has them only with a velocity")
    return Conversion(len(kept), copied, masks, tuple(notes))


def _write_image(sequence: Sequence, index: int, stem: Path) -> str | None:
    """Write one image; the suffix of a file that was taken over as it is, else None."""
    image = sequence.image(index)  # also where it is copied: what can't be decoded is left out
    encoded = sequence.encoded_image(index) if isinstance(sequence, KeepsEncodedImages) else None
    if encoded is None:
        write_png(stem.with_suffix(".png"), image)
        return None
    stem.with_suffix(encoded.suffix).write_bytes(encoded.data)
    return encoded.suffix


def _loses_biases(truth: Truth) -> bool:
    return truth.velocity is None and truth.gyro_bias is not None
