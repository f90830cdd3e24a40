"""Masks that change from image to image: what moves is left out of the estimate."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.images import check_size, decode_grey
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import Image
from p2gd_fgo.user_paths import user_path


@dataclass(frozen=True, slots=True, eq=False)
class MaskFolder:
    """Masks named as the images they belong to, 0 where no feature is wanted.

    A mask has its image's file name, or that with the ending ``.png``; an image without a mask
    is not masked at all. In an ASL recording the place for them is ``mav0/mask0/data``.

    Attributes
    ----------
    folder
        Holds the masks.
    camera
        Gives the size that they must have.
    """

    folder: Path
    camera: Camera

    def mask(self, image: Path) -> Image | None:
        """Read the mask (H, W) of an image; None if it has none.

        Raises
        ------
        DataError
            The file can't be decoded or is of another size than the camera's images.
        """
        path = self._path(image)
        if path is None:
            return None
        mask = decode_grey(path)
        check_size(mask, self.camera, path)
        return mask

    def _path(self, image: Path) -> Path | None:
        same = self.folder / image.name
        paths = (path for path in (same, same.with_suffix(".png")) if path.exists())
        return next(paths, None)


def open_masks(folder: Path, images: Items[Path], camera: Camera) -> MaskFolder:
    """Open the masks of ``images`` and look at the first.

    Raises
    ------
    DataError
        No such folder; a mask for none of the images; a first mask that can't be used.
    """
    if not folder.is_dir():
        raise DataError(f"dataset.masks: {folder} is not a folder: give the one with the masks")
    masks = MaskFolder(folder, camera)
    if all(masks.mask(image) is None for image in images):
        raise DataError(
            f"dataset.masks: {folder} holds a mask for none of the {len(images)} images, the "
            f"first would be {Path(images[0].name).with_suffix('.png')}"
        )
    return masks


def configured_masks(
    config: DatasetConfig, images: Items[Path], camera: Camera
) -> MaskFolder | None:
    """Open ``dataset.masks``; a relative path starts at the recording's folder.

    Raises
    ------
    DataError
        As :func:`open_masks`.
    """
    if config.masks is None:
        return None
    recording = Path(config.path or ".").expanduser()
    root = recording if recording.is_dir() else recording.parent
    masks = user_path(config.masks, "dataset.masks")
    return open_masks(user_path(str(root / masks), "dataset.masks"), images, camera)
