"""What the methods of a report are called, and what each is compared with."""

from __future__ import annotations

from dataclasses import replace

import pytest
from run_records import metrics, record, records

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.report.pages.collection import (
    Baseline,
    Collection,
    choose_baseline,
    counterpart,
    counterparts,
)
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.run_record import Label, RunRecord


def collection(made: list[RunRecord]) -> Collection:
    return Collection([Entry(each, None) for each in made])


def with_axes(number: int, **axes: Label) -> RunRecord:
    made = record("g", "r", 0, "smoother", "grid", metrics(1, 1, 1), key=str(number))
    return replace(made, axes={"sequence": "r", "seed": 0, **axes})


def test_methods_are_what_differs_within_a_route_and_seed() -> None:
    found = collection(records(routes=2, seeds=2))
    assert found.axes == ("backend", "distribution")
    assert [found.name(m) for m in found.methods] == [
        "smoother · grid", "smoother · p2gd", "msckf · grid", "msckf · p2gd",
    ]  # fmt: skip
    assert found.groups == ("kaist_like", "robot_like")
    assert [route.name for route in found.of("robot_like")] == ["robot_like-200", "robot_like-201"]
    assert len(found.runs(found.routes[0], found.methods[0])) == 2


def test_the_grid_comes_before_what_is_compared_with_it() -> None:
    found = collection(records(effects={"anms": 1.0, "grid": 1.0}, seeds=1, routes=1))
    assert [found.name(m) for m in found.methods][:2] == ["smoother · grid", "smoother · anms"]


def test_labels_on_which_all_agree_are_left_out_of_names() -> None:
    found = collection(records(backends=["smoother"], seeds=1, routes=1))
    assert [found.name(m) for m in found.methods] == ["grid", "p2gd"]
    assert found.against(found.methods[1], found.methods[0]) == "p2gd against grid"
    alone = collection(records(backends=["msckf"], effects={"grid": 1.0}, seeds=1, routes=1))
    assert [alone.name(m) for m in alone.methods] == ["msckf · grid"]


def test_numbers_and_switches_are_named_with_their_axis() -> None:
    made = [
        with_axes(0, backend="msckf", distribution="p2gd", floor=0.1, refill=True),
        with_axes(1, backend="msckf", distribution="p2gd", floor=0.0, refill=False),
    ]
    found = collection(made)
    assert [found.name(m) for m in found.methods] == [
        "floor 0.1 · refill True", "floor 0.0 · refill False",
    ]  # fmt: skip


def test_a_method_is_compared_with_the_most_alike_of_its_back_end() -> None:
    made = [
        with_axes(0, backend="smoother", distribution="grid", window=20),
        with_axes(1, backend="smoother", distribution="grid", window=30),
        with_axes(2, backend="msckf", distribution="grid", window=30),
        with_axes(3, backend="smoother", distribution="p2gd", window=30),
        with_axes(4, backend="OpenVINS"),
    ]
    found = collection(made)
    baseline = choose_baseline(found, None)
    assert baseline == Baseline("distribution", "grid")
    method = found.method(made[3])
    assert counterpart(found, method, baseline) == found.method(made[1])
    assert counterpart(found, found.method(made[0]), baseline) is None
    assert counterpart(found, found.method(made[4]), baseline) is None
    assert found.choice(found.method(made[4])) == {"backend": "OpenVINS"}


def test_the_baseline_asked_for() -> None:
    found = collection(records(routes=1, seeds=1))
    baseline = choose_baseline(found, "backend=msckf")
    assert baseline == Baseline("backend", "msckf")
    smoother_p2gd, msckf_p2gd = found.methods[1], found.methods[3]
    assert counterpart(found, smoother_p2gd, baseline) == msckf_p2gd
    for wrong in ("backend=x", "window=20", "grid", "="):
        with pytest.raises(ConfigError, match="distribution=grid"):
            choose_baseline(found, wrong)


def test_without_the_grid_the_first_label_is_compared_with() -> None:
    only = {"effects": {"p2gd": 1.0}, "routes": 1, "seeds": 1}
    assert choose_baseline(collection(records(**only)), None) == Baseline("backend", "smoother")  # type: ignore[arg-type]
    assert choose_baseline(collection(records(backends=["msckf"], **only)), None) is None  # type: ignore[arg-type]


def test_a_trajectory_made_elsewhere_is_compared_with_the_baseline_of_every_back_end() -> None:
    peer = replace(with_axes(9, distribution="Peer"), seed=0, axes={"distribution": "Peer"})
    found = collection([*records(routes=1, seeds=2, groups=["car"]), replace(peer, group="car")])
    method = found.method(peer)
    assert found.axes == ("backend", "distribution") and found.name(method) == "Peer"
    bases = counterparts(found, method, Baseline("distribution", "grid"))
    assert [found.name(base) for base in bases] == ["smoother · grid", "msckf · grid"]
    assert found.methods[-1] == method
    assert counterpart(found, method, Baseline("distribution", "grid")) is None
