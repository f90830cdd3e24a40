"""Table VIII holds the errors by noise, with every repeat, in all forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from run_records import metrics, record, write_records

from p2gd_fgo.report.pages.collection import Baseline, Collection, choose_baseline
from p2gd_fgo.report.pages.noise_table import noise_table
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.report.pages.write import write_report
from p2gd_fgo.run_record import Label, RunRecord

FACTORS = {"1.0 deg": 1.8, "0.10 m": 1.6, "grid": 2.0, "0.5 deg": 1.7, "truth": 1.0, "0.05 m": 1.5}


def runs(backends: tuple[str, ...] = ("smoother", "msckf")) -> list[RunRecord]:
    """ATE of route 200 is 1 m, of 201 2 m, times a factor of the noise and 1, 2 or 3 by seed."""
    made = [
        (record("robot", f"robot-{200 + k}", seed, backend, label, found), label)
        for backend in backends
        for label, factor in FACTORS.items()
        for k in range(2)
        for seed in range(3)
        for found in [metrics((k + 1) * factor * (seed + 1), factor, 1.0)]
    ]
    return [
        replace(r, axes={"backend": r.axes["backend"], "priors": label, "seed": r.seed})
        for r, label in made
    ]


def collection(made: list[RunRecord]) -> Collection:
    return Collection([Entry(each, None) for each in made])


def test_rows_are_the_noise_and_columns_the_repeats() -> None:
    table = noise_table(collection(runs()), "robot", "yaw_pos")
    assert table is not None
    assert [column.name for column in table.columns] == [
        "back end", "prior poses", "seed 0", "seed 1", "seed 2", "mean", "against the grid",
    ]  # fmt: skip
    names = [row[1].text for row in table.rows]
    block = ["grid", "truth", "position 0.05 m", "position 0.1 m", "yaw 0.5°", "yaw 1°"]
    assert names == 2 * block
    assert [row[0].text for row in table.rows] == ["smoother"] * 6 + ["msckf"] * 6
    factors = [2.0, 1.0, 1.5, 1.6, 1.7, 1.8]
    rms = math.sqrt((1 + 4) / 2)
    for row, factor in zip(table.rows[:6], factors, strict=True):
        ates = [cell.parts[1].order for cell in row[2:6]]
        wanted = [factor * rms, 2 * factor * rms, 3 * factor * rms, 2 * factor * rms]
        assert ates == pytest.approx(wanted)
        if factor != 2.0:
            assert row[6].parts[1].order == pytest.approx(100 * (factor / 2 - 1))
    assert [all(part.best for part in row[5].parts) for row in table.rows[:6]] == [
        k == 1 for k in range(6)
    ]
    assert "RMS over 2 of 2 sequences" in table.caption and "3 repeats" in table.caption


def test_a_sequence_that_one_run_did_not_get_through_is_in_no_number() -> None:
    made = runs(("msckf",))
    made[0] = replace(made[0], status="failed", reason="diverged")
    table = noise_table(collection(made), "robot", "yaw_pos")
    assert table is not None and "RMS over 1 of 2 sequences" in table.caption
    assert table.columns[0].name == "prior poses"
    (truth,) = (row for row in table.rows if row[0].text == "truth")
    assert truth[1].parts[1].order == pytest.approx(2.0)


def test_other_studies_have_no_such_table() -> None:
    made = [r for r in runs() if r.axes["priors"] in ("grid", "truth", "0.05 m")]
    assert noise_table(collection(made), "robot", "yaw_pos") is None


def test_run_directories_that_differ_in_the_noise_have_it() -> None:
    noise = {"grid": (0.0, 0.0), "truth": (0.0, 0.0), "0.05 m": (0.05, 0.0), "1.0 deg": (0.0, 1.0)}
    made = [
        replace(
            r,
            axes={
                "backend": "msckf", "seed": r.seed,
                "distribution": "grid" if label == "grid" else "p2gd",
                "position_noise": noise[label][0], "yaw_noise_deg": noise[label][1],
            },
        )
        for r in runs(("msckf",))
        if (label := str(r.axes["priors"])) in noise
    ]  # fmt: skip
    table = noise_table(collection(made), "robot", "yaw_pos")
    assert table is not None
    assert [row[0].text for row in table.rows] == ["grid", "p2gd", "position 0.05 m", "yaw 1°"]


def test_the_grid_is_the_reference_on_whatever_axis_it_is() -> None:
    assert choose_baseline(collection(runs()), None) == Baseline("priors", "grid")


def test_it_stands_in_every_file(tmp_path: Path) -> None:
    write_records(tmp_path / "results.jsonl", runs())
    tex, md = tmp_path / "t.tex", tmp_path / "t.md"
    write_report([tmp_path], latex_file=tex, markdown_file=md)
    for path in (tex, md, tmp_path / "report.html"):
        text = path.read_text(encoding="utf-8")
        assert "noise on the prior poses" in text and "position 0.05 m" in text, path


def test_levels_without_a_number_are_left_out() -> None:
    levels: dict[str, Label] = {"0.05 m": 0.05, "0.10 m": 0.1, "truth": "none"}
    made = [
        replace(r, axes={"backend": "msckf", "seed": r.seed, "position_noise": levels[name]})
        for r in runs(("msckf",))
        if (name := str(r.axes["priors"])) in levels
    ]
    peer = [replace(made[0], key="p", axes={"backend": "Peer"})]
    table = noise_table(collection([*made, *peer]), "robot", "yaw_pos")
    assert table is not None
    assert [row[0].text for row in table.rows] == ["position 0.05 m", "position 0.1 m"]
