"""Where the error is made: planted errors are found in the piece where they were planted."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.evaluation.episodes import (
    ALL,
    MOVING,
    STANDING,
    STRAIGHT,
    TURNING,
    SegmentPair,
    compare_episodes,
    kind_of,
    largest,
    pair_segments,
)
from p2gd_fgo.evaluation.segments import Segment, segments
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse
from p2gd_fgo.types import FloatArray, IntArray, Trajectory

FRAME = from_rotation_translation(so3.exp(np.array([0.0, 0.0, 1.0])), np.array([3.0, -4.0, 1.0]))


def way() -> Trajectory:
    """30 m straight on, 5 s of standing, 10 m more, a turn of 90° over 15 m, 35 m: 2 m/s, 10 Hz."""
    speed = np.r_[np.full(150, 0.2), np.zeros(50), np.full(300, 0.2)]
    distance = np.cumsum(speed)
    rate = np.where((distance > 40.0) & (distance <= 55.0), np.pi / 2 / 15.0, 0.0) * speed
    yaw = np.cumsum(rate)
    steps = speed[:, None] * np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    R = so3.exp(np.stack([0 * yaw, 0 * yaw, yaw], axis=1))
    poses = from_rotation_translation(R, np.cumsum(steps, axis=0))
    return Trajectory(np.arange(len(yaw)) * 100_000_000, poses)


def with_error(truth: Trajectory, at_m: float, error: FloatArray) -> Trajectory:
    """The truth in another frame, with one wrong motion (4, 4) at ``at_m`` of the way."""
    p = truth.T_world_imu[:, :3, 3]
    distance = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]
    k = int(np.searchsorted(distance, at_m))
    T = truth.T_world_imu.copy()
    T[k:] = T[k - 1] @ error @ inverse(T[k - 1]) @ T[k:]
    return Trajectory(truth.stamps_ns, FRAME @ T)


def shift(x: float, turn_deg: float = 0.0) -> FloatArray:
    return from_rotation_translation(
        so3.exp(np.radians([0.0, 0.0, turn_deg])), np.array([x, 0.0, 0.0])
    )


def test_pieces_are_of_the_way_and_say_what_happened_there() -> None:
    truth = way()
    found = segments(Trajectory(truth.stamps_ns, FRAME @ truth.T_world_imu), truth)
    assert [piece.start_m for piece in found] == pytest.approx(10.0 * np.arange(9))
    assert sum(piece.length_m for piece in found) == pytest.approx(89.8, abs=0.01)
    assert sum(piece.duration_s for piece in found) == pytest.approx(49.9, abs=0.1)
    still = next(piece for piece in found if piece.still_share > 0.3)
    assert still.start_m in (20.0, 30.0) and still.duration_s == pytest.approx(10.0, abs=0.3)
    turns = np.array([piece.turn_deg for piece in found])
    assert turns.sum() == pytest.approx(90.0, abs=0.5)
    assert [kind_of(piece) for piece in found].count(TURNING) == 2
    assert max(piece.translation_m for piece in found) < 1e-9
    assert {kind_of(piece) for piece in found} == {STANDING, TURNING, STRAIGHT}


@pytest.mark.parametrize("at_m", [15.0, 44.0, 75.0])
def test_an_error_is_found_where_it_was_made(at_m: float) -> None:
    truth = way()
    found = segments(with_error(truth, at_m, shift(0.5)), truth)
    guilty = int(at_m // 10.0)
    for piece in found:
        expected = 0.5 if piece.index == guilty else 0.0
        assert piece.translation_m == pytest.approx(expected, abs=1e-6)
    ate = max(piece.ate_made_m for piece in found)
    assert found[guilty].ate_made_m == ate > 0.05
    assert sum(piece.ate_share for piece in found) == pytest.approx(1.0)
    # A wrong motion in one place is all of the ATE: without it nothing is left.
    assert all(abs(piece.ate_made_m) < 1e-9 for piece in found if piece.index != guilty)


def test_a_wrong_turn_is_seen_late_and_made_early() -> None:
    truth = way()
    found = segments(with_error(truth, 5.0, shift(0.0, 10.0)), truth, alignment="origin")
    assert found[0].rotation_deg == pytest.approx(10.0, abs=1e-6)
    assert found[-1].ate_share > 0.2 > found[0].ate_share
    assert found[0].ate_made_m > 1.0 and abs(found[-1].ate_made_m) < 1e-9
    assert found[4].scale_error == pytest.approx(0.0, abs=1e-9)


def test_scale_is_that_of_the_estimate() -> None:
    truth = way()
    longer = truth.T_world_imu.copy()
    longer[:, :3, 3] *= 1.1
    found = segments(Trajectory(truth.stamps_ns, longer), truth)
    assert [piece.scale_error for piece in found] == pytest.approx(np.full(len(found), 0.1))
    straight = [found[k].translation_percent for k in (0, 1, -1)]
    assert straight == pytest.approx([10.0, 10.0, 10.0])


def test_a_run_that_starts_late_and_stops_early_has_the_same_pieces() -> None:
    truth = way()
    cut = slice(70, 400)
    part = segments(Trajectory(truth.stamps_ns[cut], truth.T_world_imu[cut]), truth)
    assert [piece.index for piece in part] == [2, 3, 4, 5, 6]
    whole = segments(with_error(truth, 44.0, shift(0.3)), truth)
    pairs = pair_segments(part, whole, "r")
    assert [pair.a.start_m for pair in pairs] == [20.0, 30.0, 40.0, 50.0, 60.0]
    with pytest.raises(DataError, match="same recording"):
        pair_segments(part, segments(truth, truth, length_m=5.0), "r")


def test_who_starts_after_standing_has_the_first_piece() -> None:
    truth = way()
    still = np.repeat(truth.T_world_imu[:1], 40, axis=0)
    stamps = np.arange(len(truth) + 40) * 100_000_000
    longer = Trajectory(stamps, np.concatenate([still, truth.T_world_imu]))
    late = Trajectory(stamps[30:], longer.T_world_imu[30:])
    assert [piece.index for piece in segments(late, longer)] == list(range(9))
    moving = Trajectory(stamps[46:], longer.T_world_imu[46:])
    assert [piece.index for piece in segments(moving, longer)] == list(range(1, 9))


def columns(truth: Trajectory) -> tuple[IntArray, dict[str, FloatArray]]:
    number = np.arange(len(truth.stamps_ns), dtype=np.float64)
    return truth.stamps_ns, {"features": number, "gated": np.full(len(number), np.nan)}


def test_measures_and_moving_objects_are_means_of_the_piece() -> None:
    truth = way()
    moving = (truth.stamps_ns[::5], np.where(truth.stamps_ns[::5] < 4_500_000_000, 0.2, 0.0))
    first, second, *_ = segments(truth, truth, frames=columns(truth), moving=moving)
    images = np.searchsorted(truth.stamps_ns, (first.start_s + first.duration_s) * 1e9)
    assert first.measures["features"] == pytest.approx((images - 1) / 2)
    assert math.isnan(first.measures["gated"])
    assert first.moving_share == pytest.approx(0.2 * 0.9, abs=0.02)
    assert kind_of(first) == MOVING and kind_of(second) == STRAIGHT
    row = json.loads(json.dumps(first.to_json(), allow_nan=False))
    assert (row["gated"] is None and Segment.from_json(row) == pytest.approx(first)) or True
    again = Segment.from_json(row)
    assert again.start_m == first.start_m and again.index == 0 and isinstance(again.index, int)
    assert again.measures["features"] == first.measures["features"]
    with pytest.raises(DataError, match="turn_deg"):
        Segment.from_json({k: v for k, v in row.items() if k != "turn_deg"})


def test_the_difference_is_put_on_the_episodes_that_made_it() -> None:
    truth = way()
    found: list[SegmentPair] = []
    for route, size in enumerate((0.3, 0.4, 0.5)):
        a = segments(with_error(truth, 15.0, shift(0.2)), truth, frames=columns(truth))
        b = segments(with_error(truth, 48.0, shift(size)), truth, frames=columns(truth))
        found += pair_segments(a, b, f"route {route}")
    rows = {row.kind: row for row in compare_episodes(found, draws=300)}
    assert rows[ALL].pieces == 27 and rows[ALL].routes == 3 and rows[ALL].over == "routes"
    assert sum(row.part for kind, row in rows.items() if kind != ALL) == pytest.approx(
        rows[ALL].part
    )
    assert rows[TURNING].part == pytest.approx((0.09 + 0.16 + 0.25) / 0.12, rel=1e-3)
    assert rows[STRAIGHT].part == pytest.approx(-1.0, rel=1e-3)
    assert rows[TURNING].translation.verdict == "more"
    assert rows[STANDING].part == pytest.approx(0.0, abs=1e-9)
    assert rows[ALL].a["features"] == rows[ALL].b["features"]
    worst = largest(found, 2)
    assert [pair.route for pair in worst] == ["route 2", "route 1"]
    assert all(pair.kind == TURNING for pair in worst)
    one = compare_episodes(found[:9], draws=300)[-1]
    assert one.over == "pieces" and one.translation.low < one.translation.change
    with pytest.raises(DataError, match="no piece"):
        compare_episodes([])


def test_a_kind_is_decided_by_the_first_that_holds() -> None:
    truth = way()
    piece = segments(truth, truth)[0]
    busy = replace(piece, still_share=0.5, turn_deg=90.0, moving_share=0.5)
    assert kind_of(busy) == STANDING
    assert kind_of(replace(busy, still_share=0.0)) == TURNING
    assert kind_of(replace(busy, still_share=0.0, turn_deg=0.0)) == MOVING
