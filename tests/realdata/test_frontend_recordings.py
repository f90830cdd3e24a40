from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.config import Config, DatasetConfig, resolve
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.distribution import GridDistribution
from p2gd_fgo.frontend import CellQuotas, Frontend
from p2gd_fgo.geometry.pose import interpolate, inverse


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "settings", "mean_length", "epipolar_px", "shortest_baseline"),
    [
        ("euroc_mh01", (150, (8, 6), 30.0), 7.0, 0.3, 0.01),
        ("kitti_0039", (180, (10, 6), 40.0), 3.0, 0.8, 0.1),
    ],
)
def test_tracks_are_long_and_agree_with_truth(
    recordings: Path,
    name: str,
    settings: tuple[int, tuple[int, int], float],
    mean_length: float,
    epipolar_px: float,
    shortest_baseline: float,
) -> None:
    sequence = open_sequence(DatasetConfig(path=str(recordings / name)))
    camera, T_imu_cam = sequence.calibration.camera, sequence.calibration.T_imu_cam
    assert sequence.truth is not None
    poses = interpolate(sequence.truth.trajectory, sequence.image_stamps_ns[:150]) @ T_imu_cam
    config = resolve(Config(), camera.width).frontend
    assert (config.max_features, config.grid, config.min_distance_px) == settings
    frontend = Frontend(camera, config, seed=0)
    distribution = GridDistribution(frontend.grid, settings[0])
    lengths: dict[int, int] = {}
    distances = []
    for k, T_world_cam in enumerate(poses):
        T_cam_prev = inverse(T_world_cam) @ poses[max(k - 1, 0)]
        stamp = int(sequence.image_stamps_ns[k])
        frontend.track(stamp, sequence.image(k), T_cam_prev[:3, :3] if k else None)
        buffer = frontend.buffer
        seen_before = buffer.lengths > 1
        frontend.extract(CellQuotas(distribution.quotas(frontend.capacity)))
        assert len(buffer) <= settings[0]
        lengths.update(zip(buffer.ids.tolist(), buffer.lengths.tolist(), strict=True))
        t = T_cam_prev[:3, 3]
        if np.linalg.norm(t) > shortest_baseline:
            pair = buffer.normalized_history[: len(seen_before)][seen_before, -2:]
            rays = np.concatenate([pair, np.ones((len(pair), 2, 1))], axis=2)
            lines = np.cross(t, rays[:, 0] @ T_cam_prev[:3, :3].T)
            miss = np.abs((lines * rays[:, 1]).sum(1)) / np.linalg.norm(lines[:, :2], axis=1)
            distances.append(miss * camera.fx)
    assert np.mean(list(lengths.values())) > mean_length
    assert np.median(np.concatenate(distances)) < epipolar_px
