"""What is taken, and the problem named where nothing can be."""

from __future__ import annotations

import numpy as np
import pytest
from prior_scenes import (
    HORIZON,
    IMAGE_NS,
    Spoilt,
    arc,
    go_through,
    planner,
    stamps,
    window,
)

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors import ImageTimes, PriorIntake, PriorProblem, PriorSource
from p2gd_fgo.priors.constant_velocity import ConstantVelocityPriors
from p2gd_fgo.priors.factory import NoPriors
from p2gd_fgo.types import FloatArray, IntArray, PriorPoses

IMAGES = stamps(60)
DRIVE = arc(IMAGES)
NOW = 10


def stream(known: IntArray | None = None) -> PriorIntake:
    return PriorIntake(NoPriors(ImageTimes(known), "handed in with the images"), HORIZON)


def handed(stamps_ns: IntArray) -> PriorPoses:
    """The way on from image ``NOW``."""
    return PriorPoses(stamps_ns, inverse(DRIVE.T_world_imu[NOW]) @ arc(stamps_ns).T_world_imu)


def take(priors: PriorPoses | None, known: IntArray | None = None) -> PriorPoses | PriorProblem:
    return stream(known).take(int(IMAGES[NOW]), priors, window(DRIVE, NOW))


def problem(priors: PriorPoses | None, known: IntArray | None = None) -> PriorProblem:
    taken = take(priors, known)
    assert isinstance(taken, PriorProblem)
    assert not taken.message.endswith(".")
    return taken


def poses(taken: PriorPoses | PriorProblem) -> PriorPoses:
    assert isinstance(taken, PriorPoses), taken
    return taken


def test_a_plain_tuple_is_refused_in_one_sentence() -> None:
    ours = handed(IMAGES[NOW + 1 : NOW + 21])
    pair = (ours.stamps_ns, ours.T_imu0_imu)
    with pytest.raises(DataError, match=r"handed in as a tuple: hand in a PriorPoses\("):
        take(pair)  # type: ignore[arg-type]


@pytest.mark.parametrize("step_ns", [IMAGE_NS, 20_000_000, 170_000_000, 1_000_000_000])
def test_any_rate_is_brought_to_the_images(step_ns: int) -> None:
    taken = poses(take(handed(IMAGES[NOW] + 3 + step_ns * np.arange(200))))
    np.testing.assert_array_equal(taken.stamps_ns, IMAGES[NOW + 1 : NOW + 21])
    np.testing.assert_allclose(
        taken.T_imu0_imu, handed(IMAGES[NOW + 1 : NOW + 21]).T_imu0_imu, atol=1e-7
    )


def test_known_image_times_win_over_estimated_ones() -> None:
    jittered = IMAGES + np.random.default_rng(0).integers(0, 20_000_000, len(IMAGES))
    jittered[NOW] = IMAGES[NOW]
    taken = poses(take(handed(stamps(400, 30_000_000)), jittered))
    np.testing.assert_array_equal(taken.stamps_ns, jittered[NOW + 1 : NOW + 21])
    np.testing.assert_allclose(taken.T_imu0_imu, handed(taken.stamps_ns).T_imu0_imu, atol=1e-7)


def test_what_is_handed_in_wins_over_the_source() -> None:
    intake = PriorIntake(planner(DRIVE), HORIZON)
    slow = inverse(DRIVE.T_world_imu[NOW]) @ arc(IMAGES, speed=5.0).T_world_imu[NOW + 1 : NOW + 21]
    mine = PriorPoses(IMAGES[NOW + 1 : NOW + 21], slow)
    recent = window(DRIVE, NOW)
    assert poses(intake.take(int(IMAGES[NOW]), mine, recent)) is mine
    own = poses(intake.take(int(IMAGES[NOW]), None, recent))
    np.testing.assert_allclose(own.T_imu0_imu, handed(IMAGES[NOW + 1 : NOW + 21]).T_imu0_imu)


def test_without_a_rate_the_priors_own_stamps_hold() -> None:
    recent = arc(IMAGES[:1])
    taken = stream().take(int(IMAGES[0]), PriorPoses(IMAGES[1:31], DRIVE.T_world_imu[1:31]), recent)
    np.testing.assert_array_equal(poses(taken).stamps_ns, IMAGES[1:21])


def test_missing() -> None:
    assert problem(None).kind == "priors_missing"
    assert problem(PriorPoses(IMAGES[:0], np.zeros((0, 4, 4)))).kind == "priors_missing"
    assert "handed in with the images" in problem(None).message


@pytest.mark.parametrize("last_ns", [-2_000_000_000, 0, 60_000_000])
def test_late(last_ns: int) -> None:
    """All in the past, up to now, and short of the next image."""
    late = problem(handed(IMAGES[NOW] + last_ns - IMAGE_NS * np.arange(5)[::-1]))
    assert late.kind == "priors_late"
    assert {-2_000_000_000: "2.000 s", 0: "0.000 s", 60_000_000: "0.040 s"}[last_ns] in late.message


def test_a_quarter_of_the_horizon_is_enough() -> None:
    few = problem(handed(IMAGES[NOW + 1 : NOW + 5]))
    assert few.kind == "priors_too_few"
    assert "reach 4 of the next 20 images" in few.message and "fewer than 5" in few.message
    np.testing.assert_array_equal(
        poses(take(handed(IMAGES[NOW + 1 : NOW + 6]))).stamps_ns, IMAGES[NOW + 1 : NOW + 6]
    )


def test_a_hole_ends_the_way() -> None:
    assert problem(handed(IMAGES[NOW + 15 : NOW + 40])).kind == "priors_too_few"


def test_the_end_of_a_recording_is_no_problem() -> None:
    for left in (3, 1, 0):
        known = IMAGES[: NOW + 1 + left]
        ahead = handed(IMAGES[NOW + 1 : NOW + 21])
        taken = poses(take(ahead, known))
        np.testing.assert_array_equal(taken.stamps_ns, known[NOW + 1 :])
        assert taken.T_imu0_imu.shape == (left, 4, 4)
    assert set(go_through(DRIVE, planner(DRIVE))) == {None}


def test_truth_that_ends_early_is_a_problem() -> None:
    kinds = go_through(DRIVE, planner(DRIVE, arc(IMAGES[:40])))
    assert kinds[:34] == [None] * 34
    assert kinds[34:38] == ["priors_too_few"] * 4
    assert set(kinds[38:58]) == {"priors_missing"}
    assert kinds[58] is None  # the last image has no next one


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_not_finite(value: float) -> None:
    bad = handed(IMAGES[NOW + 1 : NOW + 21])
    bad.T_imu0_imu[7, 1, 3] = value
    found = problem(bad)
    assert (found.kind, "1 of 20" in found.message) == ("priors_not_finite", True)


def scaled(T: FloatArray) -> FloatArray:
    T[3, :3, :3] *= 1.01
    return T


def mirrored(T: FloatArray) -> FloatArray:
    T[3, :3, 0] *= -1.0
    return T


def transposed_homogeneous(T: FloatArray) -> FloatArray:
    return T.swapaxes(1, 2).copy()


@pytest.mark.parametrize("change", [scaled, mirrored, transposed_homogeneous])
def test_not_rigid(change: object) -> None:
    assert callable(change)
    good = handed(IMAGES[NOW + 1 : NOW + 21])
    assert problem(PriorPoses(good.stamps_ns, change(good.T_imu0_imu))).kind == "priors_not_rigid"


def test_rounded_rotations_are_rigid_enough() -> None:
    good = handed(IMAGES[NOW + 1 : NOW + 21])
    poses(take(PriorPoses(good.stamps_ns, good.T_imu0_imu.round(4))))


def test_stamps_must_increase() -> None:
    good = handed(IMAGES[NOW + 1 : NOW + 21])
    back = PriorPoses(good.stamps_ns[::-1], good.T_imu0_imu[::-1])
    assert problem(back).kind == "priors_unordered"
    twice = PriorPoses(good.stamps_ns.copy(), good.T_imu0_imu)
    twice.stamps_ns[4] = twice.stamps_ns[3]
    found = problem(twice)
    assert found.kind == "priors_unordered" and "pose 4" in found.message


def test_shapes_are_the_callers_mistake() -> None:
    good = handed(IMAGES[NOW + 1 : NOW + 21])
    with pytest.raises(DataError, match=r"\(20,\).*\(19, 4, 4\)"):
        take(PriorPoses(good.stamps_ns, good.T_imu0_imu[1:]))


def test_a_problem_of_one_image_leaves_the_others_alone() -> None:
    images = iter(range(1, 60))

    def sometimes(ahead: PriorPoses) -> PriorPoses | None:
        return None if next(images) in range(20, 30) else ahead

    kinds = go_through(DRIVE, Spoilt(planner(DRIVE), sometimes))
    assert kinds == [None] * 19 + ["priors_missing"] * 10 + [None] * 30


def hand_in(
    intake: PriorIntake, images: IntArray, planner_ns: int, scale: float = 1.0
) -> list[str | None]:
    """A planner's own rate, handed in with every image; the kind of every problem."""
    drive = arc(images)
    kinds = []
    for index in range(1, len(images)):
        ahead = arc(images[index] + planner_ns * np.arange(1, 60))
        T = inverse(drive.T_world_imu[index]) @ ahead.T_world_imu
        T[:, :3, 3] *= scale
        mine = PriorPoses(ahead.stamps_ns, T)
        taken = intake.take(int(images[index]), mine, window(drive, index))
        kinds.append(taken.kind if isinstance(taken, PriorProblem) else None)
    return kinds


def test_images_need_not_come_when_expected() -> None:
    """Jitter, and every other image lost from half of the way on."""
    images = stamps(90)
    images += np.random.default_rng(3).integers(-8_000_000, 8_000_000, len(images))
    images = np.concatenate([images[:40], images[40::2]])
    assert set(hand_in(stream(), images, 100_000_000)) == {None}


@pytest.mark.parametrize(
    "source",
    [NoPriors(ImageTimes(), "stream"), ConstantVelocityPriors(ImageTimes(), HORIZON)],
    ids=["stream", "constant_velocity"],
)
def test_a_wrong_stream_is_contradicted_too(source: PriorSource) -> None:
    kinds = hand_in(PriorIntake(source, HORIZON), IMAGES, 70_000_000, scale=2.0)
    assert kinds[10] is None
    assert set(kinds[20:]) == {"priors_contradicted"}
