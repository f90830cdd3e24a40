"""Decode images from files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import Image

_ENDS = {b"\x89PNG": b"IEND", b"\xff\xd8\xff": b"\xff\xd9"}
_TAIL = 1024


def decode_grey(path: Path) -> Image:
    """Read an image as (H, W) grey; of 16-bit values the upper 8 bits.

    Raises
    ------
    DataError
        The file is missing, truncated or no image.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{path}: no such image") from None
    except OSError as error:
        raise DataError(f"{path}: the image can't be read: {error}") from None
    # Some decoders fill the missing part with grey and say nothing, others write to the terminal.
    for head, end in _ENDS.items():
        if data.startswith(head) and end not in data[-_TAIL:]:
            raise DataError(f"{path}: the image is truncated after {len(data)} bytes")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if data else None
    if image is None:
        raise DataError(f"{path}: not an image that can be decoded ({len(data)} bytes)")
    return np.asarray(image, dtype=np.uint8)


def check_size(image: Image, camera: Camera, path: Path) -> None:
    """Refuse an image whose size isn't the calibration's.

    Raises
    ------
    DataError
        Names both sizes.
    """
    height, width = image.shape
    if (width, height) != (camera.width, camera.height):
        raise DataError(
            f"{path}: the image is {width}x{height} px, but the camera's calibration is for "
            f"{camera.width}x{camera.height}"
        )


def load_mask(path: Path, camera: Camera) -> Image:
    """Read a mask, (H, W): features are wanted where it isn't 0.

    Raises
    ------
    DataError
        The file is missing, no image, of another size than the camera's, or 0 everywhere.
    """
    mask = decode_grey(path)
    check_size(mask, camera, path)
    if not mask.any():
        raise DataError(f"{path}: the mask is 0 everywhere: features are wanted where it isn't")
    return mask
