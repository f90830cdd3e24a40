"""The recent motion goes on."""

from __future__ import annotations

import numpy as np
import pytest
from prior_scenes import EPOCH_NS, HORIZON, arc, go_through, stamps, window

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors import ImageTimes
from p2gd_fgo.priors.constant_velocity import ConstantVelocityPriors
from p2gd_fgo.types import Trajectory

IMAGES = stamps(60)


@pytest.mark.parametrize("known", [IMAGES, None])
@pytest.mark.parametrize("turn_deg", [0.0, -35.0])
def test_a_constant_twist_is_foretold_exactly(known: np.ndarray | None, turn_deg: float) -> None:
    drive = arc(IMAGES, turn_deg=turn_deg)
    source = ConstantVelocityPriors(ImageTimes(known), HORIZON)
    for index in (1, 3, 30):  # less than half a second, and more
        ahead = source.poses(int(IMAGES[index]), window(drive, index))
        assert ahead is not None
        np.testing.assert_array_equal(ahead.stamps_ns, IMAGES[index + 1 : index + 21])
        expected = inverse(drive.T_world_imu[index]) @ drive.T_world_imu[index + 1 : index + 21]
        np.testing.assert_allclose(ahead.T_imu0_imu, expected, atol=1e-7)


def test_standing_still_goes_on() -> None:
    still = Trajectory(IMAGES, np.broadcast_to(arc(IMAGES[:1]).T_world_imu, (60, 4, 4)))
    ahead = ConstantVelocityPriors(ImageTimes(), HORIZON).poses(int(IMAGES[9]), window(still, 9))
    assert ahead is not None
    np.testing.assert_allclose(
        ahead.T_imu0_imu, np.broadcast_to(np.eye(4), (HORIZON, 4, 4)), atol=1e-12
    )


def test_a_wobble_of_the_last_step_is_averaged() -> None:
    """Half a degree of pitch in the last image: 10° after 20 images if its step went on."""
    drive = arc(IMAGES, turn_deg=0.0)
    T = window(drive, 30).T_world_imu.copy()
    T[-1, :3, :3] = T[-1, :3, :3] @ so3.exp(np.array([0.0, np.radians(0.5), 0.0]))
    recent = Trajectory(IMAGES[10:31], T)
    ahead = ConstantVelocityPriors(ImageTimes(), HORIZON).poses(int(IMAGES[30]), recent)
    assert ahead is not None
    np.testing.assert_allclose(so3.angle_deg(ahead.T_imu0_imu[-1, :3, :3]), 2.0, atol=1e-6)


def test_one_pose_has_no_motion() -> None:
    one = arc(IMAGES[:1])
    for times in (ImageTimes(), ImageTimes(IMAGES)):
        assert ConstantVelocityPriors(times, HORIZON).poses(EPOCH_NS, one) is None


def test_the_estimate_does_not_contradict_itself() -> None:
    """Braking from 10 m/s within a second, and turning about on the spot."""
    seconds = (IMAGES - EPOCH_NS) / 1e9
    path = np.where(seconds < 3.0, 10.0 * seconds, 30.0 + 5.0 * (1 - np.exp(-3 * (seconds - 3.0))))
    yaw = np.where(seconds < 3.0, 0.0, np.minimum(2.0 * (seconds - 3.0), np.pi))
    T = np.tile(np.eye(4), (60, 1, 1))
    T[:, :3, :3] = so3.exp(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
    T[:, 0, 3] = path
    drive = Trajectory(IMAGES, T)
    source = ConstantVelocityPriors(ImageTimes(IMAGES), HORIZON)
    assert set(go_through(drive, source)) == {None}
