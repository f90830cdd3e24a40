"""Scenarios: presets, what is refused and in which words, and what a hash depends on."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.simulation.presets import (
    PRESETS,
    dump_scenario,
    find_preset,
    images_hash,
    load_scenario,
    scenario_hash,
)
from p2gd_fgo.simulation.scenario import Scenario

NAMES = sorted(path.stem for path in PRESETS.glob("*.yaml"))


def test_all_presets_are_there() -> None:
    city = ["kaist_like", "stop_and_go", "textureless", "dusk"]
    assert sorted([*city, "robot_like", "crowded", "fast_turns", "demo"]) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_read_and_written(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(find_preset(name), {"seed": 7})
    assert scenario.name == name and scenario.seed == 7
    (tmp_path / "scenario.yaml").write_text(dump_scenario(scenario))
    assert load_scenario(tmp_path / "scenario.yaml") == scenario


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("vehicle: {speed: [-1, 5]}", r"vehicle\.speed\.0 is -1: .*greater than 0"),
        ("vehicle: {speed: [9, 5]}", r"vehicle: speed \(9, 5\) runs from high to low"),
        ("vehicle: {imu_height_m: 0.1}", r"puts the camera into the ground"),
        ("camera: {tilt_deg: .nan}", r"camera\.tilt_deg is nan"),
        ("camera: {center: [900, 900]}", r"center \(900.0, 900.0\) lies outside"),
        ("camera: {rate_hz: 30}", r"imu\.rate_hz 100 is no multiple of camera\.rate_hz 30"),
        ("duration_s: 0.1", r"holds less than two images"),
        ("vehicle: {stop_every_m: 1.0e-9}", r"vehicle\.stop_every_m is 1e-09"),
        ("world: {kind: moon}", r"world\.kind is 'moon'"),
        ("world: {block_m: [90, 60]}", r"runs from long to short"),
        ("imu: {gyro_noise: 1}", r"unknown key 'imu\.gyro_noise': did you mean 'gyro_noise_den"),
        ("[1, 2]", r"a scenario is a mapping"),
        ("a: b: c", r"not readable as YAML"),
    ],
)
def test_bad_values_are_refused_in_one_sentence(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as refused:
        load_scenario(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_an_unknown_preset_names_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"did you mean 'kaist_like'\?"):
        find_preset("kaist_lik")


def test_the_images_hash_leaves_the_imu_out() -> None:
    one = Scenario()
    noisy = Scenario.model_validate({"imu": {"seed": 3, "gyro_noise_density": 1e-3}})
    other = Scenario.model_validate({"camera": {"noise_sigma": 3.0}})
    assert images_hash(one, 1) == images_hash(noisy, 1)
    assert scenario_hash(one, 1) != scenario_hash(noisy, 1)
    assert len({images_hash(one, 1), images_hash(other, 1), images_hash(one, 2)}) == 3
