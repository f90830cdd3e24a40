"""Studies as they are written: ranges, bundles, profiles, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.study.spec import StudySpec, load_study

HEAD = "name: a\nquestion: q\n"
ROUTES = "sequences: [{simulate: robot_like, routes: 3..5}]\n"


def load(tmp_path: Path, text: str) -> StudySpec:
    path = tmp_path / "study.yaml"
    path.write_text(text)
    return load_study(path)


def test_ranges_and_bundles(tmp_path: Path) -> None:
    spec = load(
        tmp_path,
        HEAD + ROUTES + "axes: {seed: 0..3, noise: [0.1, 2], policy: {plain: {}, more: {a.b: 1}},"
        " list: [{x: {a.c: 2}}, {y: {}}]}",
    )
    assert spec.sequences[0].routes == (3, 4, 5)
    assert [value.label for value in spec.axes["seed"]] == [0, 1, 2, 3]
    assert [value.settings for value in spec.axes["noise"]] == [None, None]
    assert [(v.label, v.settings) for v in spec.axes["policy"]] == [
        ("plain", {}),
        ("more", {"a.b": 1}),
    ]
    assert [v.label for v in spec.axes["list"]] == ["x", "y"]


def test_a_profile_replaces_what_it_names(tmp_path: Path) -> None:
    spec = load(
        tmp_path,
        HEAD + ROUTES + "axes: {seed: 0..3, distribution: [grid, p2gd]}\ntimeout_s: 9\n"
        "profiles: {quick: {axes: {seed: [5]}, sequences: [{path: x}]}}",
    )
    quick = spec.profile("quick")
    assert [value.label for value in quick.axes["seed"]] == [5]
    assert quick.axes["distribution"] == spec.axes["distribution"]
    assert quick.sequences[0].path == "x" and quick.timeout_s == 9.0
    assert spec.profile("full") == spec
    with pytest.raises(ConfigError, match="no such profile: there are full, quick"):
        spec.profile("quik")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + ROUTES + "axis: {}", "unknown key 'axis': did you mean 'axes'?"),
        (HEAD + "sequences: [{simulat: x}]", "'sequences.0.simulat': did you mean 'simulate'?"),
        (HEAD + "sequences: [{simulate: robot_like}]", "robot_like needs routes, such as 1..12"),
        (HEAD + "sequences: [{simulate: a, path: b}]", "either 'simulate' or 'path'"),
        (HEAD + "sequences: [{path: b, routes: 1..2}]", "are for 'simulate'"),
        (HEAD + "sequences: [{simulate: a, routes: 5..2}]", "the range 5..2 is empty"),
        (HEAD + "sequences: [{simulate: a, routes: [5, 5]}]", "has a route twice"),
        (HEAD, "'sequences' is missing"),
        (HEAD + ROUTES + "timeout_s: -1", "timeout_s is -1: input should be greater than 0"),
        (HEAD + ROUTES + "axes: {seed: [1, 1]}", "axes.seed has a label twice: 1, 1"),
        (HEAD + ROUTES + "axes: {seed: []}", "axes.seed: "),
        (HEAD + ROUTES + "pairing: {axis: d, baseline: x}", "'d' is no axis: there are none"),
        (
            HEAD + ROUTES + "axes: {d: [y]}\npairing: {axis: d, baseline: x}",
            "'x' is not on the axis 'd': there are y",
        ),
        (HEAD + ROUTES + "exclude: [{distributon: grid}]", "names 'distributon', which is no axis"),
        (
            HEAD + ROUTES + "axes: {d: [grid, p2gd]}\nexclude: [{d: p2dg}]",
            "a rule names d 'p2dg', which there isn't: did you mean 'p2gd'?",
        ),
        (HEAD + ROUTES + "include: [{route: robot_like-9}]", "'robot_like-9', which there isn't"),
        (HEAD + ROUTES + "include: [{group: car}]", "there isn't: there are robot_like"),
        ("name: ../a\nquestion: q\n" + ROUTES, "name is '../a'"),
        ("[1, 2]", "a study is a mapping of keys"),
        ("a: [", "not readable as YAML"),
    ],
)
def test_a_bad_study_is_one_sentence(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as refused:
        load(tmp_path, text)
    assert words in str(refused.value) and "\n" not in str(refused.value)
    assert str(refused.value).startswith(str(tmp_path / "study.yaml"))


def test_a_profile_must_keep_the_baseline(tmp_path: Path) -> None:
    spec = load(
        tmp_path,
        HEAD + ROUTES + "axes: {d: [x, y]}\npairing: {axis: d, baseline: x}\n"
        "profiles: {quick: {axes: {d: [y]}}}",
    )
    with pytest.raises(ConfigError, match=r"--profile quick: pairing\.baseline 'x' is not on"):
        spec.profile("quick")


def test_no_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such study file"):
        load_study(tmp_path / "study.yaml")


STUDIES = sorted(Path(__file__).parents[3].glob("experiments/*/study.yaml"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.parent.name)
def test_the_studies_of_the_project_can_be_planned(path: Path) -> None:
    from p2gd_fgo.study.expansion import expand

    spec = load_study(path)
    assert spec.name == path.parent.name
    for name in ("full", *spec.profiles):
        profile = spec.profile(name)
        if all(entry.path is not None for entry in profile.sequences):
            with pytest.raises(ConfigError, match="--data is not given"):
                expand(profile, path.parent)
        else:
            assert expand(profile, path.parent).runs


def test_paths_are_no_ranges_and_rules_may_have_them(tmp_path: Path) -> None:
    spec = load(
        tmp_path,
        HEAD + ROUTES + "axes: {priors.file: [../a.tum, ../b.tum], seed: 0..3}\n"
        "exclude: [{seed: 1..2}]\nprofiles: {quick: {axes: {seed: [7]}}}",
    )
    assert [value.label for value in spec.axes["priors.file"]] == ["../a.tum", "../b.tum"]
    assert spec.exclude == ({"seed": [1, 2]},)
    assert [value.label for value in spec.profile("quick").axes["seed"]] == [7]
