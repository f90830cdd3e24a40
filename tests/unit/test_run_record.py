"""Records of runs: there and back, refused where they are bad, the same whatever the order."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.run_record import PLAN, RunRecord, canonical, read_plan, read_records, write_plan

RECORD = RunRecord(
    key="0123",
    study="absolute_error",
    axes={"backend": "smoother", "window": 20, "noise": 0.5, "refill": True},
    sequence="kaist_like-200",
    route="kaist_like-200",
    group="kaist_like",
    seed=3,
    status="done",
    metrics={"ate_m": {"yaw_pos": {"rmse": 0.25}, "se3": None}},
    tracking={"mean_length": 5.0},
    segments=[{"length_m": 10.0, "events": {"turn": 1}}],
    events={"standstill": 2},
    seconds=12.5,
    cpu_ms={"frame": {"median": 10.0}},
    directory="runs/0123",
    code="abc",
    versions={"numpy": "2"},
)


def test_there_and_back() -> None:
    assert RunRecord.from_json(RECORD.to_json()) == RECORD
    assert "\n" not in replace(RECORD, reason="two\nlines").to_json()


def test_segments_that_were_not_taken_are_absent() -> None:
    bare = replace(RECORD, segments=None)
    assert "segments" not in json.loads(bare.to_json())
    assert RunRecord.from_json(bare.to_json()) == bare


def test_a_number_that_is_none_is_not_written() -> None:
    with pytest.raises(ValueError, match="JSON"):
        replace(RECORD, metrics={"ate": math.nan}).to_json()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"status": "well"}, "field 'status'"),
        ({"schema": 2}, "field 'schema': Input should be 1"),
        ({"seed": "3"}, "field 'seed': Input should be a valid integer"),
        ({"extra": 1}, "field 'extra'"),
        ({"axes": {"backend": ["a"]}}, "field 'axes.backend"),
        ({"key": None}, "field 'key'"),
    ],
)
def test_a_bad_line_is_refused_with_its_place(
    change: dict[str, Any], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "results.jsonl"
    bad = json.dumps(json.loads(RECORD.to_json()) | change)
    path.write_text(f"{RECORD.to_json()}\n{bad}\n")
    with pytest.raises(DataError) as refused:
        read_records(path)
    assert str(refused.value).startswith(f"{path}, line 2, is no record") and words in str(
        refused.value
    )


def test_a_torn_last_line_is_left_out_but_not_one_in_the_middle(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    other = replace(RECORD, key="4567")
    path.write_text(f"{RECORD.to_json()}\n{other.to_json()[:40]}")
    assert read_records(path) == [RECORD]
    path.write_text(f"{RECORD.to_json()[:40]}\n{other.to_json()}\n")
    with pytest.raises(DataError, match="line 1, is no record"):
        read_records(path)


def test_a_line_torn_within_a_character_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    torn = replace(RECORD, key="4567", reason="turned by 8°").to_json().encode()
    path.write_bytes(RECORD.to_json().encode() + b"\n" + torn[: torn.index("°".encode()) + 1])
    assert read_records(path) == [RECORD]


def test_a_plan_says_which_lines_are_a_study_s(tmp_path: Path) -> None:
    assert read_plan(tmp_path) is None
    write_plan(tmp_path, ["a", "b"])
    assert read_plan(tmp_path) == frozenset("ab")
    for text in ("[]", "{", '{"runs": 3}'):
        (tmp_path / PLAN).write_text(text)
        with pytest.raises(DataError, match=r"plan\.json: is no list of a study's runs"):
            read_plan(tmp_path)


def test_of_one_key_the_last_line_counts(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    again = replace(RECORD, status="crashed", reason="the process died")
    path.write_text(
        f"{RECORD.to_json()}\n{replace(RECORD, key='9').to_json()}\n{again.to_json()}\n"
    )
    assert [(r.key, r.status) for r in read_records(path)] == [("9", "done"), ("0123", "crashed")]


def test_no_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="the records can't be read"):
        read_records(tmp_path / "none.jsonl")


def test_the_canonical_form_knows_neither_order_nor_time() -> None:
    records = [
        replace(RECORD, key=f"{seed}{kind}", seed=seed, axes={"backend": kind, "window": 20})
        for seed in (10, 9)
        for kind in ("smoother", "msckf")
    ]
    slower = [replace(r, seconds=99.0, cpu_ms={}) for r in reversed(records)]
    assert canonical(records) == canonical(slower)
    assert canonical(records, timing=True) != canonical(slower, timing=True)
    worse = replace(slower[0], metrics={"ate_m": 0.3})
    assert canonical([worse, *slower[1:]]) != canonical(records)
    seeds = [json.loads(line)["seed"] for line in canonical(records).splitlines()]
    assert seeds == [9, 9, 10, 10]
