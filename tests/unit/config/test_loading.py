"""Configurations as files: chains, refusals, numbers, round trips."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ValidationError

from p2gd_fgo.config import Config, config_hash, dump_yaml, load_config, override, resolve
from p2gd_fgo.errors import ConfigError


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_no_file_gives_the_defaults() -> None:
    assert load_config() == Config()


def test_an_empty_file_gives_the_defaults(tmp_path: Path) -> None:
    assert load_config(written(tmp_path / "c.yaml", "# nothing\n")) == Config()


# -- extends -------------------------------------------------------------------------------------


def test_later_bases_win_over_earlier_ones_and_the_file_over_all(tmp_path: Path) -> None:
    written(
        tmp_path / "base" / "a.yaml",
        "name: a\nbackend: {window: 10, pixel_noise_px: 0.5}\nruntime: {seed: 1}",
    )
    written(tmp_path / "base" / "b.yaml", "extends: a.yaml\nname: b\nruntime: {seed: 2}")
    written(tmp_path / "c.yaml", "name: c\nruntime: {seed: 3}\nbackend: {window: 12}")
    top = written(
        tmp_path / "runs" / "top.yaml",
        "extends: [../base/b.yaml, ../c.yaml]\nname: top\nfrontend: {grid: [4, 3]}",
    )
    config = load_config(top)
    assert config.name == "top"
    assert config.runtime.seed == 3
    assert config.backend.window == 12
    assert config.backend.pixel_noise_px == 0.5
    assert config.frontend.grid == (4, 3)


def test_a_base_shared_by_two_is_no_circle(tmp_path: Path) -> None:
    written(tmp_path / "root.yaml", "runtime: {seed: 7}")
    written(tmp_path / "a.yaml", "extends: root.yaml")
    written(tmp_path / "b.yaml", "extends: root.yaml")
    top = written(tmp_path / "top.yaml", "extends: [a.yaml, b.yaml]")
    assert load_config(top).runtime.seed == 7


def test_an_empty_section_changes_nothing(tmp_path: Path) -> None:
    written(tmp_path / "base.yaml", "backend: {window: 10}\nstationary:")
    top = written(tmp_path / "top.yaml", "extends: base.yaml\nbackend:\n  # window: 5\nimu:")
    assert load_config(top) == override(Config(), {"backend.window": 10})


@pytest.mark.parametrize("links", [["a"], ["a", "b"], ["a", "b", "c"]])
def test_a_circle_of_extends_is_refused(tmp_path: Path, links: list[str]) -> None:
    for name, base in zip(links, links[1:] + links[:1], strict=True):
        written(tmp_path / f"{name}.yaml", f"extends: ./{base}.yaml")
    with pytest.raises(ConfigError, match=r"a\.yaml: 'extends' goes round in a circle"):
        load_config(tmp_path / "a.yaml")


def test_a_missing_base_is_named(tmp_path: Path) -> None:
    top = written(tmp_path / "top.yaml", "extends: gone.yaml")
    with pytest.raises(ConfigError, match=r"gone\.yaml: no such configuration file"):
        load_config(top)


@pytest.mark.parametrize("value", ["5", "{a: b}", "[1, 2]"])
def test_extends_takes_names_only(tmp_path: Path, value: str) -> None:
    top = written(tmp_path / "top.yaml", f"extends: {value}")
    with pytest.raises(ConfigError, match=r"top\.yaml: 'extends' takes a file name"):
        load_config(top)


# -- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fronted: {}", "unknown key 'fronted': did you mean 'frontend'?"),
        ("frontend: {max_feature: 5}", "'frontend.max_feature': did you mean 'max_features'?"),
        (
            "initialization: {given: {sigma_tilt: 1}}",
            "'initialization.given.sigma_tilt': did you mean 'sigma_tilt_deg'?",
        ),
        ("priors: {zzz: 1}", "unknown key 'priors.zzz': it takes source"),
        ("7: 8", "unknown key '7'"),
        ("backend: {window: 1}", "backend.window is 1: input should be greater than or equal to 3"),
        ("backend: {window: 3.5}", "backend.window is 3.5"),
        (
            "backend: {kind: smother}",
            "backend.kind is 'smother': input should be 'smoother', 'msckf' or "
            "'dead_reckoning' (did you mean 'smoother'?)",
        ),
        ("backend: {kind: zzz}", "'msckf' or 'dead_reckoning'"),
        (
            "frontend: {grid: 10x6}",
            "frontend.grid is '10x6': a list in brackets is expected, such as [10,6]",
        ),
        ("frontend: {grid: 10}", "frontend.grid is 10: a list in brackets is expected"),
        ("frontend: 10", "frontend is 10: a section of fields is expected: set frontend.FIELD"),
        ("frontend: {grid: [4]}", "frontend.grid"),
        ("frontend: {grid: [4, 0]}", "frontend.grid.1 is 0"),
        ("imu: {gravity: .nan}", "imu.gravity is nan"),
        ("imu: {inflation: .inf}", "imu.inflation is inf"),
        ("imu: {gyro_noise_density: -1e-05}", "imu.gyro_noise_density is -1e-05"),
        ("imu: {gyro_noise_density: 1e5abc}", "imu.gyro_noise_density is '1e5abc'"),
        ("backend: 5", "backend is 5"),
        ("evaluation: {rte_tolerance: 1}", "evaluation.rte_tolerance is 1"),
        (
            "frontend: {max_track_length: 21}",
            "frontend.max_track_length is 21, but backend.window holds only 20 images",
        ),
        ("[1, 2]", "a configuration is a mapping of keys, not a list"),
        ("just words", "a configuration is a mapping of keys, not a str"),
        ("a: [1, 2", "not readable as YAML"),
        ("a: b: c", "not readable as YAML"),
        ("a: 2024-13-45", "not readable as YAML"),
        ("name: x\nname: y", "the key 'name' is given twice"),
        ("a: &x 1\nb: *x", "aliases"),
        ("a: !!python/object/apply:os.getcwd []", "not readable as YAML"),
        ("runtime: {seed: !!bool maybe}", "not readable as YAML: a value that its tag doesn't fit"),
        ('runtime: {seed: !!int ""}', "a value that its tag doesn't fit"),
        ("name: !!timestamp x", "a value that its tag doesn't fit"),
        ('dataset: {camera: ""}', "dataset.camera is ''"),
    ],
)
def test_refusals_are_one_sentence_with_file_and_field(
    tmp_path: Path, text: str, message: str
) -> None:
    path = written(tmp_path / "run.yaml", text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_base_that_can_be_no_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="not readable as YAML: embedded null byte"):
        load_config(written(tmp_path / "run.yaml", 'extends: "a\\0b"'))


def test_files_that_cannot_be_text(tmp_path: Path) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    (tmp_path / "zeros.yaml").write_bytes(b"name: a\0b")
    with pytest.raises(ConfigError, match="no such configuration file"):
        load_config(tmp_path / "none.yaml")
    for name in ("binary.yaml", "zeros.yaml", "."):
        with pytest.raises(ConfigError, match="not readable as YAML"):
            load_config(tmp_path / name)


def test_a_yaml_bomb_is_refused_at_once(tmp_path: Path) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    for k in range(1, 12):
        lines.append(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]")
    bomb = written(tmp_path / "bomb.yaml", "\n".join(lines))
    deep = written(tmp_path / "deep.yaml", "a: " + "[" * 20_000)
    endless = written(tmp_path / "endless.yaml", "&a [*a]")
    large = written(tmp_path / "large.yaml", "# " + "x" * 2_000_000)
    begin = time.perf_counter()
    for path in (bomb, deep, endless, large):
        with pytest.raises(ConfigError, match="not readable as YAML"):
            load_config(path)
    with pytest.raises(ConfigError, match="not a YAML value"):
        override(Config(), {"frontend.grid": "[&a [1, 2], *a]"})
    assert time.perf_counter() - begin < 5.0


# -- numbers -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-05", 1e-5),
        ("1E5", 1e5),
        ("+2.e-3", 2e-3),
        (".5e1", 5.0),
        ("'1e-05'", 1e-5),
        ('"0.25"', 0.25),
        ("3", 3.0),
    ],
)
def test_numbers_however_they_are_written(tmp_path: Path, text: str, value: float) -> None:
    path = written(
        tmp_path / "c.yaml",
        f"imu: {{gyro_noise_density: {text}}}\nevaluation: {{rte_lengths_m: [{text}, 1e1]}}",
    )
    config = load_config(path)
    assert config.imu.gyro_noise_density == value
    assert config.evaluation.rte_lengths_m == (value, 10.0)
    assert override(Config(), {"imu.gravity": text}).imu.gravity == value


def test_whole_numbers_may_have_an_exponent() -> None:
    assert override(Config(), {"frontend.max_features": "2e2"}).frontend.max_features == 200


@pytest.mark.parametrize("text", ["1e5abc", "e5", "1e", "'1e5'", "12-3", "0039"])
def test_text_stays_text(tmp_path: Path, text: str) -> None:
    config = load_config(written(tmp_path / "c.yaml", f"name: {text}"))
    assert config.name == text.strip("'")


# -- override ------------------------------------------------------------------------------------


def test_override_changes_only_what_it_names() -> None:
    base = override(Config(), {"runtime.seed": "4", "frontend.fast_threshold": 15})
    config = override(
        base,
        {
            "frontend.grid": "[4, 3]",
            "initialization.given.gyro_bias": "[0, 1e-3, 0.5]",
            "initialization.kind": "given",
            "frontend.equalize": "true",
            "dataset.duration_s": 2.5,
        },
    )
    assert config.runtime.seed == 4
    assert config.frontend.fast_threshold == 15
    assert config.frontend.grid == (4, 3)
    assert config.frontend.equalize is True
    assert config.initialization.given.gyro_bias == (0.0, 1e-3, 0.5)
    assert config.dataset.duration_s == 2.5
    assert override(config, {"dataset.duration_s": "null"}).dataset.duration_s is None
    assert base.frontend.grid is None


def test_what_a_shortcut_gave_is_refused_under_its_name() -> None:
    options = {"backend.kind": "--backend"}
    with pytest.raises(ConfigError, match=r"^--backend: backend\.kind is 'smother'"):
        override(Config(), {"backend.kind": "smother"}, options)
    with pytest.raises(ConfigError, match=r"^--backend: .* is not a YAML value"):
        override(Config(), {"backend.kind": "[4"}, options)
    with pytest.raises(ConfigError, match=r"^--set: backend\.window is 1"):
        override(Config(), {"backend.kind": "msckf", "backend.window": 1}, options)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("backend.window", "1", "--set: backend.window is 1"),
        ("backend.window", 1, "--set: backend.window is 1"),
        ("frontend.max_feature", "1", "'frontend.max_feature': did you mean 'max_features'?"),
        ("frontnd.max_features", "9", "unknown key 'frontnd': did you mean 'frontend'?"),
        ("frontend.grid", "[4, 3", "--set frontend.grid: '[4, 3' is not a YAML value"),
        ("name.first", "x", "name"),
        ("backend", "5", "--set: backend is 5"),
        ("", "5", "unknown key ''"),
        ("window", "15", "unknown key 'window': did you mean 'backend.window'?"),
        ("T_truth_imu", "3", "did you mean 'dataset.T_truth_imu'?"),
        ("given.loosening", "3", "did you mean 'initialization.given'?"),
        ("source", "file", "did you mean 'priors.source'"),
        ("frontend.max_track_length", "40", "backend.window holds only 20"),
    ],
)
def test_override_refuses_in_one_sentence(key: str, value: object, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        override(override(Config(), {"name": "run"}), {key: value})
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["2024", "1e5", "on", "~/runs", "a: b", "/data/run #1", "[x]", "*x", "- y", ""]
)
def test_a_text_field_takes_the_command_line_as_it_is(text: str) -> None:
    config = override(Config(), {"dataset.path": text})
    assert config.dataset.path == text
    assert load_config_text(dump_yaml(config)) == config


def test_a_text_field_can_be_emptied_and_quoted() -> None:
    named = override(Config(), {"name": "'null'"})
    assert named.name == "null"
    assert override(named, {"name": "null"}).name is None


# -- resolve, dump, hash -------------------------------------------------------------------------


def load_config_text(text: str) -> Config:
    data = yaml.safe_load(text)
    return Config.model_validate(data)


@pytest.mark.parametrize(
    ("width", "features", "grid", "distance"),
    [(1280, 180, (10, 6), 40.0), (1001, 180, (10, 6), 40.0), (1000, 150, (8, 6), 30.0)],
)
def test_defaults_by_image_width(
    width: int, features: int, grid: tuple[int, int], distance: float
) -> None:
    frontend = resolve(Config(), width).frontend
    assert (frontend.max_features, frontend.grid) == (features, grid)
    assert (frontend.min_distance_px, frontend.max_track_length) == (distance, 20)


def test_resolve_keeps_what_is_given() -> None:
    config = override(
        Config(),
        {"frontend.max_features": 99, "frontend.max_track_length": 7, "backend.window": 9},
    )
    resolved = resolve(config, 1280)
    assert resolved.frontend.max_features == 99
    assert resolved.frontend.max_track_length == 7
    assert resolved.frontend.grid == (10, 6)
    assert resolve(override(Config(), {"backend.window": 9}), 640).frontend.max_track_length == 9
    assert resolve(resolved, 640) == resolved


@pytest.mark.parametrize("comments", [False, True])
def test_what_is_dumped_can_be_loaded(tmp_path: Path, comments: bool) -> None:
    config = override(
        resolve(Config(), 1280),
        {
            "name": "off: 1e5 # µ",
            "dataset.path": "2024",
            "imu.gyro_random_walk": 1e-7,
            "initialization.given.accel_bias": "[1e-20, 2, 3]",
            "dataset.time_offset_s": -0.012,
            "evaluation.rte_lengths_m": "[]",
        },
    )
    path = written(tmp_path / "dump.yaml", dump_yaml(config, comments=comments))
    assert load_config(path) == config


def test_a_dump_with_comments_explains_every_field() -> None:
    lines = dump_yaml(Config(), comments=True).splitlines()
    assert all("  # " in line for line in lines)
    assert "  # " not in dump_yaml(Config())


def test_the_hash_names_the_content(tmp_path: Path) -> None:
    one = written(tmp_path / "a.yaml", "runtime: {seed: 1, threads: 2}\nname: x")
    two = written(tmp_path / "b.yaml", "name: x\nruntime: {threads: 2, seed: 1}\nbackend: {}")
    a, b = load_config(one), load_config(two)
    assert config_hash(a) == config_hash(b) == config_hash(a)
    assert len(config_hash(a)) == 10
    assert len({config_hash(override(a, {"runtime.seed": k})) for k in range(5)}) == 5
    assert config_hash(a, "/data") != config_hash(a)


def test_the_hash_is_the_same_in_another_process() -> None:
    code = "from p2gd_fgo.config import *; print(config_hash(Config()))"
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert made.stdout.strip() == config_hash(Config())


# -- models --------------------------------------------------------------------------------------


def models(model: BaseModel) -> Iterator[BaseModel]:
    yield model
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            yield from models(value)


def test_models_are_frozen_and_every_field_is_described() -> None:
    seen = list(models(Config()))
    assert len(seen) >= 14
    for model in seen:
        assert type(model).__doc__
        for name, info in type(model).model_fields.items():
            if not isinstance(getattr(model, name), BaseModel):
                assert info.description, f"{type(model).__name__}.{name}"
            with pytest.raises(ValidationError):
                setattr(model, name, getattr(model, name))


@pytest.mark.parametrize("name", ["../up", "a/b", "..", ""])
def test_a_name_is_no_path(name: str) -> None:
    with pytest.raises(ConfigError, match="name is"):
        override(load_config(), {"name": name})
