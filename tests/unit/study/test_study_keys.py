"""Hashes of data and code."""

from __future__ import annotations

from pathlib import Path

import pytest

import p2gd_fgo
from p2gd_fgo.config import load_config, override
from p2gd_fgo.errors import DataError
from p2gd_fgo.study import keys
from p2gd_fgo.study.keys import ESTIMATE_ROOMS, code_hash, data_hash, run_key, versions
from p2gd_fgo.study.runs import Recorded


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    folder = tmp_path / "recording"
    (folder / "images").mkdir(parents=True)
    (folder / "imu.csv").write_text("1,2,3")
    (folder / "images" / "1.png").write_bytes(b"abc")
    (folder / "all.bag").write_bytes(bytes(200_000))
    return folder


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("imu.csv", b"1,2,4"),
        ("images/1.png", b"abcd"),
        ("images/2.png", b""),
        ("all.bag", bytes(199_999) + b"x"),
        ("all.bag", b"x" + bytes(199_999)),
    ],
)
def test_other_data_have_another_hash(name: str, content: bytes, recording: Path) -> None:
    before = data_hash(Recorded(recording, 1, 1))
    assert data_hash(Recorded(recording, 1, 1)) == before
    (recording / name).write_bytes(content)
    assert data_hash(Recorded(recording, 1, 1)) != before


def test_where_a_recording_lies_does_not_matter(recording: Path, tmp_path: Path) -> None:
    before = data_hash(Recorded(recording, 1, 1))
    moved = recording.rename(tmp_path / "elsewhere")
    assert data_hash(Recorded(moved, 1, 1)) == before


def test_a_file_of_priors_counts_by_its_content(tmp_path: Path) -> None:
    path = tmp_path / "plan.tum"
    path.write_text("1")
    config = override(load_config(), {"priors.source": "file", "priors.file": str(path)})
    before = run_key(config, "data")
    path.write_text("2")
    assert run_key(config, "data") != before
    path.unlink()
    with pytest.raises(DataError, match=r"plan\.tum: can't be read"):
        run_key(config, "data")


def test_calibration_and_masks_count_by_what_they_hold(tmp_path: Path, recording: Path) -> None:
    calibration, masks = tmp_path / "camchain.yaml", tmp_path / "masks"
    masks.mkdir()
    calibration.write_text("1")
    (masks / "1.png").write_bytes(b"a")
    names = {"dataset.calibration": str(calibration), "dataset.masks": "../masks"}
    config = override(load_config(), names)

    def key() -> str:
        return run_key(config, "data", recording)

    keys = [key()]
    calibration.write_text("2")
    keys.append(key())
    (masks / "1.png").write_bytes(b"ab")
    keys.append(key())
    assert len(set(keys)) == 3 and key() == keys[-1]
    calibration.unlink()
    with pytest.raises(DataError, match=r"camchain\.yaml: can't be read"):
        key()


def test_masks_in_the_recording_count_with_it(recording: Path) -> None:
    config = override(load_config(), {"dataset.masks": "images"})
    assert run_key(config, "data", recording) == run_key(config, "data")


def test_folders_behind_links_and_single_files_count(tmp_path: Path, recording: Path) -> None:
    linked = tmp_path / "linked"
    linked.mkdir()
    (linked / "mav0").symlink_to(recording)
    (recording / "round").symlink_to(linked)  # an endless way down, were it followed
    for place, changed in ((linked, "imu.csv"), (recording / "all.bag", "all.bag")):
        before = data_hash(Recorded(place, 1, 1))
        (recording / changed).write_bytes(b"another content")
        assert data_hash(Recorded(place, 1, 1)) != before


def test_the_code_of_every_room_that_estimates_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = Path(p2gd_fgo.__file__).parent
    assert all((root / f"{r}.py").is_file() or (root / r).is_dir() for r in ESTIMATE_ROOMS)
    copied = tmp_path / "package"
    for room in ESTIMATE_ROOMS:
        for path in [*root.glob(f"{room}.py"), *root.glob(f"{room}/**/*.py")]:
            place = copied / path.relative_to(root)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(path.read_bytes())
    unchanged = code_hash()
    monkeypatch.setattr(p2gd_fgo, "__file__", str(copied / "__init__.py"))
    hash_now = code_hash.__wrapped__
    assert hash_now() == unchanged
    for name in ("odometry.py", "backends/msckf/update.py", "evaluation/evaluate.py"):
        before = hash_now()
        with (copied / name).open("a") as file:
            file.write("\n# changed\n")
        assert hash_now() != before, name


def test_other_libraries_are_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {"p2gd_fgo", "gtsam", "numpy", "opencv"} <= versions().keys()
    before = code_hash()
    monkeypatch.setattr(keys, "versions", lambda: versions() | {"gtsam": "0"})
    assert code_hash.__wrapped__() != before
