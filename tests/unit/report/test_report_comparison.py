"""What a report claims is what the intervals show."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from run_records import metrics, records

from p2gd_fgo.report.layout import title
from p2gd_fgo.report.pages.collection import Baseline, Collection
from p2gd_fgo.report.pages.comparison import claims, compare_group, comparison_table
from p2gd_fgo.report.pages.episode_tables import compare_pieces, episode_table, largest_table
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.report.study_table import study_table
from p2gd_fgo.run_record import RunRecord

GRID = Baseline("distribution", "grid")


def collection(made: list[RunRecord]) -> Collection:
    return Collection([Entry(each, None) for each in made])


def made(**options: Any) -> list[RunRecord]:
    return records(**({"groups": ["car"], "backends": ["smoother"]} | options))


def test_an_effect_is_claimed_with_its_interval() -> None:
    found = collection(made(noise=0.05))
    compared = compare_group(found, "car", GRID, "yaw_pos")
    said = claims(found, compared)
    assert len(said) == 5  # ATE, ARE, RTE at 10, 50 and 100 m
    assert said[0].startswith("p2gd against grid, ATE yaw_pos −2")
    assert "n = 36 over 12 routes" in said[0] and "[" in said[0]
    (ate, *_) = compared
    effect = ate.found.effects["rms"]
    assert effect.low < -0.25 < effect.high < 0.0
    table = comparison_table(found, compared, "yaw_pos")
    assert table is not None
    cells = dict(zip((c.name for c in table.columns), table.rows[0], strict=True))
    assert cells["change of the RMS"].text in said[0]
    assert (cells["pairs"].text, cells["routes"].text) == ("36", "12")
    assert "yaw_pos" in table.caption


def test_no_effect_is_not_claimed() -> None:
    found = collection(made(effects={"grid": 1.0, "p2gd": 1.0}))
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    assert len(said) == 1 and said[0].startswith("No difference shown, the interval holds zero: ")
    for name in ("ATE yaw_pos", "ARE yaw_pos", "RTE 10 m", "RTE 50 m", "RTE 100 m"):
        assert said[0].count(f"{name} ") == 1
    assert said[0].count("n = 36 over 12 routes") == 1


def test_claims_come_first_and_each_reason_is_said_once() -> None:
    runs = made(noise=0.02) + made(groups=["car"], backends=["msckf"], effects={
        "grid": 1.0, "p2gd": 1.0
    })  # fmt: skip
    found = collection(runs)
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    assert len(said) == 6
    assert all(text.startswith("smoother: p2gd against grid, ") for text in said[:5])
    assert "msckf: p2gd against grid (n = 36 over 12 routes): ATE" in said[5]


def test_missing_runs_are_in_the_sentence_of_what_is_not_shown() -> None:
    runs = made(effects={"grid": 1.0, "p2gd": 1.0})
    runs[1] = replace(runs[1], status="failed", reason="diverged")
    found = collection(runs)
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    assert len(said) == 1
    assert "1 of 36 pairs left out, failed or incomplete" in said[0]
    assert said[0].count("with the worst run in place of those") == 5


def test_no_whole_pair_is_said_once() -> None:
    runs = [
        replace(r, status="failed", reason="diverged") if r.axes["distribution"] == "p2gd" else r
        for r in made()
    ]
    found = collection(runs)
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    assert len(said) == 1 and said[0].startswith("Nothing to compare, no pair is whole: ")


def test_one_route_gives_no_claim_however_many_seeds() -> None:
    found = collection(made(routes=1, seeds=20, noise=0.01))
    compared = compare_group(found, "car", GRID, "yaw_pos")
    said = claims(found, compared)
    assert len(said) == 1 and said[0].startswith("No claim, below 3 routes there is no interval: ")
    assert "n = 20 over 1 route)" in said[0] and "[" not in said[0]
    table = comparison_table(found, compared, "yaw_pos")
    assert table is not None and "no interval" in table.rows[0][6].text


def test_failures_are_in_the_claim_and_in_the_table() -> None:
    runs = made(noise=0.05)
    runs[1] = replace(runs[1], status="failed", reason="diverged")
    found = collection(runs)
    compared = compare_group(found, "car", GRID, "yaw_pos")
    assert "1 of 36 pairs left out" in claims(found, compared)[0]
    assert "1 of p2gd" in claims(found, compared)[0]
    table = comparison_table(found, compared, "yaw_pos")
    assert table is not None and table.rows[0][2].text == "35 (1 missing)"


def test_a_route_too_short_for_a_length_is_no_failure() -> None:
    runs = made(routes=4, seeds=1)
    short = metrics(1.0, 1.0, 1.0)
    short["rte"] = short["rte"][:2]
    runs = [replace(r, metrics=short) if r.route == "car-200" else r for r in runs]
    found = collection(runs)
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    (size,) = (re.findall(r"n = \d over \d routes", text) for text in said[-1:])
    assert size == ["n = 4 over 4 routes", "n = 3 over 3 routes"]
    whole, fewer = said[-1].split("n = 3 over 3 routes")
    assert "RTE 10 m" in whole and "RTE 100 m" in fewer and "RTE 10 m" not in fewer
    assert not any("left out" in text for text in said)


def test_a_group_is_compared_by_itself() -> None:
    runs = made(noise=0.02) + made(groups=["robot"], effects={"grid": 1.0, "p2gd": 1.5}, noise=0.02)
    found = collection(runs)
    for group, sign in (("car", -1), ("robot", 1)):
        effect = compare_group(found, group, GRID, "yaw_pos")[0].found.effects["rms"]
        assert np.sign(effect.low) == np.sign(effect.high) == sign


def test_runs_without_a_partner_are_counted() -> None:
    found = collection(made()[:-1])
    table = comparison_table(found, compare_group(found, "car", GRID, "yaw_pos"), "yaw_pos")
    assert table is not None and "1 runs have no partner" in table.notes[0]


def test_a_run_without_any_partner_is_counted_once() -> None:
    many = {"grid": 1.0, "p2gd": 1.0, "anms": 1.0}
    runs = made(effects=many, routes=4, seeds=1)
    found = collection(
        [r for r in runs if r.route != "car-203" or r.axes["distribution"] == "grid"]
    )
    table = comparison_table(found, compare_group(found, "car", GRID, "yaw_pos"), "yaw_pos")
    assert table is not None and table.notes[0].startswith("1 runs have no partner")
    assert "80 % power and 1 seed each" in table.notes[1]


def test_many_methods_are_claimed_by_ate_alone() -> None:
    many = {"grid": 1.0} | dict.fromkeys(("p2gd", "anms", "quadtree", "uniform_random"), 1.0)
    found = collection(made(effects=many, routes=4, seeds=1))
    said = claims(found, compare_group(found, "car", GRID, "yaw_pos"))
    assert len(said) == 1 and said[0].count("ATE yaw_pos") == 4
    assert "ARE" not in said[0] and "RTE" not in said[0]


def piece(index: int, error_m: float, turn_deg: float) -> dict[str, Any]:
    return {
        "index": index, "start_m": 10.0 * index, "length_m": 10.0, "start_s": 2.0 * index,
        "duration_s": 2.0, "still_share": 0.0, "turn_deg": turn_deg, "accel_m_s2": 0.5,
        "moving_share": None, "translation_m": error_m, "translation_percent": 10 * error_m,
        "rotation_deg": 0.1, "scale_error": 0.01, "ate_share": 0.1, "ate_made_m": 0.01,
        "features": 150.0, "tracks_10": 40.0, "far": 5.0, "gated": 2.0,
    }  # fmt: skip


def test_the_error_is_found_in_the_turns() -> None:
    def pieces(record: RunRecord) -> list[dict[str, Any]]:
        turning = 0.1 if record.axes["distribution"] == "grid" else 0.3
        return [piece(0, 0.1, 0.0), piece(1, turning, 40.0), piece(2, 0.1, 0.0)]

    found = collection([replace(r, segments=pieces(r)) for r in made(seeds=1)])
    compared = compare_pieces(found, "car", GRID)
    table = episode_table(compared)
    assert table is not None
    rows = {row[1].text: [cell.text for cell in row] for row in table.rows}
    assert set(rows) == {"turning", "straight on", "all"}
    names = [column.name for column in table.columns]
    turning = dict(zip(names, rows["turning"], strict=True))
    assert turning["error %"] == "1.00 / 3.00"
    assert turning["part"] == rows["all"][names.index("part")] != "0 %"
    assert rows["straight on"][names.index("part")] == "0 %"
    worst = largest_table(compared)
    assert worst is not None
    assert {row[4].text for row in worst.rows} == {"turning"}


def test_runs_without_pieces_have_no_table() -> None:
    found = collection(made(routes=3, seeds=1))
    assert compare_pieces(found, "car", GRID) == []
    assert episode_table([]) is None and largest_table([]) is None


def test_metrics_helper_is_whole() -> None:
    assert metrics(1.0, 1.0, 1.0)["completeness"] == 1.0


def as_studied(runs: list[RunRecord]) -> list[RunRecord]:
    """With the axes of a study, of which the recordings are none."""
    return [
        replace(r, axes={name: v for name, v in r.axes.items() if name != "sequence"}) for r in runs
    ]


def peers(runs: list[RunRecord], factor: float) -> list[RunRecord]:
    """One trajectory a route without seed and back end, of an ATE in proportion to one run's."""
    out = []
    for run in runs:
        if run.seed == 0 and run.axes["distribution"] == "grid":
            ate = factor * run.metrics["ate_m"]["yaw_pos"]["rmse"]
            axes = {"distribution": "Peer"}
            out.append(
                replace(run, key=f"peer/{run.route}", axes=axes, metrics=metrics(ate, 1.0, 1.0),
                        tracking={}, cpu_ms={})
            )  # fmt: skip
    return out


def test_a_trajectory_made_elsewhere_is_paired_with_every_seed() -> None:
    runs = as_studied(made(seeds=3, noise=0.02))
    found = collection([*runs, *peers(runs, 2.0)])
    compared = [c for c in compare_group(found, "car", GRID, "yaw_pos") if "Peer" in c.method]
    assert {c.measure.name.partition("_")[0] for c in compared} == {"ate", "are", "rte"}
    ate = compared[0].found
    assert (ate.pairs, ate.routes, compared[0].alone) == (36, 12, frozenset())
    assert ate.effects["mean"].change == pytest.approx(1.0, abs=0.1)
    assert ate.effects["mean"].low > 0.9


def test_the_table_of_a_study_has_it_in_every_block() -> None:
    runs = as_studied(records(groups=["car"], routes=3, seeds=2, noise=0.02))
    added = peers([r for r in runs if r.axes["backend"] == "smoother"], 2.0)
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(study_table([*runs, *added], "distribution", "grid", 120))
    text = console.export_text()
    for backend in ("smoother", "msckf"):
        block = text.partition(f"car · backend {backend}\n")[2].partition("\n\n")[0]
        assert re.search(r"Peer +3/3 .*\n +\+\d", block), block
        assert f"• car · backend {backend}, Peer against grid, ATE +" in text


@pytest.mark.parametrize(
    ("width", "heads"),
    [
        (130, ["ATE m", "ATE origin m", "ARE °", "RTE 10 m %"]),
        (80, ["ATE m", "ARE °"]),
    ],
)
def test_the_table_of_a_study_leaves_measures_out_and_cuts_none(
    width: int, heads: list[str]
) -> None:
    runs = as_studied(records(groups=["car"], routes=3, seeds=2, noise=0.02))
    long = [
        replace(r, axes={**r.axes, "distribution": "p2gd + floor + refill"})
        for r in runs
        if r.axes["distribution"] == "p2gd"
    ]
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(study_table([*runs, *long], "distribution", "grid", width))
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= width and "…" not in text
    blocks = [line for line in text.splitlines() if line.split()[:2] == ["distribution", "runs"]]
    assert len(blocks) == 2
    assert all(re.split(r"  +", line.strip())[2:] == heads for line in blocks), blocks
    assert len(re.findall(r"^ +[−+\d].*%.*\] *$", text, re.MULTILINE)) == 4


def test_names_are_no_markup() -> None:
    runs = [
        replace(r, group="car [/long]", axes={**r.axes, "distribution": f"{name} [/off]"})
        for r in as_studied(made(routes=3, seeds=1))
        if (name := r.axes["distribution"])
    ]
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(study_table(runs, "distribution", "grid [/off]", 120))
    console.print(title("car [/long]"))
    shown = console.export_text()
    assert shown.count("p2gd [/off]") > 2 and shown.count("car [/long]") > 2
