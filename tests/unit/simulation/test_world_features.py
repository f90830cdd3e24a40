"""Features of a scenario's world: on its surfaces, and never seen through them."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.geometry.pose import inverse, transform
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.production import START_NS, build_world, plan
from p2gd_fgo.simulation.renderer import Renderer
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.simulation.world_features import record_world_features, surface_landmarks


def short(**settings: object) -> Scenario:
    fixed = {"duration_s": 3.0, "world.detail": 0.5, "vehicle.standstill_s": 0.0}
    return load_scenario(find_preset("robot_like"), {**fixed, **settings})


def test_landmarks_lie_on_surfaces_in_front_of_what_hides_them() -> None:
    prepared = plan(short())
    world = build_world(prepared)
    T_imu = prepared.drive.trajectory.sample(prepared.image_stamps_ns).T_world_imu
    points = surface_landmarks(world, T_imu[:, :3, 3], 50.0, 4000, np.random.default_rng(0))
    assert points[:, 2].min() > prepared.ground_z - 0.1
    pose = T_imu[10] @ prepared.calibration.T_imu_cam
    camera = prepared.calibration.camera
    depth = Renderer(camera, world).inverse_depth(pose)
    seen = transform(inverse(pose), points)
    seen = seen[seen[:, 2] > 0.5]
    pixels = camera.project(seen)
    inside = camera.visible(seen, pixels)
    ij = np.rint(pixels[inside]).astype(int)
    ratio = depth[np.clip(ij[:, 1], 0, 599), np.clip(ij[:, 0], 0, 799)] * seen[inside, 2]
    # Where nothing stands before a landmark, the renderer finds its surface at its depth.
    assert (np.abs(ratio - 1.0) < 0.03).sum() > 150
    assert (ratio > 0.9).mean() > 0.97


def test_a_recording_holds_what_the_estimators_need() -> None:
    made = record_world_features(short())
    assert len(made.observations) == 31 == len(made.image_stamps_ns)
    assert made.image_stamps_ns[0] == START_NS
    assert np.mean([len(o) for o in made.observations]) > 80
    noisier = record_world_features(short(**{"imu.seed": 5}))
    np.testing.assert_array_equal(made.observations[7].pixels, noisier.observations[7].pixels)
    assert np.abs(made.imu.gyro - noisier.imu.gyro).max() > 0.0


def test_a_long_drive_needs_no_world() -> None:
    made = record_world_features(
        load_scenario(find_preset("kaist_like"), {"duration_s": 120.0}), build=False
    )
    assert len(made.observations) == 1201
    assert np.mean([len(o) for o in made.observations]) > 100
