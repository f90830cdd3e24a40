"""What the readers of folders share: images are files, decoded when asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.base import Calibration, EncodedImage
from p2gd_fgo.datasets.images import check_size, decode_grey
from p2gd_fgo.datasets.masks import MaskFolder, configured_masks
from p2gd_fgo.datasets.part import choose_part
from p2gd_fgo.errors import DataError
from p2gd_fgo.types import Event, Image, ImuBatch, IntArray, Truth

_FORMATS = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg"}


@dataclass(frozen=True, slots=True, eq=False)
class FolderSequence:
    """A recording whose images are files; see :class:`p2gd_fgo.datasets.base.Sequence`.

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

    @classmethod
    def of_part(
        cls,
        folder: Path,
        calibration: Calibration,
        stamps_ns: IntArray,
        paths: list[Path],
        imu: ImuBatch,
        truth: Truth | None,
        config: DatasetConfig,
        max_gap_s: float,
        events: tuple[Event, ...],
    ) -> Self:
        """The part that the configuration asks for, of all that was read.

        Raises
        ------
        DataError
            As :func:`p2gd_fgo.datasets.part.choose_part`; masks that can't be used.
        """
        part = choose_part(stamps_ns, imu, truth, calibration.time_offset_s, config, max_gap_s)
        return cls(
            name=folder.resolve().name,
            calibration=calibration,
            image_stamps_ns=stamps_ns[part.chosen],
            image_paths=tuple(paths[part.chosen]),
            masks=configured_masks(config, paths[part.chosen], calibration.camera),
            imu=part.imu,
            truth=part.truth,
            events=(*events, *part.events),
        )

    def image(self, index: int) -> Image:
        """Decode image ``index`` as (H, W) grey, 16-bit files by their upper 8 bits.

        Raises
        ------
        DataError
            The file is missing, truncated, no image or of another size than the calibration's.
        """
        path = self.image_paths[index]
        image = self.decode(path)
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

    def encoded_image(self, index: int) -> EncodedImage | None:
        """The file of image ``index`` as it is, if it is a PNG or JPEG that needs no more.

        Raises
        ------
        DataError
            The file can't be read.
        """
        path = self.image_paths[index]
        try:
            data = path.read_bytes()
        except OSError as error:
            raise DataError(f"{path}: the image can't be read: {error.strerror}") from None
        suffix = next((s for head, s in _FORMATS.items() if data.startswith(head)), None)
        return None if suffix is None else EncodedImage(data, suffix)

    @staticmethod
    def decode(path: Path) -> Image:
        """Read a file of this format as (H, W) grey.

        Raises
        ------
        DataError
            The file is missing, truncated or no image.
        """
        return decode_grey(path)


def check_first_image(
    sequence_type: type[FolderSequence], paths: list[Path], calibration: Calibration
) -> None:
    """Refuse a list without a single image, and a first image of another size.

    Raises
    ------
    DataError
        Names the file.
    """
    first = next((path for path in paths if path.is_file()), None)
    if first is None:
        raise DataError(
            f"{paths[0].parent}: none of the {len(paths)} listed images exists, the first would be "
            f"{paths[0]}"
        )
    try:
        image = sequence_type.decode(first)
    except DataError:  # one bad file is survived; image() says so again when it's asked for
        return
    check_size(image, calibration.camera, first)
