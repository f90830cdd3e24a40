"""Interpolation along screws, and never across a hole."""

from __future__ import annotations

import numpy as np
import pytest
from prior_scenes import EPOCH_NS, arc, one_second, stamps

from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors.resampling import at_stamps, covered, leading, resample
from p2gd_fgo.priors.screw import along_screw, interpolate_screws
from p2gd_fgo.types import NANOSECONDS, PriorPoses, Trajectory

MS = NANOSECONDS // 1000


@pytest.mark.parametrize("turn_deg", [0.0, 1e-3, 20.0, -120.0])
def test_a_screw_is_a_thousand_small_steps(turn_deg: float) -> None:
    second = one_second(10.0, turn_deg)
    shares = np.array([0.0, 0.25, 1.0, 3.0])
    poses = along_screw(second, shares)
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(np.linalg.matrix_power(poses[1], 4), second, atol=1e-9)
    np.testing.assert_allclose(poses[2], second, atol=1e-9)
    np.testing.assert_allclose(poses[3], second @ second @ second, atol=1e-8)


def test_interpolation_is_exact_on_a_constant_twist() -> None:
    sparse = arc(stamps(5, NANOSECONDS), turn_deg=40.0)
    query = EPOCH_NS + np.array([0, 1, 137, 999, 1000, 1500, 3999, 4000]) * MS
    np.testing.assert_allclose(
        interpolate_screws(sparse, query), arc(query, turn_deg=40.0).T_world_imu, atol=1e-9
    )


@pytest.mark.parametrize("planner_ns", [7 * MS, 33 * MS, 100 * MS, 480 * MS, 950 * MS])
def test_priors_of_any_rate_are_resampled_exactly(planner_ns: int) -> None:
    """From the identity at the image on, which no planner's pose stands for."""
    plan = arc(EPOCH_NS + 11 * MS + planner_ns * np.arange(1, 400))
    times = stamps(21)[1:]
    made = resample(PriorPoses(plan.stamps_ns, plan.T_world_imu), EPOCH_NS, times)
    np.testing.assert_array_equal(made.stamps_ns, times)
    np.testing.assert_allclose(made.T_imu0_imu, arc(times).T_world_imu, atol=1e-9)


def test_poses_for_now_and_before_are_passed_over() -> None:
    plan = arc(EPOCH_NS + 100 * MS * np.arange(-3, 30))
    wrong = plan.T_world_imu.copy()
    wrong[:4, 0, 3] += 1000.0
    times = stamps(5, 50 * MS)[1:]
    made = resample(PriorPoses(plan.stamps_ns, wrong), EPOCH_NS, times)
    np.testing.assert_allclose(made.T_imu0_imu, arc(times).T_world_imu, atol=1e-9)


def test_nothing_is_made_up_behind_the_end_or_across_a_hole() -> None:
    ends = arc(stamps(8)[1:])
    made = resample(PriorPoses(ends.stamps_ns, ends.T_world_imu), EPOCH_NS, stamps(21)[1:])
    np.testing.assert_array_equal(made.stamps_ns, stamps(8)[1:])
    hole = arc(np.delete(stamps(40), slice(5, 16))[1:])  # 1.1 s without one, from 0.4 s on
    made = resample(PriorPoses(hole.stamps_ns, hole.T_world_imu), EPOCH_NS, stamps(21)[1:])
    np.testing.assert_array_equal(made.stamps_ns, stamps(5)[1:])


def test_covered() -> None:
    known = EPOCH_NS + np.array([0, 1000, 2001]) * MS
    query = EPOCH_NS + np.array([-1, 0, 500, 1000, 1500, 2001, 2002]) * MS
    expected = [False, True, True, True, False, True, False]
    np.testing.assert_array_equal(covered(known, query), expected)
    np.testing.assert_array_equal(covered(known[:1], query[:3]), [False, True, False])


def test_at_stamps_keeps_what_is_covered() -> None:
    known = arc(EPOCH_NS + np.array([0, 1000, 2001]) * MS)
    made = at_stamps(known, EPOCH_NS + np.array([-5, 700, 1700, 2001, 3000]) * MS)
    np.testing.assert_array_equal(made.stamps_ns, EPOCH_NS + np.array([700, 2001]) * MS)
    np.testing.assert_allclose(made.T_world_imu, arc(made.stamps_ns).T_world_imu, atol=1e-9)


def test_leading() -> None:
    assert leading(np.array([True, True])) == 2
    assert leading(np.array([True, False, True])) == 1
    assert leading(np.array([], dtype=bool)) == 0


def test_the_relative_pose_of_neighbours_alone_matters() -> None:
    """A turned and shifted world changes no relative pose."""
    drive = arc(stamps(4, 500 * MS))
    moved = Trajectory(drive.stamps_ns, one_second(500.0, 130.0) @ drive.T_world_imu)
    query = EPOCH_NS + np.array([250, 1300]) * MS
    a, b = interpolate_screws(drive, query), interpolate_screws(moved, query)
    np.testing.assert_allclose(inverse(a[0]) @ a[1], inverse(b[0]) @ b[1], atol=1e-9)
