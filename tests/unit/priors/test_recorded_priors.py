"""Looking ahead on a known trajectory, and the noise of the paper's Table VIII on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from prior_scenes import EPOCH_NS, HORIZON, IMAGE_NS, arc, planner, stamps, window

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse
from p2gd_fgo.priors import ImageTimes
from p2gd_fgo.priors.recorded import RecordedPriors, with_white_noise
from p2gd_fgo.types import PriorPoses, Trajectory

IMAGES = stamps(60)


def ahead_of(drive: Trajectory, plan: Trajectory, index: int) -> PriorPoses | None:
    return planner(drive, plan).poses(int(drive.stamps_ns[index]), window(drive, index))


def test_the_next_images_relative_to_the_body_now() -> None:
    drive = arc(IMAGES)
    ahead = ahead_of(drive, drive, 10)
    assert ahead is not None
    np.testing.assert_array_equal(ahead.stamps_ns, IMAGES[11:31])
    expected = np.linalg.inv(drive.T_world_imu[10]) @ drive.T_world_imu[11:31]
    np.testing.assert_allclose(ahead.T_imu0_imu, expected, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.tuples(*[st.floats(-1e4, 1e4)] * 3),
    st.sampled_from([7, IMAGE_NS // 3, IMAGE_NS, 900_000_000]),
)
def test_the_planners_world_does_not_matter(
    turn: tuple[float, ...], shift: tuple[float, ...], step_ns: int
) -> None:
    """Wherever the planner's world lies, and at whatever rate it plans (paper eq. 1)."""
    drive = arc(IMAGES)
    step_ns = max(step_ns, 50_000_000)
    plan = arc(EPOCH_NS - 13 + step_ns * np.arange(200))
    T = from_rotation_translation(so3.exp(np.array(turn)), np.array(shift))
    moved = Trajectory(plan.stamps_ns, T @ plan.T_world_imu)
    here, there = ahead_of(drive, plan, 10), ahead_of(drive, moved, 10)
    assert here is not None and there is not None
    np.testing.assert_array_equal(here.stamps_ns, there.stamps_ns)
    np.testing.assert_allclose(here.T_imu0_imu, there.T_imu0_imu, atol=1e-7)


def test_an_image_off_the_known_ones_is_interpolated() -> None:
    drive = arc(IMAGES)
    stamp_ns = int(IMAGES[10]) + 12_345_678
    ahead = planner(drive).poses(stamp_ns, window(drive, 10))
    assert ahead is not None
    here = arc(np.array([stamp_ns])).T_world_imu[0]
    expected = inverse(here) @ drive.T_world_imu[11:31]
    np.testing.assert_allclose(ahead.T_imu0_imu, expected, atol=1e-9)


def test_online_the_image_times_are_estimated() -> None:
    drive = arc(IMAGES)
    source = RecordedPriors(arc(stamps(500, 33_333_333)), ImageTimes(), HORIZON, "plan")
    ahead = source.poses(int(IMAGES[10]), window(drive, 10))
    assert ahead is not None
    np.testing.assert_array_equal(ahead.stamps_ns, IMAGES[11:31])
    expected = inverse(drive.T_world_imu[10]) @ drive.T_world_imu[11:31]
    np.testing.assert_allclose(ahead.T_imu0_imu, expected, atol=1e-9)


def test_no_pose_beyond_the_ends_or_inside_a_hole() -> None:
    drive = arc(IMAGES)
    plan = arc(np.concatenate([IMAGES[5:20], IMAGES[31:45]]))  # a hole of 1.2 s
    assert ahead_of(drive, plan, 4) is None
    assert ahead_of(drive, plan, 25) is None
    assert ahead_of(drive, plan, 50) is None
    assert ahead_of(drive, arc(IMAGES[:0]), 4) is None
    for index, reached in ((10, IMAGES[11:20]), (40, IMAGES[41:45])):
        ahead = ahead_of(drive, plan, index)
        assert ahead is not None
        np.testing.assert_array_equal(ahead.stamps_ns, reached)


def test_before_two_images_nothing_is_known_online() -> None:
    source = RecordedPriors(arc(IMAGES), ImageTimes(), HORIZON, "plan")
    assert source.poses(EPOCH_NS, arc(IMAGES[:1])) is None


@pytest.mark.parametrize(("position", "yaw_deg"), [(0.25, 0.0), (0.0, 2.5), (0.1, 1.0)])
def test_noise_has_the_sigmas_asked_for(position: float, yaw_deg: float) -> None:
    truth = arc(stamps(20_000))
    noisy = with_white_noise(truth, position, yaw_deg, np.random.default_rng(1))
    shift = noisy.T_world_imu[:, :3, 3] - truth.T_world_imu[:, :3, 3]
    turn = np.degrees(
        so3.log(noisy.T_world_imu[:, :3, :3] @ truth.T_world_imu[:, :3, :3].swapaxes(1, 2))
    )
    np.testing.assert_allclose(shift[:, :2].std(axis=0), position, rtol=0.03)
    np.testing.assert_allclose(turn[:, 2].std(), yaw_deg, rtol=0.03)
    np.testing.assert_allclose([shift[:, 2], turn[:, 0], turn[:, 1]], 0.0, atol=1e-9)
    white = np.mean(shift[1:, 0] * shift[:-1, 0])
    assert abs(white) <= 0.03 * position**2
    assert abs(np.mean(shift[:, 0] * shift[:, 1])) <= 0.03 * position**2


def test_noise_repeats_with_its_generator() -> None:
    truth = arc(IMAGES)
    a, b, c = (
        with_white_noise(truth, 0.1, 1.0, np.random.default_rng(seed)).T_world_imu
        for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    np.testing.assert_array_equal(truth.T_world_imu, arc(IMAGES).T_world_imu)


def test_noise_is_drawn_once_for_a_pose_not_for_a_look() -> None:
    """Two looks ahead at the same image see the same noisy pose."""
    drive = arc(IMAGES)
    noisy = with_white_noise(drive, 0.25, 2.5, np.random.default_rng(2))
    first, second = ahead_of(drive, noisy, 10), ahead_of(drive, noisy, 11)
    assert first is not None and second is not None
    again = first.T_imu0_imu[0] @ second.T_imu0_imu[:-1]
    np.testing.assert_allclose(again, first.T_imu0_imu[1:], atol=1e-9)
    assert np.abs(inverse(drive.T_world_imu[10]) @ drive.T_world_imu[11:31]
                  - first.T_imu0_imu).max() > 0.05  # fmt: skip
