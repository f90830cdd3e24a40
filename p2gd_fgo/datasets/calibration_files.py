"""Calibration that lies apart from the recording: Kalibr's, OpenVINS's or ASL's YAML.

The files are told apart by their keys, never by their names. ``T_imu_cam`` takes camera points to
the IMU (OpenVINS), ``T_cam_imu`` is its inverse (Kalibr); ``timeshift_cam_imu`` is t_imu - t_cam.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl_calibration import load_asl_calibration
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.datasets.calibration_fields import (
    NOISE_KEYS,
    imu_noise,
    known_model,
    make_camera,
    numbers,
    read_yaml,
    rigid_transform,
)
from p2gd_fgo.datasets.imu_intrinsics import check_plain_imu
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import pose
from p2gd_fgo.types import FloatArray
from p2gd_fgo.user_paths import user_path

_MAX_FILES = 100
_AGREE = 1e-3


@dataclass(frozen=True, slots=True)
class _Document:
    path: Path
    data: dict[str, Any]


def load_calibration(path: Path, camera: str) -> Calibration:
    """Read what ``dataset.calibration`` names.

    Parameters
    ----------
    path
        A YAML file (camera chain; OpenVINS's ``estimator_config.yaml`` leads to its two others;
        an ASL ``sensor.yaml``) or a folder that holds one, the IMU's file beside it.
    camera
        Key of the camera in a chain, or its folder: ``cam0``.

    Raises
    ------
    DataError
        Nothing there, nothing usable, two that could be meant, or a field that can't be used.
    """
    if path.is_dir():
        return _from_folder(path, camera)
    if not path.is_file():
        raise DataError(
            f"dataset.calibration: {path} doesn't exist: give a YAML file with the camera "
            "(Kalibr, OpenVINS, ASL), or the folder of such files"
        )
    document = _Document(path, read_yaml(path))
    if "T_BS" in document.data:
        return load_asl_calibration(path, path.parent.parent / "imu0" / "sensor.yaml")
    return _join([document, *_referred(document)], camera, str(path))


def named_calibration(config: DatasetConfig) -> Calibration:
    """Read ``dataset.calibration``, which is set.

    Raises
    ------
    DataError
        As :func:`load_calibration`.
    """
    assert config.calibration is not None
    path = user_path(config.calibration, "dataset.calibration")
    return load_calibration(path, config.camera)


def find_calibration(folder: Path, camera: str) -> Calibration | None:
    """Read the calibration that lies in a folder of other things; None if there is none.

    Raises
    ------
    DataError
        Two that could be meant, or a field that can't be used.
    """
    documents = list(_documents(folder))
    return _join(documents, camera, str(folder)) if _chains(documents, camera) else None


def with_offset(calibration: Calibration, time_offset_s: float | None) -> Calibration:
    """The calibration with ``dataset.time_offset_s``, where that is given."""
    if time_offset_s is None:
        return calibration
    return replace(calibration, time_offset_s=time_offset_s)


def _from_folder(folder: Path, camera: str) -> Calibration:
    for root in (folder / "mav0", folder):
        if (root / camera / "sensor.yaml").is_file():
            return load_asl_calibration(
                root / camera / "sensor.yaml", root / "imu0" / "sensor.yaml"
            )
    return _join(list(_documents(folder)), camera, str(folder))


def _documents(folder: Path) -> Iterator[_Document]:
    """Those of a folder's YAML files that can be read."""
    paths = sorted(path for path in folder.glob("*") if path.suffix in (".yaml", ".yml"))
    for path in paths[:_MAX_FILES]:
        try:
            yield _Document(path, read_yaml(path))
        except DataError:  # not ours to judge: the folder may hold anything
            continue


def _referred(document: _Document) -> Iterator[_Document]:
    for key in ("relative_config_imucam", "relative_config_imu"):
        name = document.data.get(key)
        if isinstance(name, str):
            path = document.path.parent / name
            yield _Document(path, read_yaml(path))


def _chains(documents: list[_Document], camera: str) -> list[_Document]:
    chains = [d for d in documents if isinstance(d.data.get(camera), dict)]
    posed = [d for d in chains if {"T_imu_cam", "T_cam_imu"} & d.data[camera].keys()]
    return posed or chains


def _join(documents: list[_Document], camera: str, where: str) -> Calibration:
    chains = _chains(documents, camera)
    if len(chains) != 1:
        found = ", ".join(d.path.name for d in chains)
        raise DataError(
            f"dataset.calibration: {where} holds "
            + (
                f"{len(chains)} files with '{camera}' ({found}): name one of them"
                if chains
                else f"no camera '{camera}' with intrinsics: give a Kalibr or OpenVINS camera "
                "chain or an ASL sensor.yaml, or its folder, and the key by dataset.camera"
            )
        )
    chain = chains[0]
    return replace(
        _camera(chain.data[camera], f"{chain.path}: {camera}"), imu_noise=_noise(documents)
    )


def _camera(data: dict[str, Any], where: str) -> Calibration:
    if data.get("camera_model", "pinhole") != "pinhole":
        raise DataError(f"{where}: camera_model is {data['camera_model']!r}, known is 'pinhole'")
    model = data.get("distortion_model")
    counts = known_model(model, where)
    intrinsics = numbers(data, "intrinsics", (4,), where)
    size = numbers(data, "resolution", (2,), where)
    k = (
        []
        if counts == (0,)
        else numbers(data, "distortion_coeffs", counts, where, f" with {model}")
    )
    shift = data.get("timeshift_cam_imu")
    return Calibration(
        camera=make_camera(model, size, intrinsics, k, where),
        T_imu_cam=_extrinsics(data, where),
        imu_noise=None,
        time_offset_s=0.0 if shift is None else numbers(data, "timeshift_cam_imu", (1,), where)[0],
    )


def _extrinsics(data: dict[str, Any], where: str) -> FloatArray:
    direct = rigid_transform(data, "T_imu_cam", where) if "T_imu_cam" in data else None
    inverse = (
        pose.inverse(rigid_transform(data, "T_cam_imu", where)) if "T_cam_imu" in data else None
    )
    if direct is None and inverse is None:
        raise DataError(
            f"{where}: neither T_imu_cam nor T_cam_imu is there: the chain of a camera calibration "
            "alone doesn't hold it, give the one of the camera-IMU calibration"
        )
    if direct is not None and inverse is not None and np.abs(direct - inverse).max() > _AGREE:
        raise DataError(f"{where}: T_imu_cam and T_cam_imu contradict each other: leave one out")
    chosen = direct if direct is not None else inverse
    assert chosen is not None
    return chosen


def _noise(documents: list[_Document]) -> ImuNoise | None:
    sections = []
    for document in documents:
        for name, data in (("", document.data), (": imu0", document.data.get("imu0"))):
            if isinstance(data, dict) and any(key in data for key in NOISE_KEYS):
                sections.append((data, f"{document.path}{name}"))
    if not sections:
        return None
    if len(sections) > 1:
        raise DataError(
            f"the IMU's noise is in {sections[0][1]} and in {sections[1][1]}: leave one, or name "
            "the file of the camera by dataset.calibration and give the noise by imu.*"
        )
    data, where = sections[0]
    check_plain_imu(data, where)
    return imu_noise(data, where)
