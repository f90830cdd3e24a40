"""Whatever is wrong with a recording, every reader says it in one sentence, and soon."""

from __future__ import annotations

import random
import re
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from asl_folder import AslFolder
from written_recordings import (
    Content,
    content,
    write_bag,
    write_chain,
    write_kaist_folder,
    write_kitti_folder,
    write_tum_folder,
)

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import DataError, P2gdError

_LONGEST_S = 10.0
_ROUNDS = 100


def write_asl_folder(folder: Path, made: Content) -> Path:
    return AslFolder(folder).write().root


FOLDERS: dict[str, Callable[[Path, Content], Path]] = {
    "asl": write_asl_folder,
    "tum": write_tum_folder,
    "kaist": write_kaist_folder,
    "kitti_raw": write_kitti_folder,
}
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
NONSENSE = (
    *(b"nan", b"inf", b"-inf", b"", b"x", b"-1", b"0", b"1e400", b"1e-400", b"\xff\xfe", b"\x00"),
    *(b"9223372036854775807", b"-9223372036854775808", b"4611686018427387905"),
    *(b"9" * 30, b"9" * 5000, b"1e18", b"0x10", b"1_000", "٣".encode(), b"\n", b",", b"[", b": "),
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A valid recording of each format."""
    root, made = tmp_path_factory.mktemp("whole"), content()
    write_chain(root / "chain")
    paths = {name: write(root / name / "drive", made) for name, write in FOLDERS.items()}
    for kind in ("ros1", "sqlite3", "mcap"):
        (root / kind).mkdir()
        path = root / kind / ("run.bag" if kind == "ros1" else "run")
        images = "png" if kind == "mcap" else "mono8"
        paths[kind] = write_bag(path, made, kind=kind, images=images)
    return paths


def spoil(data: bytes, rng: random.Random) -> bytes:
    """One fault of a kind that files have: cut, overwritten, a number replaced, a line lost."""
    kind = rng.randrange(6)
    if kind == 0:
        return data[: rng.randrange(len(data) + 1)]
    if kind == 1:
        at, length = rng.randrange(len(data) + 1), rng.choice((1, 4, 64, 1000))
        return data[:at] + rng.randbytes(length) + data[at + length :]
    if kind == 2 and (found := list(NUMBER.finditer(data))):
        hit = rng.choice(found)
        return data[: hit.start()] + rng.choice(NONSENSE) + data[hit.end() :]
    if kind == 3:
        lines = data.split(b"\n")
        del lines[rng.randrange(len(lines))]
        return b"\n".join(lines)
    if kind == 4:
        words = data.split(b",") if b"," in data else data.split(b" ")
        del words[rng.randrange(len(words))]
        return b",".join(words)
    return rng.choice((b"", b"\x00" * 100, rng.randbytes(300), data + data, b"#\n", b"1,2\n1,2\n"))


def use(path: Path, name: str) -> None:
    """Open and read all that a run reads."""
    bag = name not in FOLDERS
    calibration = str(path.parent / "chain") if bag else None
    sequence = open_sequence(
        DatasetConfig(path=str(path), format="bag" if bag else name, calibration=calibration)
    )
    for k in range(len(sequence.image_stamps_ns)):
        try:
            assert sequence.image(k).shape == (48, 64)
        except DataError as error:
            check_sentence(error)
    assert (np.diff(sequence.image_stamps_ns) > 0).all() and (
        np.diff(sequence.imu.stamps_ns) > 0
    ).all()
    assert np.isfinite(sequence.imu.gyro).all() and np.isfinite(sequence.imu.accel).all()
    if sequence.truth is not None:
        assert np.isfinite(sequence.truth.trajectory.T_world_imu).all()


def check_sentence(error: P2gdError) -> None:
    text = str(error)
    assert "\n" not in text and 10 < len(text) < 6000, text[:500]


@pytest.mark.parametrize("name", ["asl", "tum", "kaist", "kitti_raw", "ros1", "sqlite3", "mcap"])
def test_spoiled_files(whole: dict[str, Path], tmp_path: Path, name: str) -> None:
    rng = random.Random(name)
    source = whole[name].parent
    shutil.copytree(source, tmp_path / "copy")
    shutil.copytree(source.parent / "chain", tmp_path / "copy" / "chain")
    path = tmp_path / "copy" / whole[name].relative_to(source)
    files = list(files_of(path))
    refused = 0
    for round_number in range(_ROUNDS):
        file = rng.choice(files)
        data = file.read_bytes()
        file.write_bytes(spoil(data, rng))
        begin = time.process_time()
        try:
            use(path, name)
        except P2gdError as error:
            check_sentence(error)
            assert str(tmp_path) in str(error) or "dataset." in str(error) or "offset" in str(error)
            refused += 1
        except Exception as error:
            raise AssertionError(f"round {round_number}: {file.name} spoiled") from error
        assert time.process_time() - begin < _LONGEST_S
        file.write_bytes(data)
    assert refused > _ROUNDS // 4


def files_of(path: Path) -> Iterator[Path]:
    """The files of a recording, those there are many of only once."""
    if path.is_file():
        yield path
        return
    seen: set[tuple[Path, str]] = set()
    for file in sorted(path.rglob("*")):
        kind = (
            (file.parent, file.suffix)
            if file.parent.name in ("data", "rgb", "stereo_left")
            else (file, "")
        )
        if file.is_file() and kind not in seen:
            seen.add(kind)
            yield file
    if path.parent.name == "copy":
        yield from path.parent.glob("calib_*.txt")


@pytest.mark.parametrize("name", ["asl", "tum", "kaist", "kitti_raw", "ros1", "sqlite3", "mcap"])
def test_every_file_missing_or_a_folder(whole: dict[str, Path], tmp_path: Path, name: str) -> None:
    source = whole[name].parent
    for k, file in enumerate(files_of(whole[name])):
        for make in (None, Path.mkdir):
            root = tmp_path / f"{k}{make is None}"
            shutil.copytree(source, root)
            shutil.copytree(source.parent / "chain", root / "chain")
            broken = root / file.relative_to(source)
            broken.unlink()
            if make is not None:
                make(broken)
            try:
                use(root / whole[name].relative_to(source), name)
            except P2gdError as error:
                check_sentence(error)
            shutil.rmtree(root)


def test_stamps_beyond_reason(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "a")
    folder.imu[3][0] = str((1 << 62) + 1)
    with pytest.raises(DataError, match=r"imu0/data\.csv, line 5: stamp .* more than 146 years"):
        folder.write().open()
    folder = AslFolder(tmp_path / "b")
    folder.imu = [[str(-int(row[0])), *row[1:]] for row in folder.imu]
    with pytest.raises(DataError, match="images and IMU don't overlap in time"):
        folder.write().open()
    with pytest.raises(DataError, match="the time offset is 1e\\+06 s, more than a day"):
        AslFolder(tmp_path / "c").write().open(time_offset_s=1e6)


def test_a_picture_of_a_billion_pixels(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "a").write()
    data = bytearray(folder.image(2).read_bytes())
    data[16:24] = (1 << 20).to_bytes(4, "big") * 2
    folder.image(2).write_bytes(data)
    with pytest.raises(DataError, match="not an image that can be decoded"):
        folder.open().image(2)
