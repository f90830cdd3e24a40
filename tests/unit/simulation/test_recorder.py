"""The recorder: equal bytes on any number of processes, resumed, relinked, and careful."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.opening import open_sequence
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.simulation.presets import load_scenario
from p2gd_fgo.simulation.recorder import contact_sheet, record
from p2gd_fgo.simulation.scenario import Scenario

TINY: dict[str, object] = {
    "name": "tiny",
    "seed": 2,
    "duration_s": 0.8,
    "world": {"kind": "campus", "block_m": [20, 24], "detail": 0.25},
    "traffic": {"people": 6},
    "vehicle": {
        "kind": "robot", "speed": [0.8, 1.5], "turn_rate_deg": 20, "turn_radius_m": 2.5,
        "standstill_s": 0.0, "imu_height_m": 0.6,
    },
    "camera": {
        "width": 160, "height": 120, "focal": [100, 100], "center": [80, 60],
        "distortion": [-0.1, 0.05, 0, 0], "position": [0.3, 0, 0.1], "depth_every_px": 40,
        "exposure_ms": 3.0, "exposure_swing": 0.1,
    },
    "imu": {"rate_hz": 200},
}  # fmt: skip


def tiny(**imu: object) -> Scenario:
    return Scenario.model_validate({**TINY, "imu": {"rate_hz": 200, **imu}})


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()
    }  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tiny(), tmp_path_factory.mktemp("made") / "tiny").folder


def test_the_recording_is_read_as_any_other(folder: Path) -> None:
    sequence = open_sequence(DatasetConfig(path=str(folder)))
    assert not sequence.events and len(sequence.image_stamps_ns) == 9
    assert sequence.image(3).shape == (120, 160)
    assert sequence.truth is not None and sequence.truth.gyro_bias is not None
    masks = sorted((folder / "mav0" / "mask0" / "data").glob("*.png"))
    assert [m.stem for m in masks] == [str(s) for s in sequence.image_stamps_ns]
    for path in masks:
        mask = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert mask is not None and mask.shape == (120, 160)
        assert set(np.unique(mask)) <= {0, 255} and mask.max() == 255
    assert load_scenario(folder / "scenario.yaml") == tiny()


def test_equal_bytes_with_two_processes(folder: Path, tmp_path: Path) -> None:
    made = record(load_scenario(folder / "scenario.yaml"), tmp_path / "again", jobs=2)
    assert files_of(made.folder) == files_of(folder)


def test_what_is_missing_is_made_again_and_nothing_else(folder: Path, tmp_path: Path) -> None:
    made = record(tiny(), tmp_path / "tiny", reuse=folder)
    assert made.rendered == 0 and files_of(made.folder) == files_of(folder)
    images = sorted((made.folder / "mav0" / "cam0" / "data").glob("*.png"))
    images[4].unlink()
    again = record(tiny(), made.folder)
    assert again.rendered == 1 and files_of(made.folder) == files_of(folder)


def test_another_imu_seed_needs_no_rendering(folder: Path, tmp_path: Path) -> None:
    made = record(tiny(seed=9), tmp_path / "noise", reuse=folder)
    one, other = files_of(folder), files_of(made.folder)
    assert made.rendered == 0
    assert {name for name in one if one[name] != other[name]} == {
        "mav0/imu0/data.csv", "mav0/state_groundtruth_estimate0/data.csv", "scenario.yaml"
    }  # fmt: skip


def test_a_time_offset_goes_into_stamps_and_calibration(tmp_path: Path, folder: Path) -> None:
    made = record(tiny(time_offset_s=0.02), tmp_path / "late")
    late = open_sequence(DatasetConfig(path=str(made.folder)))
    plain = open_sequence(DatasetConfig(path=str(folder)))
    assert late.calibration.time_offset_s == 0.02
    np.testing.assert_array_equal(plain.image_stamps_ns - late.image_stamps_ns, 20_000_000)
    np.testing.assert_array_equal(late.image(2), plain.image(2))


def test_depths_agree_with_a_ground_plane(folder: Path) -> None:
    rows = np.loadtxt(
        sorted((folder / "mav0" / "depth0" / "data").glob("*.csv"))[0], delimiter=",", skiprows=1
    )
    low = rows[rows[:, 1] == 100.0]
    assert len(low) >= 3
    # 40 px under the horizon, 0.7 m high, f = 100: about 1.75 m, less by the lens' distortion.
    np.testing.assert_allclose(low[:, 2].max(), 1.75, atol=0.25)


def test_foreign_folders_and_skies_are_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all of it")
    with pytest.raises(ConfigError, match="holds other files"):
        record(tiny(), tmp_path / "mine")
    with pytest.raises(ConfigError, match="no simulated recording"):
        record(tiny(), tmp_path / "mine", overwrite=True)
    other = Scenario.model_validate({**TINY, "seed": 3})
    with pytest.raises(ConfigError, match="another recording"):
        record(other, folder)
    with pytest.raises(ConfigError, match="images are of another scenario"):
        record(other, tmp_path / "new", reuse=folder)
    camera = dict(TINY["camera"])  # type: ignore[call-overload]
    sky = Scenario.model_validate({**TINY, "camera": {**camera, "tilt_deg": -80}})
    with pytest.raises(ConfigError, match=r"camera\.tilt_deg -80: .* looks at nothing"):
        record(sky, tmp_path / "sky")


def test_a_contact_sheet(folder: Path, tmp_path: Path) -> None:
    contact_sheet(folder, 4, tmp_path / "sheet.jpg", width=320)
    sheet = cv2.imread(str(tmp_path / "sheet.jpg"), cv2.IMREAD_GRAYSCALE)
    assert sheet is not None and sheet.shape == (240, 320)
