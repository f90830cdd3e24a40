"""The paper's tables hold the numbers of the runs, in its layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from run_records import metrics, record

from p2gd_fgo.report.layout import decimals, fitting
from p2gd_fgo.report.pages.collection import Baseline, Collection
from p2gd_fgo.report.pages.paper_tables import (
    absolute_table,
    lengths_table,
    relative_table,
    runtime_table,
    tracking_table,
)
from p2gd_fgo.report.pages.sources import Entry
from p2gd_fgo.report.pages.table_model import ReportTable
from p2gd_fgo.run_record import RunRecord

GRID = Baseline("distribution", "grid")
ATE = {("one", "grid"): [4.0, 6.0], ("one", "p2gd"): [3.0, 3.0],
       ("two", "grid"): [1.0, 3.0], ("two", "p2gd"): [1.0, 1.0]}  # fmt: skip


def runs() -> list[RunRecord]:
    return [
        record("", route, seed, "smoother", distribution, metrics(ate, ate / 10, ate / 2))
        for (route, distribution), values in ATE.items()
        for seed, ate in enumerate(values)
    ]


def collection(made: list[RunRecord]) -> Collection:
    return Collection([Entry(each, None) for each in made])


def texts(table: ReportTable | None) -> list[list[str]]:
    assert table is not None
    return [[cell.text for cell in row] for row in (*table.rows, *table.summary)]


def test_absolute_errors_as_the_paper_prints_them() -> None:
    table = absolute_table(collection(runs()), "", GRID, "yaw_pos")
    assert table is not None
    assert [column.name for column in table.columns] == ["sequence", "grid", "p2gd", "decrease"]
    rms_grid, rms_p2gd = (float(np.sqrt(np.mean(np.square(v)))) for v in ([5, 2], [3, 1]))
    assert texts(table) == [
        ["one", "0.500 / 5.00", "0.300 / 3.00", "+0.200 / +2.00"],
        ["two", "0.200 / 2.00", "0.100 / 1.00", "+0.100 / +1.00"],
        [
            "RMS",
            f"{rms_grid / 10:.3f} / {rms_grid:.2f}",
            f"{rms_p2gd / 10:.3f} / {rms_p2gd:.2f}",
            f"+{(rms_grid - rms_p2gd) / 10:.3f} / +{rms_grid - rms_p2gd:.2f}",
        ],
    ]
    assert "yaw_pos (position + yaw)" in table.caption and "8 runs" in table.caption
    assert table.meaning == "ARE ° / ATE m"


def test_another_alignment_gives_its_own_numbers() -> None:
    table = absolute_table(collection(runs()), "", GRID, "origin")
    assert texts(table)[0][1] == "0.750 / 7.50"
    assert table is not None and "origin" in table.caption


def test_relative_errors_by_length() -> None:
    table = relative_table(collection(runs()), "", GRID)
    assert table is not None
    assert [c.name for c in table.columns] == ["sequence", "method", "10 m", "50 m", "100 m"]
    rows = texts(table)
    assert rows[0][:3] == ["one", "grid", "0.100 / 2.50"]
    assert [row[:2] for row in rows[4:]] == [["RMS", "grid"], ["RMS", "p2gd"], ["decrease", "p2gd"]]
    base, other = (float(row[2].split(" / ")[1]) for row in rows[4:6])
    assert float(rows[6][2].split(" / ")[1]) == pytest.approx(base - other, abs=0.011)


def test_tracks_rise_where_errors_fall() -> None:
    table = tracking_table(collection(runs()), "", GRID)
    assert table is not None
    assert table.columns[-1].name == "increase"
    *_, grid, p2gd, change = table.summary[0]
    for before, after, more in zip(grid.parts, p2gd.parts, change.parts, strict=True):
        assert isinstance(before.order, float) and isinstance(after.order, float)
        if after.order > before.order:
            assert more.text.startswith("+")


def test_shares_and_times() -> None:
    (row, *_) = texts(lengths_table(collection(runs()), "", GRID))
    assert row[:2] == ["one", "grid"]
    assert [float(text) for text in row[2:]] == [35.0, 4.6, 1.6, 0.9, 9.0]
    table = runtime_table(collection(runs()), "")
    assert table is not None and table.columns[-1].name == "whole frame"


@pytest.mark.parametrize(
    "changes",
    [
        {"status": "failed", "reason": "diverged"},
        {"status": "crashed", "reason": "killed", "metrics": {}},
        {"metrics": metrics(99.0, 99.0, 99.0, completeness=0.5)},
    ],
)
def test_a_run_that_does_not_count_is_left_out_and_seen(changes: dict[str, object]) -> None:
    made = runs()
    made[0] = replace(made[0], **changes)  # type: ignore[arg-type]
    table = absolute_table(collection(made), "", GRID, "yaw_pos")
    rows = texts(table)
    assert rows[0][1] == "0.600 / 6.00 (1/2)"
    assert table is not None and "(2/3)" in table.notes[0]
    made[1] = replace(made[1], **changes)  # type: ignore[arg-type]
    rows = texts(absolute_table(collection(made), "", GRID, "yaw_pos"))
    assert rows[0][1] == "– / – (0/2)"
    assert rows[-1] == ["RMS (1 of 2)", "0.200 / 2.00", "0.100 / 1.00", "+0.100 / +1.00"]


def test_one_run_of_each_is_said_to_be_chance() -> None:
    table = absolute_table(collection(runs()[::2]), "", GRID, "yaw_pos")
    assert table is not None and "a difference may be chance." in table.caption


def test_no_table_without_truth() -> None:
    blind = [replace(r, metrics={"alignment": "yaw_pos", "completeness": 1.0}) for r in runs()]
    assert absolute_table(collection(blind), "", GRID, "yaw_pos") is None
    assert relative_table(collection(blind), "", GRID) is None
    assert tracking_table(collection(blind), "", GRID) is not None


@pytest.mark.parametrize(
    ("values", "wanted"),
    [([16.77, 13.22], 1), ([0.0551, 0.0217], 4), ([120.0, 450.0], 0), ([1.5, float("nan")], 2),
     ([], 2), ([0.0], 2), ([1e-9], 6), ([0.0059, 0.0063], 5), ([0.038, 1.1], 3)],
)  # fmt: skip
def test_three_digits_are_shown(values: list[float], wanted: int) -> None:
    assert decimals(values) == wanted


def test_a_column_of_recordings_worlds_apart_keeps_the_digits_of_each() -> None:
    assert fitting([0.00591, 3.432, 3.64, 4.11, float("nan"), 0.0]) == [
        "0.00591", "3.43", "3.64", "4.11", "–", "0.00",
    ]  # fmt: skip
    assert fitting([0.0512, 0.171, 0.411, 0.592]) == ["0.051", "0.171", "0.411", "0.592"]


def test_the_difference_has_the_digits_of_what_it_is_between() -> None:
    made = [
        record("", route, 0, "smoother", kind, metrics(ate, 0.5, 1.0))
        for route, ates in {"euroc": (0.0059, 0.0067), "a": (3.43, 3.64), "b": (4.1, 3.9)}.items()
        for kind, ate in zip(("grid", "p2gd"), ates, strict=True)
    ]
    rows = {row[0]: row for row in texts(absolute_table(collection(made), "", GRID, "yaw_pos"))}
    assert [cell.split(" / ")[1] for cell in rows["euroc"][1:]] == [
        "0.00590",
        "0.00670",
        "−0.00080",
    ]
    assert [cell.split(" / ")[1] for cell in rows["a"][1:]] == ["3.43", "3.64", "−0.21"]


def test_the_best_of_a_sequence_stands_out() -> None:
    table = absolute_table(collection(runs()), "", GRID, "yaw_pos")
    assert table is not None and "Bold: the best of a sequence." in table.caption
    for row in (*table.rows, *table.summary):
        assert [[p.best for p in cell.parts] for cell in row[1:]] == [
            [False] * 2,
            [True] * 2,
            [False] * 2,
        ]
    tracks = tracking_table(collection(runs()), "", GRID)
    assert tracks is not None
    for row in tracks.rows:
        sizes = [[float(part.order or 0.0) for part in cell.parts] for cell in row[1:3]]
        for k, part in enumerate(row[2].parts):
            assert part.best == (sizes[1][k] > sizes[0][k])
    relative = relative_table(collection(runs()), "", GRID)
    assert relative is not None
    assert not any(part.best for part in relative.rows[0][2].parts[1:])
    assert all(part.best for part in relative.rows[1][2].parts[1:])


def test_routes_stand_in_the_order_of_their_numbers() -> None:
    made = [
        record("", name, 0, "smoother", kind, metrics(1.0, 1.0, 1.0))
        for name in ("way-10", "way-9", "other-1")
        for kind in ("grid", "p2gd")
    ]
    rows = texts(absolute_table(collection(made), "", GRID, "yaw_pos"))
    assert [row[0] for row in rows] == ["other-1", "way-9", "way-10", "RMS"]
