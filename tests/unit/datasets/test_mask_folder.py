from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from asl_folder import HEIGHT, WIDTH, AslFolder

from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Image

MASKS = "mav0/mask0/data"


@pytest.fixture
def folder(tmp_path: Path) -> AslFolder:
    return AslFolder(tmp_path / "recording").write()


def put(folder: AslFolder, index: int, mask: Image | None = None) -> Path:
    path = folder.root / MASKS / f"{folder.image_stamps[index]}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    if mask is None:
        mask = np.full((HEIGHT, WIDTH), 10 * index, np.uint8)
    assert cv2.imwrite(str(path), mask)
    return path


def test_masks_go_by_the_images_names(folder: AslFolder) -> None:
    for index in (1, 3):
        put(folder, index)
    sequence = folder.open(masks=MASKS)
    masks = [sequence.mask(k) for k in range(6)]
    assert [mask is not None for mask in masks] == [False, True, False, True, False, False]
    assert masks[3] is not None and (masks[3] == 30).all()


def test_they_follow_the_images_when_the_recording_is_cut(folder: AslFolder) -> None:
    put(folder, 3)
    sequence = folder.open(masks=MASKS, start_s=0.25)
    assert sequence.mask(0) is not None
    assert sequence.mask(1) is None


def test_an_absolute_folder_and_images_that_are_no_png(folder: AslFolder, tmp_path: Path) -> None:
    put(folder, 0)
    rows = folder.camera_csv.read_text().replace(".png", ".jpg")
    folder.camera_csv.write_text(rows)
    for path in folder.camera_csv.parent.glob("data/*.png"):
        cv2.imwrite(str(path.with_suffix(".jpg")), np.zeros((HEIGHT, WIDTH), np.uint8))
    sequence = folder.open(masks=str(folder.root / MASKS))
    assert sequence.mask(0) is not None


def test_without_the_setting_there_is_none(folder: AslFolder) -> None:
    put(folder, 0)
    assert folder.open().mask(0) is None


def test_folders_that_cannot_be_meant_are_refused(folder: AslFolder) -> None:
    with pytest.raises(DataError, match=r"dataset\.masks: .*nowhere is not a folder"):
        folder.open(masks="nowhere")
    with pytest.raises(DataError, match=r"mask for none of the 6 images.*\d{19}\.png"):
        folder.open(masks="mav0/imu0")


def test_masks_that_cannot_be_used_are_refused_by_name(folder: AslFolder) -> None:
    put(folder, 0)
    small = put(folder, 1, np.zeros((HEIGHT, WIDTH - 1), np.uint8))
    broken = put(folder, 2)
    broken.write_bytes(broken.read_bytes()[:50])
    sequence = folder.open(masks=MASKS)
    with pytest.raises(DataError, match=f"{small.name}: .*63x48 px.*64x48"):
        sequence.mask(1)
    with pytest.raises(DataError, match=f"{broken.name}: .*truncated"):
        sequence.mask(2)
    (folder.root / MASKS / f"{folder.image_stamps[0]}.png").unlink()
    with pytest.raises(DataError, match="63x48"):
        folder.open(masks=MASKS)
