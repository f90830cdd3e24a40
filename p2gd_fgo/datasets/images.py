"""Decode images from files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from p2gd_fgo.errors import DataError, ImageError
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
    return decode_grey_bytes(_read(path), str(path))


def decode_raw(path: Path) -> Image:
    """Read an image's 8-bit values as they are stored, (H, W) or (H, W, 3) BGR.

    Raises
    ------
    DataError
        The file is missing, truncated or no image.
    """
    image = _decode(_read(path), cv2.IMREAD_ANYCOLOR, str(path))
    return np.asarray(image, dtype=np.uint8)


def decode_grey_bytes(data: bytes, where: str) -> Image:
    """Decode a picture in memory as (H, W) grey; of 16-bit values the upper 8 bits.

    Raises
    ------
    DataError
        Truncated or no image; ``where`` names it.
    """
    return np.asarray(_decode(data, cv2.IMREAD_GRAYSCALE, where), dtype=np.uint8)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{path}: no such image") from None
    except OSError as error:
        raise DataError(f"{path}: the image can't be read: {error}") from None


def _decode(data: bytes, flags: int, where: str) -> Image:
    # Some decoders fill the missing part with grey and say nothing, others write to the terminal.
    for head, end in _ENDS.items():
        if data.startswith(head) and end not in data[-_TAIL:]:
            raise ImageError(f"{where}: the image is truncated after {len(data)} bytes")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:  # such as a header that asks for 2^30 pixels
        image = None
    if image is None:
        raise ImageError(f"{where}: not an image that can be decoded ({len(data)} bytes)")
    return np.asarray(image)


def check_size(image: Image, camera: Camera, path: Path | str) -> None:
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
