"""A standing body stays where it is reported, and goes on from there."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.backends.held_position import HeldPosition
from p2gd_fgo.types import Estimate, NavState, Trajectory

STEP_NS = 10**8


def estimate(index: int, x: float, *, still: bool) -> Estimate:
    """At x, with a window of two poses, the older one 0.25 m behind."""
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, 0, 3] = x - 0.25, x
    stamps = np.array([index - 1, index], dtype=np.int64) * STEP_NS
    state = NavState(index * STEP_NS, T[1], np.zeros(3))
    return Estimate(state, np.eye(15), Trajectory(stamps, T), still)


def reported(held: HeldPosition, xs: list[float], still: list[bool]) -> list[float]:
    out = []
    for k, (x, s) in enumerate(zip(xs, still, strict=True)):
        answer = held.hold(estimate(k, x, still=s))
        positions = answer.window.T_world_imu[:, 0, 3]
        assert positions[1] == answer.state.T_world_imu[0, 3]
        assert positions[1] - positions[0] == pytest.approx(0.25)
        out.append(float(positions[1]))
    return out


def test_position_is_held_after_a_while_and_the_offset_stays() -> None:
    held = HeldPosition(0.3)
    still = [False, True, True, True, True, True, True, False, False]
    xs = [0.0, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 2.5, 3.5]
    # Still from the image at 1.0 on; 0.3 s later it is held at 1.3, and 0.2 m are taken up.
    expected = [0.0, 1.0, 1.1, 1.2, 1.3, 1.3, 1.3, 2.3, 3.3]
    assert reported(held, xs, still) == pytest.approx(expected)
    moved = held.moved(estimate(9, 4.0, still=False).state)
    assert moved.T_world_imu[0, 3] == pytest.approx(3.8)


def test_a_second_standstill_is_held_from_where_it_is_reported() -> None:
    held = HeldPosition(0.1)
    still = [True, True, True, False, True, True, True]
    xs = [0.0, 0.1, 0.2, 1.2, 1.3, 1.4, 1.5]
    assert reported(held, xs, still) == pytest.approx([0.0, 0.1, 0.1, 1.1, 1.2, 1.3, 1.3])


def test_never_held() -> None:
    xs = [0.0, 0.1, 0.2, 0.3]
    assert reported(HeldPosition(None), xs, [True] * 4) == xs
