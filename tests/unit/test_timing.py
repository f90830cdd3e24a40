"""The stage timer: CPU and wall, summed per stage, emptied by taking."""

from __future__ import annotations

import time

import pytest

from p2gd_fgo.timing import StageTimer


def burn(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_cpu_and_wall_time_are_told_apart() -> None:
    timer = StageTimer()
    with timer.stage("busy"):
        burn(0.02)
    with timer.stage("idle"):
        time.sleep(0.03)
    taken = timer.take()
    assert taken["busy"][0] >= 20.0 and taken["busy"][1] >= 19.0
    assert taken["idle"][0] < 15.0 and taken["idle"][1] >= 30.0


def test_a_stage_adds_up_and_nests_and_taking_empties() -> None:
    timer = StageTimer()
    with timer.stage("frame"):
        for _ in range(3):
            with timer.stage("inner"):
                burn(0.005)
    taken = timer.take()
    assert taken["inner"][0] >= 15.0
    assert taken["frame"][0] >= taken["inner"][0]
    assert timer.take() == {}


def test_inner_stages_are_named_after_the_outer_one() -> None:
    timer = StageTimer()
    with timer.stage("frame"), timer.stage("update"), timer.stage("solve"):
        pass
    with timer.stage("solve"):
        pass
    assert list(timer.take()) == ["frame", "update", "update.solve", "solve"]


def test_a_stage_that_raises_is_still_timed() -> None:
    timer = StageTimer()
    with pytest.raises(KeyError), timer.stage("broken"):
        burn(0.005)
        raise KeyError
    with timer.stage("next"):
        pass
    taken = timer.take()
    assert taken["broken"][0] >= 5.0
    assert list(taken) == ["broken", "next"]
