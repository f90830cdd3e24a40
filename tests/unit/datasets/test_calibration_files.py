"""Calibration that lies apart: which file is taken, which way round, what is refused."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from asl_folder import AslFolder
from written_recordings import NOISE, T_IMU_CAM, chain, write_chain

from p2gd_fgo.datasets.calibration_files import find_calibration, load_calibration
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import EquidistantCamera, RadTanCamera
from p2gd_fgo.geometry.pose import inverse

KALIBR: dict[str, Any] = {"T_imu_cam": None, "T_cam_imu": inverse(T_IMU_CAM).tolist()}


def test_openvins_and_kalibr_say_the_same(tmp_path: Path) -> None:
    openvins = load_calibration(write_chain(tmp_path / "a"), "cam0")
    kalibr = load_calibration(write_chain(tmp_path / "b", **KALIBR), "cam0")
    both = load_calibration(write_chain(tmp_path / "c", T_cam_imu=KALIBR["T_cam_imu"]), "cam0")
    for found in (openvins, kalibr, both):
        np.testing.assert_allclose(found.T_imu_cam, T_IMU_CAM, atol=1e-12)
        assert found.camera == RadTanCamera(64, 48, 40.0, 41.0, 31.5, 23.5, -0.1, 0.01, 2e-4, 1e-5)
        assert found.time_offset_s == 0.003
        assert found.imu_noise is not None and found.imu_noise.accel_random_walk == 3e-3


def test_single_files(tmp_path: Path) -> None:
    folder = write_chain(tmp_path)
    alone = load_calibration(folder / "kalibr_imucam_chain.yaml", "cam0")
    assert alone.imu_noise is None
    main = folder / "estimator_config.yaml"
    main.write_text(
        '%YAML:1.0 # OpenVINS\n\nuse_fej: true\nrelative_config_imu: "kalibr_imu_chain.yaml"\n'
        'relative_config_imucam: "kalibr_imucam_chain.yaml"\n'
    )
    assert load_calibration(main, "cam0").imu_noise is not None
    assert load_calibration(folder, "cam0").imu_noise is not None
    (folder / "kalibr_imu_chain.yaml").write_text(yaml.safe_dump(NOISE))  # Kalibr's imu.yaml
    assert load_calibration(folder, "cam0").imu_noise is not None
    assert find_calibration(folder, "cam1") is None


def test_asl_files_and_folders(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap").write()
    for path in (folder.root, folder.mav0, folder.mav0 / "cam0" / "sensor.yaml"):
        found = load_calibration(path, "cam0")
        assert found.camera.fx == 40.0 and found.imu_noise is not None


@pytest.mark.parametrize(
    ("model", "k", "lens"),
    [
        ("equidistant", [0.1, 0.2, 0.3, 0.4], EquidistantCamera),
        ("none", [], RadTanCamera),
        ("radial-tangential", [0.1, 0.2, 0.3, 0.4, 0.5], RadTanCamera),
    ],
)
def test_lenses(tmp_path: Path, model: str, k: list[float], lens: type) -> None:
    changes = {"distortion_model": model, "distortion_coeffs": k}
    camera = load_calibration(write_chain(tmp_path, **changes), "cam0").camera
    assert isinstance(camera, lens)
    wanted = k or [0.0] * 4
    names = ("k1", "k2", "p1", "p2", "k3") if lens is RadTanCamera else ("k1", "k2", "k3", "k4")
    assert [getattr(camera, name) for name in names][: len(wanted)] == wanted


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"T_imu_cam": None}, "neither T_imu_cam nor T_cam_imu is there"),
        ({"T_cam_imu": T_IMU_CAM.tolist()}, "T_imu_cam and T_cam_imu contradict each other"),
        ({"T_imu_cam": (2 * np.eye(4)).tolist()}, "T_imu_cam is not a rigid transform"),
        ({"camera_model": "omni"}, "camera_model is 'omni', known is 'pinhole'"),
        ({"distortion_model": "fov"}, "distortion_model is 'fov', known are equidistant, none"),
        ({"distortion_coeffs": [0.1, 0.2]}, "distortion_coeffs holds 2 numbers, needed are 4 or 5"),
        ({"intrinsics": [1.0, float("nan"), 1.0, 1.0]}, "intrinsics is .* finite"),
        ({"resolution": None}, "resolution is missing"),
        ({"timeshift_cam_imu": "late"}, "timeshift_cam_imu is 'late'|not numbers"),
    ],
)
def test_chains_that_cannot_be_used(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DataError, match=message) as caught:
        load_calibration(write_chain(tmp_path, **changes), "cam0")
    assert "kalibr_imucam_chain.yaml: cam0: " in str(caught.value)


def test_nothing_or_too_much(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"dataset\.calibration: .*nowhere doesn't exist"):
        load_calibration(tmp_path / "nowhere", "cam0")
    with pytest.raises(DataError, match="no camera 'cam0' with intrinsics"):
        load_calibration(tmp_path, "cam0")
    write_chain(tmp_path)
    with pytest.raises(DataError, match="no camera 'cam1' with intrinsics"):
        load_calibration(tmp_path, "cam1")
    # Of a camera chain without a pose and one with, the one with the pose is meant.
    (tmp_path / "camchain.yaml").write_text(yaml.safe_dump(chain(T_imu_cam=None)))
    assert load_calibration(tmp_path, "cam0").camera.fx == 40.0
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(chain()))
    with pytest.raises(DataError, match=r"2 files with 'cam0' \(kalibr_imucam_chain.*other\.yaml"):
        load_calibration(tmp_path, "cam0")
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(NOISE))
    with pytest.raises(DataError, match=r"the IMU's noise is in .* and in"):
        load_calibration(tmp_path, "cam0")
    (tmp_path / "other.yaml").unlink()
    turned = {"imu0": {"T_i_b": np.diag([-1.0, -1.0, 1.0, 1.0]).tolist()} | NOISE}
    (tmp_path / "kalibr_imu_chain.yaml").write_text(yaml.safe_dump(turned))
    with pytest.raises(DataError, match="T_i_b is not the identity"):
        load_calibration(tmp_path, "cam0")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"Tw": (1.2 * np.eye(3)).tolist()}, "imu0: Tw is .* and only the identity is known"),
        ({"Tg": np.full((3, 3), 0.1).tolist()}, "imu0: Tg is .* and only 0 is known"),
        ({"R_IMUtoGYRO": np.eye(3)[[1, 0, 2]].tolist()}, "imu0: R_IMUtoGYRO is"),
        ({"gyroscopes": {"M": np.diag([1.1, 1, 1]).tolist()}}, "imu0: gyroscopes: M is"),
        ({"accelerometers": {"M": "[1, 2]"}}, "M is"),
        ({"time_offset": 0.05}, "imu0: time_offset is 0.05, but the clock here is this IMU's"),
    ],
)
def test_what_no_back_end_models_is_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    write_chain(tmp_path)
    path = tmp_path / "kalibr_imu_chain.yaml"
    nominal: dict[str, Any] = {key: np.eye(3).tolist() for key in ("Tw", "Ta", "R_IMUtoGYRO")}
    nominal |= {"Tg": np.zeros((3, 3)).tolist(), "time_offset": 0.0}
    path.write_text(yaml.safe_dump({"imu0": NOISE | nominal}))
    assert load_calibration(tmp_path, "cam0").imu_noise is not None
    path.write_text(yaml.safe_dump({"imu0": NOISE | nominal | changes}))
    with pytest.raises(DataError, match=message):
        load_calibration(tmp_path, "cam0")


def test_the_noise_of_an_asl_recording_stays_with_another_chain(tmp_path: Path) -> None:
    folder = AslFolder(tmp_path / "lap").write()
    chain_alone = write_chain(tmp_path / "chain") / "kalibr_imucam_chain.yaml"
    found = folder.open(calibration=str(chain_alone)).calibration
    assert found.time_offset_s == 0.003  # the chain's
    assert found.imu_noise == folder.open().calibration.imu_noise is not None


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    "text",
    [
        BOMB + "cam0: *i\n",
        "cam0: " + "[" * 5000,
        "cam0: {" * 5000,
        "cam0: !!python/object/apply:os.system ['true']",
        "cam0: " + "x, " * 200_000,
        "\x00\x01\x02",
        "cam0: &a\n  b: *a\n",
        "cam0: 1\ncam0: 2\n",
    ],
    ids=["laughs", "lists", "maps", "python", "huge", "binary", "circle", "twice"],
)
def test_hostile_yaml(tmp_path: Path, text: str) -> None:
    path = tmp_path / "chain.yaml"
    path.write_text(text)
    begin = time.perf_counter()
    with pytest.raises(DataError, match=r"chain\.yaml") as caught:
        load_calibration(path, "cam0")
    assert time.perf_counter() - begin < 5.0
    assert len(str(caught.value)) < 1000 and "\n" not in str(caught.value)
