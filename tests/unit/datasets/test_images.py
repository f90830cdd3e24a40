"""Decoding of images, whole and broken."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from p2gd_fgo.datasets import load_mask
from p2gd_fgo.datasets.images import decode_grey
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import RadTanCamera

CAMERA = RadTanCamera(64, 48, 40.0, 40.0, 31.5, 23.5, 0.0, 0.0, 0.0, 0.0)


def noise(shape: tuple[int, ...] = (48, 64)) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)


def test_sixteen_bits_keep_the_upper_eight(tmp_path: Path) -> None:
    deep = np.random.default_rng(0).integers(0, 65536, (48, 64), dtype=np.uint16)
    cv2.imwrite(str(tmp_path / "a.png"), deep)
    grey = decode_grey(tmp_path / "a.png")
    assert grey.dtype == np.uint8
    np.testing.assert_array_equal(grey, deep >> 8)


def test_colour_becomes_grey(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), noise((48, 64, 3)))
    assert decode_grey(tmp_path / "a.png").shape == (48, 64)


@pytest.mark.parametrize("suffix", ["png", "jpg"])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_truncated_images_are_refused(
    tmp_path: Path, suffix: str, share: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), noise())
    whole = path.read_bytes()
    assert decode_grey(path).shape == (48, 64)
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError, match=r"a\..*truncated"):
        decode_grey(path)
    assert capfd.readouterr().err == ""


def test_no_image_at_all(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such image"):
        decode_grey(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(DataError, match="not an image"):
        decode_grey(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(b"hello")
    with pytest.raises(DataError, match="not an image"):
        decode_grey(tmp_path / "a.png")


def test_masks(tmp_path: Path) -> None:
    path = tmp_path / "mask.png"
    mask = np.zeros((48, 64), dtype=np.uint8)
    mask[:30] = 255
    cv2.imwrite(str(path), mask)
    np.testing.assert_array_equal(load_mask(path, CAMERA), mask)
    cv2.imwrite(str(path), mask[:, :-1])
    with pytest.raises(DataError, match=r"mask\.png.*63x48 px.*64x48"):
        load_mask(path, CAMERA)
    cv2.imwrite(str(path), np.zeros_like(mask))
    with pytest.raises(DataError, match="0 everywhere"):
        load_mask(path, CAMERA)
    with pytest.raises(DataError, match="no such image"):
        load_mask(tmp_path / "other.png", CAMERA)
