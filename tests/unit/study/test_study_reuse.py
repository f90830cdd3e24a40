"""Finished runs of one study in another: which are taken over, and under which labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from run_records import write_records

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.run_record import RESULTS, RunRecord
from p2gd_fgo.study.expansion import Plan, expand
from p2gd_fgo.study.reuse import reusable_records
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.spec import StudySpec
from p2gd_fgo.study.work import unfinished


def plan(name: str, axes: dict[str, Any], **changes: Any) -> Plan:
    spec = {
        "name": name,
        "question": "q",
        "sequences": [{"simulate": "robot_like", "routes": [3], "duration_s": 2}],
        "axes": axes,
        **changes,
    }
    return expand(StudySpec.model_validate(spec), Path())


@pytest.fixture(scope="module")
def first() -> tuple[Run, ...]:
    return plan("first", {"distribution": ["grid", "p2gd"], "seed": [0, 1]}).runs


@pytest.fixture(scope="module")
def second() -> tuple[Run, ...]:
    """Two of the runs of the first under other labels, and one of its own."""
    policy = {"uniform": {}, "guided": {"distribution.kind": "p2gd"}, "anms": {
        "distribution.kind": "anms"}}  # fmt: skip
    sequences = [{"simulate": "robot_like", "routes": [3], "duration_s": 2, "group": "robots"}]
    return plan("second", {"policy": policy}, sequences=sequences).runs


def done(run: Run, **changes: Any) -> RunRecord:
    made = replace(unfinished(run, "crashed", "", 2.0), status="done", reason=None)
    return replace(made, metrics={"name": run.sequence, "ate": 1.5}, **changes)


def put(folder: Path, records: Sequence[RunRecord]) -> Path:
    write_records(folder / RESULTS, records)
    return folder


def test_the_same_runs_get_the_labels_of_this_study(
    first: tuple[Run, ...], second: tuple[Run, ...], tmp_path: Path
) -> None:
    made = [done(run, directory=f"runs/{run.key}") for run in first]
    other = put(tmp_path / "first", made)
    (other / "runs" / first[0].key).mkdir(parents=True)
    taken = reusable_records(second, [other], tmp_path / "deep" / "second")
    assert [record.key for record in taken] == [run.key for run in second[:2]]
    record = taken[0]
    assert record.axes == {"policy": "uniform"} and record.study == "second"
    assert (record.group, record.route, record.sequence) == ("robots", "robots-3", "robots-3")
    assert record.metrics == {"name": "robots-3", "ate": 1.5} and record.seconds == 2.0
    assert record.directory == f"../../first/runs/{record.key}"
    assert taken[1].directory is None  # its run directory is not there


def test_only_what_this_study_would_have_done_so_is_taken(
    first: tuple[Run, ...], tmp_path: Path
) -> None:
    older, crashed, late, failed = first
    made = [
        done(older, code="older"),
        unfinished(crashed, "crashed", "fell over", 1.0),
        unfinished(late, "timeout", "slow", 1.0),
        unfinished(failed, "failed", "start refused", 1.0),
    ]
    other = put(tmp_path / "first", made)

    def keys(**options: bool) -> list[str]:
        return [r.key for r in reusable_records(first, [other], tmp_path / "out", **options)]

    assert keys() == [failed.key]
    assert keys(keep_older_code=True) == [older.key, failed.key]


def test_segments_must_be_there_where_they_are_wanted_and_only_there(
    first: tuple[Run, ...], tmp_path: Path
) -> None:
    without, having, failed, _ = first
    made = [
        done(without),
        done(having, segments=[{"start_m": 0.0}]),
        unfinished(failed, "failed", "start refused", 1.0),
    ]
    other = put(tmp_path / "first", made)
    wanting = [replace(run, segments=True) for run in first]
    taken = reusable_records(wanting, [other], tmp_path)
    assert [(r.key, r.segments) for r in taken] == [
        (having.key, [{"start_m": 0.0}]),
        (failed.key, None),
    ]
    plain = reusable_records(first, [other], tmp_path)
    assert [record.segments for record in plain] == [None] * 3


def test_the_first_place_counts_and_every_place_must_be_one(
    first: tuple[Run, ...], tmp_path: Path
) -> None:
    a = put(tmp_path / "a", [done(first[0], seconds=1.0)])
    b = put(tmp_path / "b", [done(run, seconds=2.0) for run in first[:2]])
    taken = reusable_records(first, [a / RESULTS, b], tmp_path / "out")
    assert [record.seconds for record in taken] == [1.0, 2.0]
    with pytest.raises(ConfigError, match=r"--from .*nothing: there is no results\.jsonl"):
        reusable_records(first, [tmp_path / "nothing"], tmp_path / "out")
