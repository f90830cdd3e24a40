"""What names a run: its configuration, its data, and the code that made it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

import p2gd_fgo
from p2gd_fgo.config import Config
from p2gd_fgo.errors import DataError
from p2gd_fgo.simulation.presets import scenario_hash
from p2gd_fgo.simulation.recorder import WORLD_VERSION
from p2gd_fgo.study.runs import Recorded, Rendered
from p2gd_fgo.user_paths import user_path

ESTIMATE_ROOMS = (
    *(
        "types",
        "config",
        "geometry",
        "imu",
        "imu_intake",
        "datasets",
        "trajectory_files",
        "priors",
        "frontend",
    ),
    *("distribution", "initialization", "backends", "troubles", "odometry", "recorder", "pipeline"),
    *("evaluation", "experiment"),
)
"""Whose code can change a record; rendered images have a version of their own."""

_LIBRARIES = ("gtsam", "numpy", "scipy", "evo")
_OPENCV = ("opencv-python-headless", "opencv-python", "opencv-contrib-python")
_TEXT = (".csv", ".yaml", ".yml", ".txt", ".json", ".tum")
_IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff")
_END_BYTES = 65536
_KEY_DIGITS = 16


def run_key(config: Config, data: str, folder: Path | None = None) -> str:
    """Hash of a resolved configuration and of a recording.

    Only what isn't the default counts, so that an option which is added later leaves the keys of
    runs without it; name and path of the recording don't change an estimate, and the files and
    folders that a configuration names count by what they hold.

    Parameters
    ----------
    data
        Of :func:`data_hash`.
    folder
        Where a relative path of masks starts: the recording. None where it isn't rendered yet: then
        such masks are rendered with it.

    Raises
    ------
    DataError
        Such a file can't be read.
    """
    chosen = config.model_dump(mode="json", exclude_defaults=True, exclude={"name": True})
    dataset = {k: v for k, v in chosen.pop("dataset", {}).items() if k != "path"}
    files = {"priors.file": config.priors.file, "dataset.mask": config.dataset.mask}
    named: list[object] = [_content(name, field) for field, name in files.items() if name]
    named += [_listing(path) for path in _folders_beside(config, folder)]
    return _hash([chosen, dataset, data, *named])[:_KEY_DIGITS]


def data_hash(source: Rendered | Recorded) -> str:
    """Hash of what a recording holds: its seeds, or its files.

    Of a folder, links in it followed, the text files count by their content, images by name and
    size, other files (bags) by name, size and both ends; a single file counts without its name.

    Raises
    ------
    DataError
        A file that can't be read.
    """
    if isinstance(source, Rendered):
        return scenario_hash(source.scenario, WORLD_VERSION)
    return _hash(_listing(source.folder))[:_KEY_DIGITS]


@cache
def code_hash() -> str:
    """Hash of the sources of :data:`ESTIMATE_ROOMS` and of the versions of the libraries."""
    root = Path(p2gd_fgo.__file__).parent
    digest = hashlib.sha256()
    for room in ESTIMATE_ROOMS:
        for path in sorted([*root.glob(f"{room}.py"), *root.glob(f"{room}/**/*.py")]):
            digest.update(f"{path.relative_to(root).as_posix()}\n".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    known = {name: number for name, number in versions().items() if name != "p2gd_fgo"}
    digest.update(json.dumps(known, sort_keys=True).encode())
    return digest.hexdigest()[:_KEY_DIGITS]


@cache
def versions() -> dict[str, str]:
    """Versions of the package and of the libraries that can change an estimate."""
    found = {"p2gd_fgo": p2gd_fgo.__version__}
    found |= {name: metadata.version(name) for name in _LIBRARIES}
    for name in _OPENCV:
        try:
            found["opencv"] = metadata.version(name)
            break
        except metadata.PackageNotFoundError:
            continue
    return found


def _content(name: str, field: str) -> str:
    try:
        return hashlib.sha256(user_path(name, field).read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"{name}: can't be read: {error.strerror}") from None


def _folders_beside(config: Config, recording: Path | None) -> Iterator[Path]:
    """What a configuration names and the recording's own hash doesn't hold."""
    if config.dataset.calibration:
        yield user_path(config.dataset.calibration, "dataset.calibration")
    if config.dataset.masks:
        masks = (recording or Path()) / user_path(config.dataset.masks, "dataset.masks")
        inside = recording is not None and masks.resolve().is_relative_to(recording.resolve())
        if masks.is_absolute() and not inside:
            yield masks


def _listing(top: Path) -> list[object]:
    """Name, size and content of every file below a folder, or of the file itself."""

    def refuse(error: OSError) -> None:
        raise error

    found: list[object] = []
    seen: set[str] = set()
    try:
        if top.is_file():
            return [["", *_held(top)]]
        for below, folders, files in os.walk(top, followlinks=True, onerror=refuse):
            place = os.path.realpath(below)
            if place in seen:  # a link to a folder above
                folders.clear()
                continue
            seen.add(place)
            folders.sort()
            paths = [Path(below, name) for name in sorted(files)]
            found += [[path.relative_to(top).as_posix(), *_held(path)] for path in paths]
    except OSError as error:
        raise DataError(f"{top}: can't be read whole: {error}") from None
    return found


def _held(path: Path) -> tuple[int, str]:
    size, suffix = path.stat().st_size, path.suffix.lower()
    if suffix in _TEXT:
        return size, hashlib.sha256(path.read_bytes()).hexdigest()
    return size, "" if suffix in _IMAGES else _ends(path, size)


def _ends(path: Path, size: int) -> str:
    with path.open("rb") as file:
        digest = hashlib.sha256(file.read(_END_BYTES))
        file.seek(max(0, size - _END_BYTES))
        digest.update(file.read(_END_BYTES))
    return digest.hexdigest()


def _hash(data: object) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
