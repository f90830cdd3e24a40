"""The recording of a run, rendered where it is needed: once a machine, whoever asks first."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from p2gd_fgo.datasets.csv_tables import read_image_list
from p2gd_fgo.errors import DataError
from p2gd_fgo.simulation import recorder
from p2gd_fgo.simulation.demo import default_cache
from p2gd_fgo.simulation.presets import images_hash
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.study.runs import Recorded, Rendered

Progress = Callable[[int, int], None]

_LAST_WRITTEN = "scenario.yaml"
_FRAME_FOLDERS = ("cam0", "mask0")


def images_key(source: Rendered) -> str:
    """What recordings with the same images share."""
    return images_hash(source.scenario, recorder.WORLD_VERSION)


def provide(source: Rendered | Recorded, progress: Progress | None = None) -> Path:
    """Folder of a recording, rendered into the user's cache first where it isn't there.

    Images are rendered once for all seeds of the IMU's noise: the recording of the scenario without
    such a seed has them, the others link them.

    Raises
    ------
    ConfigError, DataError
        A scenario that can't be rendered, or a folder that isn't there or can't be written.
    """
    if isinstance(source, Recorded):
        if not source.folder.exists():
            raise DataError(f"{source.folder}: the recording is not on this machine")
        return source.folder
    folder = recorder.default_folder(source.scenario)
    if _complete(folder):
        return folder
    with _locked(images_key(source)):
        if _complete(folder):
            return folder
        plain = _without_imu_seed(source.scenario)
        shared = recorder.default_folder(plain)
        _record(plain, shared, None, progress)
        if folder != shared:
            _record(source.scenario, folder, shared, None)
    return folder


def is_rendered(source: Rendered) -> bool:
    """Whether the images are there already."""
    return _complete(recorder.default_folder(_without_imu_seed(source.scenario)))


def _without_imu_seed(scenario: Scenario) -> Scenario:
    imu = scenario.imu.model_copy(update={"seed": None})
    return scenario.model_copy(update={"imu": imu})


def _record(
    scenario: Scenario, folder: Path, reuse: Path | None, progress: Progress | None
) -> None:
    if not _complete(folder):
        recorder.record(scenario, folder, jobs=1, reuse=reuse, progress=progress)


def _complete(folder: Path) -> bool:
    """Whether everything was written: a folder is one scenario's, and never changes after that."""
    if not (folder / _LAST_WRITTEN).is_file():
        return False
    wanted = set(read_image_list(folder / "mav0" / "cam0" / "data.csv")[1])
    frames = (folder / "mav0" / name / "data" for name in _FRAME_FOLDERS)
    return all(
        data.is_dir() and wanted <= {path.name for path in data.iterdir()} for data in frames
    )


@contextmanager
def _locked(name: str) -> Iterator[None]:
    """Hold a lock of this name on this machine; a process that dies lets go of it."""
    folder = default_cache() / "simulated" / ".locks"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / name).open("w")
    except OSError as error:
        raise DataError(
            f"{folder}: can't be written ({error.strerror}): point XDG_CACHE_HOME to a directory "
            "that can be"
        ) from None
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
