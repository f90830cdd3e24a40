"""Records of a study in pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.episodes import compare_episodes
from p2gd_fgo.evaluation.measures import MEASURES, counts, measure
from p2gd_fgo.evaluation.record_pairs import compare_records, pair_records, segment_pairs
from p2gd_fgo.evaluation.segments import segments
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.types import Trajectory

GRID, P2GD = {"distribution": "grid"}, {"distribution": "p2gd"}


def record(
    route: str, seed: int, distribution: str, ate: float, *, backend: str = "msckf",
    group: str = "car", completeness: float = 1.0,
) -> RunRecord:  # fmt: skip
    return RunRecord(
        key=f"{group}{route}{seed}{distribution}{backend}",
        study="s",
        axes={"distribution": distribution, "backend": backend, "seed": seed},
        sequence=f"{group}_{route}",
        route=route,
        group=group,
        seed=seed,
        status="done",
        metrics={
            "alignment": "yaw_pos",
            "ate_m": {"yaw_pos": {"rmse": ate}, "sim3": None},
            "rte": [{"length_m": 10.0, "percent": 5 * ate, "rre_deg": 0.1}],
            "scale": 0.97,
            "completeness": completeness,
        },
        tracking={"mean_length": 4.0},
        cpu_ms={"frame": {"median_cpu_ms": 12.0}},
    )


def study() -> list[RunRecord]:
    return [
        record(f"{route}", seed, side, size * (1.0 + 0.1 * seed) * gain, backend=b, group=g)
        for g, size in (("car", 2.0), ("robot", 0.1))
        for route in range(4)
        for seed in range(3)
        for b in ("msckf", "smoother")
        for side, gain in (("grid", 1.0), ("p2gd", 0.8 + 0.01 * route))
    ]


def test_runs_are_paired_by_all_that_is_not_compared() -> None:
    records = study()
    found = pair_records(list(reversed(records)), GRID, P2GD)
    assert len(found.pairs) == 48 and found.alone_a == found.alone_b == 0
    for a, b in found.pairs:
        assert (a.route, a.seed, a.group, a.axes["backend"]) == (
            b.route, b.seed, b.group, b.axes["backend"]
        )  # fmt: skip
        assert (a.axes["distribution"], b.axes["distribution"]) == ("grid", "p2gd")
    less = [r for r in records if not (r.route == "1" and r.axes["distribution"] == "grid")]
    assert pair_records(less, GRID, P2GD).alone_b == 12


def test_groups_stand_apart_and_together() -> None:
    found = compare_records(study(), GRID, P2GD, measure("ate"))
    assert list(found.groups) == ["car", "robot"]
    assert found.groups["car"].effects["mean"].change == pytest.approx(-0.185)
    assert found.groups["car"].routes == 4 and found.overall.routes == 8
    assert found.overall.effects["geometric"].verdict == "less"
    one = compare_records(
        [r for r in study() if r.group == "car"], GRID, P2GD, measure("rte_10"), draws=50
    )
    assert one.overall is one.groups["car"]
    assert one.overall.a.mean == pytest.approx(11.0)


def test_failed_and_incomplete_runs_have_no_value() -> None:
    records = study()
    assert all(counts(r) for r in records)
    records[0] = replace(records[0], status="failed", reason="diverged")
    records[5] = replace(records[5], metrics=dict(records[5].metrics) | {"completeness": 0.5})
    records[8] = replace(records[8], status="timeout", reason="slow", metrics={})
    found = compare_records(records, GRID, P2GD, measure("ate")).groups["car"]
    assert (found.pairs, found.whole, found.missing_a, found.missing_b) == (24, 21, 2, 1)
    assert found.penalised["mean"].change != found.effects["mean"].change


def test_a_trajectory_from_elsewhere_is_paired_with_every_seed() -> None:
    records = [r for r in study() if r.group == "car" and r.axes["backend"] == "msckf"]
    axes = {"distribution": "its own", "backend": "Peer"}
    peers = [replace(record(str(k), 0, "grid", 1.0), key=f"p{k}", axes=axes) for k in range(4)]
    mine = {"distribution": "grid", "backend": "msckf"}
    found = pair_records([*records, *peers], mine, {"backend": "Peer", "distribution": "its own"},
                         across=("seed",))  # fmt: skip
    assert len(found.pairs) == 12


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ({"distribution": "gird"}, P2GD, "no run has distribution 'gird'.* grid, p2gd"),
        ({"weight": 1}, P2GD, "no axis weight"),
        (GRID, GRID, "share runs"),
        ({}, {}, "share runs"),
        ({"backend": "msckf", "distribution": "grid"}, {"distribution": "p2gd"}, None),
        ({"backend": "msckf"}, {"distribution": "p2gd", "backend": "smoother"}, "name more axes"),
    ],
)
def test_sides_that_make_no_pairs_are_refused(
    a: dict[str, str], b: dict[str, str], said: str | None
) -> None:
    records = study()
    if said is None:  # one run of a for two of b: each of these is a pair
        assert len(pair_records(records, a, b).pairs) == 48
        return
    if said == "name more axes":
        records += [replace(r, axes=dict(r.axes) | {"distribution": "p2gd"}) for r in records]
    with pytest.raises(ConfigError, match=said):
        pair_records(records, a, b)


def test_runs_that_nothing_tells_apart_are_refused() -> None:
    records = study()
    again = [replace(r, key=f"x{r.key}") for r in records if r.axes["distribution"] == "grid"]
    with pytest.raises(ConfigError, match="but other settings: give one study at a time"):
        pair_records([*records, *again], GRID, P2GD)


def test_every_measure_can_be_read_and_unknown_ones_are_refused() -> None:
    whole, bare = record("0", 0, "grid", 2.0), replace(study()[0], metrics={}, tracking={})
    assert measure("ate").of(whole) == 2.0 and np.isnan(measure("ate_sim3").of(whole))
    assert measure("rte_10").of(whole) == 10.0 and measure("rre_10").of(whole) == 0.1
    assert measure("scale_error").of(whole) == pytest.approx(0.03)
    assert measure("frame_ms").of(whole) == 12.0 and np.isnan(measure("rte_50").of(whole))
    bare = replace(bare, cpu_ms={})
    assert all(np.isnan(found.of(bare)) for found in MEASURES.values())
    with pytest.raises(ConfigError, match="did you mean 'mean_length'"):
        measure("mean_lenght")


def test_pieces_of_the_way_of_all_pairs() -> None:
    t = np.arange(300)
    p = np.stack([0.2 * t, 0.0 * t, 0.0 * t], axis=1)
    truth = Trajectory(t * 100_000_000, from_rotation_translation(np.eye(3), p))
    rows = [piece.to_json() for piece in segments(truth, truth)]
    records = [replace(r, segments=rows) for r in study()]
    records[0] = replace(records[0], segments=None)
    found = segment_pairs(pair_records(records, GRID, P2GD))
    assert len(found) == 47 * 6 and len({pair.route for pair in found}) == 8
    assert compare_episodes(found, draws=50)[-1].translation.change == 0.0
