"""A small ASL folder on disk, whole and valid, for tests to spoil."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from p2gd_fgo.config.models import DatasetConfig
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.datasets.opening import open_sequence

START_NS = 1_403_636_579_763_555_584  # 19 digits: a float would lose the last ones
IMAGE_STEP_NS = 100_000_000
IMU_STEP_NS = 5_000_000
WIDTH, HEIGHT = 64, 48


def identity_pose() -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": np.eye(4).ravel().tolist()}


def camera_yaml() -> dict[str, Any]:
    return {
        "sensor_type": "camera",
        "T_BS": identity_pose(),
        "rate_hz": 10,
        "resolution": [WIDTH, HEIGHT],
        "camera_model": "pinhole",
        "intrinsics": [40.0, 41.0, 31.5, 23.5],
        "distortion_model": "radial-tangential",
        "distortion_coefficients": [-0.1, 0.01, 0.0002, "1e-05"],
    }


def imu_yaml() -> dict[str, Any]:
    return {
        "sensor_type": "imu",
        "T_BS": identity_pose(),
        "gyroscope_noise_density": 1.7e-4,
        "gyroscope_random_walk": 2e-5,
        "accelerometer_noise_density": 2e-3,
        "accelerometer_random_walk": 3e-3,
    }


@dataclass
class AslFolder:
    """The content of an ASL folder; ``write`` puts it on disk.

    ``imu`` (N, 7) and ``truth`` (N, 17) rows are text already, so that tests can write nonsense.
    """

    root: Path
    camera: dict[str, Any] | None = field(default_factory=camera_yaml)
    imu_sensor: dict[str, Any] | None = field(default_factory=imu_yaml)
    image_stamps: list[int] = field(
        default_factory=lambda: [START_NS + k * IMAGE_STEP_NS for k in range(6)]
    )
    imu: list[list[str]] = field(default_factory=lambda: imu_rows())
    truth: list[list[str]] | None = field(default_factory=lambda: truth_rows())
    image_shape: tuple[int, int] = (HEIGHT, WIDTH)

    @property
    def mav0(self) -> Path:
        return self.root / "mav0"

    @property
    def camera_csv(self) -> Path:
        return self.mav0 / "cam0" / "data.csv"

    @property
    def imu_csv(self) -> Path:
        return self.mav0 / "imu0" / "data.csv"

    @property
    def truth_csv(self) -> Path:
        return self.mav0 / "state_groundtruth_estimate0" / "data.csv"

    def image(self, index: int) -> Path:
        return self.mav0 / "cam0" / "data" / f"{self.image_stamps[index]}.png"

    def write(self) -> AslFolder:
        (self.mav0 / "cam0" / "data").mkdir(parents=True)
        (self.mav0 / "imu0").mkdir()
        for sensor, content in (("cam0", self.camera), ("imu0", self.imu_sensor)):
            if content is not None:
                (self.mav0 / sensor / "sensor.yaml").write_text(yaml.safe_dump(content))
        names = [[str(stamp), f"{stamp}.png"] for stamp in self.image_stamps]
        write_csv(self.camera_csv, "#timestamp [ns],filename", names)
        for k in range(len(self.image_stamps)):
            grey = np.full(self.image_shape, 10 * k, dtype=np.uint8)
            assert cv2.imwrite(str(self.image(k)), grey)
        write_csv(self.imu_csv, "#timestamp [ns],wx,wy,wz,ax,ay,az", self.imu)
        if self.truth is not None:
            self.truth_csv.parent.mkdir()
            write_csv(self.truth_csv, "#timestamp,p,q,v,bw,ba", self.truth)
        return self

    def open(self, **settings: Any) -> AslSequence:
        max_gap_s = settings.pop("max_gap_s", 0.1)
        config = DatasetConfig(path=str(self.root), **settings)
        sequence = open_sequence(config, max_gap_s=max_gap_s)
        assert isinstance(sequence, AslSequence)
        return sequence


def imu_rows(first_ns: int = START_NS - 50_000_000, count: int = 131) -> list[list[str]]:
    return [
        [str(first_ns + k * IMU_STEP_NS), f"{0.001 * k}", "0.2", "-0.3", "0.4", "0.5", "9.81"]
        for k in range(count)
    ]


def truth_rows(first_ns: int = START_NS - 50_000_000, count: int = 66) -> list[list[str]]:
    """Along x at 1 m/s, turned by 90° about z."""
    half = f"{np.sqrt(0.5):.9f}"
    return [
        [
            *(str(first_ns + k * 10_000_000), f"{0.01 * k:.6f}", "2", "3"),
            *(half, "0", "0", half, "1", "0", "0", "0.01", "0.02", "0.03", "0.1", "0.2", "0.3"),
        ]
        for k in range(count)
    ]


def write_csv(path: Path, header: str, rows: list[list[str]]) -> None:
    path.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
