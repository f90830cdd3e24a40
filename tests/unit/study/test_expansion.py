"""From a study to its runs: products, rules, seeds, and keys that name what matters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.study.expansion import Plan, expand
from p2gd_fgo.study.runs import Recorded, Rendered
from p2gd_fgo.study.spec import StudySpec

SMALL: dict[str, Any] = {
    "name": "s",
    "question": "q",
    "sequences": [{"simulate": "robot_like", "routes": [3, 4], "duration_s": 2}],
    "axes": {"distribution": ["grid", "p2gd"], "seed": [0, 1]},
}


def plan(tmp_path: Path, data: Path | None = None, **changes: Any) -> Plan:
    return expand(StudySpec.model_validate(SMALL | changes), tmp_path, data)


def test_the_product_of_routes_seeds_and_axes(tmp_path: Path) -> None:
    runs = plan(tmp_path).runs
    assert len(runs) == len({run.key for run in runs}) == 8
    assert [run.route for run in runs] == ["robot_like-3"] * 4 + ["robot_like-4"] * 4
    assert [run.seed for run in runs[:4]] == [0, 0, 1, 1]
    assert all(run.config.distribution.kind == run.axes["distribution"] for run in runs)
    assert all(run.config.runtime.seed == run.seed == run.axes["seed"] for run in runs)
    assert all(run.config.frontend.max_features == 150 for run in runs)  # resolved by the width


def test_no_two_recordings_share_the_noise_of_the_imu(tmp_path: Path) -> None:
    sources = {run.source for run in plan(tmp_path).runs if isinstance(run.source, Rendered)}
    seeds = {source.scenario.imu.seed for source in sources}
    assert seeds == {3000, 3001, 4000, 4001}
    assert {source.scenario.seed for source in sources} == {3, 4}


def test_runs_always_have_one_thread(tmp_path: Path) -> None:
    runs = plan(tmp_path, base={"settings": {"runtime.threads": 4}}).runs
    assert {run.config.runtime.threads for run in runs} == {1}


def test_settings_go_from_the_general_to_the_special(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("backend: {window: 11, pixel_noise_px: 1.5}")
    sequences = [SMALL["sequences"][0] | {"settings": {"backend.window": 13}}]
    axes = {"noise": {"a": {"backend.pixel_noise_px": 2.0}, "b": {}}}
    base = {"config": "base.yaml", "settings": {"backend.window": 12, "imu.inflation": 2}}
    runs = plan(tmp_path, base=base, sequences=sequences, axes=axes).runs
    assert {run.config.backend.window for run in runs} == {13}
    assert {run.config.imu.inflation for run in runs} == {2.0}
    assert [run.config.backend.pixel_noise_px for run in runs] == [2.0, 1.5] * 2


def test_rules(tmp_path: Path) -> None:
    kept = plan(tmp_path, exclude=[{"distribution": "p2gd", "route": "robot_like-3"}]).runs
    assert {(r.route, r.axes["distribution"]) for r in kept} == {
        ("robot_like-3", "grid"),
        ("robot_like-4", "grid"),
        ("robot_like-4", "p2gd"),
    }
    kept = plan(tmp_path, include=[{"seed": "1..1"}, {"distribution": "grid"}]).runs
    assert all(r.seed == 1 or r.axes["distribution"] == "grid" for r in kept) and len(kept) == 6


def test_a_key_names_what_matters_and_nothing_else(tmp_path: Path) -> None:
    keys = [run.key for run in plan(tmp_path).runs]
    assert [run.key for run in plan(tmp_path, name="other", question="?").runs] == keys
    default = {"backend.window": 20}  # is the default
    assert [run.key for run in plan(tmp_path, base={"settings": default}).runs] == keys
    for changes in (
        {"base": {"settings": {"frontend.fast_threshold": 21}}},
        {"sequences": [SMALL["sequences"][0] | {"duration_s": 3}]},
        {"sequences": [SMALL["sequences"][0] | {"scenario": {"imu.gyro_noise_density": 1e-3}}]},
        {"sequences": [SMALL["sequences"][0] | {"scenario": {"world.contrast": 0.5}}]},
    ):
        assert not set(keys) & {run.key for run in plan(tmp_path, **changes).runs}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axes": {"speed": [1, 2]}}, "axes.speed is neither a field of the configuration nor"),
        ({"axes": {"backend.windo": [5]}}, "axes.backend.windo, 5: unknown key 'backend.windo'"),
        ({"axes": {"backend": ["smother"]}}, "axes.backend, smother: backend.kind is 'smother'"),
        ({"axes": {"seed": [-1]}}, "axes.seed has -1: give whole numbers from 0 to 999"),
        ({"axes": {"seed": [1000]}}, "axes.seed has 1000"),
        ({"axes": {"p": {"a": {}, "b": {}}}}, "'robot_like-3 · a' and 'robot_like-3 · b' are the"),
        ({"axes": {"runtime.seed": [1]}}, "axes.runtime.seed: name the axis 'seed'"),
        (
            {"base": {"settings": {"runtime.seed": 1000}}, "axes": {"distribution": ["grid"]}},
            "runtime.seed is 1000: give one below 1000",
        ),
        ({"exclude": [{"group": "robot_like"}]}, "the rules leave no run"),
        ({"base": {"config": "nowhere.yaml"}}, "base.config 'nowhere.yaml' is neither in"),
        ({"sequences": SMALL["sequences"] * 2}, "two recordings are called 'robot_like-3'"),
        ({"sequences": [{"path": "x"}]}, "the rules leave no run (--data is not given, which x"),
        ({"sequences": [{"path": "/nowhere/x"}]}, "/nowhere/x doesn't exist"),
    ],
)
def test_refusals_name_the_place(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as refused:
        plan(tmp_path, **changes)
    assert words in str(refused.value), refused.value
    assert "--set" not in str(refused.value)


def test_recordings_come_from_the_root_that_is_given(short_demo: Path, tmp_path: Path) -> None:
    entry = {"path": short_demo.name, "name": "yard", "settings": {"backend.window": 9}}
    sequences = [*SMALL["sequences"], entry]
    without = plan(tmp_path, sequences=sequences)
    assert without.left_out == (short_demo.name,) and len(without.runs) == 8
    given = plan(tmp_path, short_demo.parent, sequences=sequences)
    added = given.runs[8:]
    assert not given.left_out and len(added) == 4
    assert {(r.sequence, r.group, r.config.backend.window) for r in added} == {
        ("yard", "recordings", 9)
    }
    source = added[0].source
    assert isinstance(source, Recorded) and (source.images, source.width) == (71, 400)


def test_a_seed_of_the_settings_is_the_seed_of_all(tmp_path: Path) -> None:
    """Of the front end, of the IMU's noise, and of the record."""
    axes = {"distribution": ["grid"]}
    runs = plan(tmp_path, axes=axes, base={"settings": {"runtime.seed": 5}}).runs
    assert [(run.seed, run.config.runtime.seed) for run in runs] == [(5, 5)] * 2
    sources = [run.source for run in runs if isinstance(run.source, Rendered)]
    assert [source.scenario.imu.seed for source in sources] == [3005, 4005]
