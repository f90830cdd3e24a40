"""The online API on rendered images: no files, no pipeline."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from demo_variants import opened, settings, start_aligned_errors

from p2gd_fgo.config import Config
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.errors import DataError, InitializationError
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.types import Estimate, Image, ImuBatch, Trajectory, Waiting


@pytest.fixture(scope="module")
def demo(short_demo: Path) -> AslSequence:
    return opened(short_demo)


def part(imu: ImuBatch, which: slice) -> ImuBatch:
    return ImuBatch(imu.stamps_ns[which], imu.gyro[which], imu.accel[which])


class Feed:
    """Hands a recording to the odometry image by image."""

    def __init__(self, sequence: AslSequence, config: Config, mask: Image | None = None) -> None:
        self.sequence = sequence
        self.odometry = Odometry(sequence.calibration, config, truth=sequence.truth, mask=mask)
        self.estimates: list[Estimate] = []
        self.waits: list[Waiting] = []
        self._given = 0

    def imu(self, upto_ns: int) -> None:
        """All samples to the time and one beyond."""
        end = int(np.searchsorted(self.sequence.imu.stamps_ns, upto_ns)) + 1
        self.odometry.add_imu(part(self.sequence.imu, slice(self._given, end)))
        self._given = end

    def image(self, index: int) -> Estimate | Waiting:
        stamp = int(self.sequence.image_stamps_ns[index])
        self.imu(stamp)
        answer = self.odometry.add_image(stamp, self.sequence.image(index))
        if isinstance(answer, Waiting):
            self.waits.append(answer)
        else:
            self.estimates.append(answer)
        return answer

    def images(self, indices: range) -> Trajectory:
        for index in indices:
            self.image(index)
        return Trajectory(
            np.array([e.state.stamp_ns for e in self.estimates]),
            np.array([e.state.T_world_imu for e in self.estimates]),
        )


def test_it_starts_from_the_standstill_and_follows_the_truth(demo: AslSequence) -> None:
    feed = Feed(demo, settings())
    estimate = feed.images(range(71))
    assert len(feed.waits) == 10 and len(estimate) == 61
    assert feed.odometry.start_note == "static, after 1.0 s"
    assert all(wait.reason == "waiting for 1 s of standstill" for wait in feed.waits)
    np.testing.assert_array_equal(estimate.stamps_ns, demo.image_stamps_ns[10:])
    assert demo.truth is not None and demo.truth.velocity is not None
    errors = start_aligned_errors(estimate, demo.truth.trajectory)
    assert errors[:8].max() < 2e-3  # still standing
    assert errors.max() < 0.1
    last = feed.estimates[-1]
    truth = np.linalg.norm(demo.truth.velocity[-21])
    assert np.linalg.norm(last.state.velocity) == pytest.approx(truth, rel=0.05)
    assert demo.truth.gyro_bias is not None
    np.testing.assert_allclose(last.state.gyro_bias, demo.truth.gyro_bias[-1], atol=1e-3)
    assert len(last.window) == 20
    np.testing.assert_array_equal(last.window.stamps_ns, demo.image_stamps_ns[-20:])
    np.testing.assert_array_equal(last.window.T_world_imu[-1], last.state.T_world_imu)
    assert np.linalg.eigvalsh(last.covariance).min() > 0.0
    assert any(e.stationary for e in feed.estimates[:10])
    assert not any(e.stationary for e in feed.estimates[17:])
    smoothed = feed.odometry.finish()
    np.testing.assert_array_equal(smoothed.stamps_ns, estimate.stamps_ns)
    assert start_aligned_errors(smoothed, demo.truth.trajectory).max() < 0.1


def test_images_that_do_not_fit_are_refused_and_nothing_is_lost(demo: AslSequence) -> None:
    plain, tried = Feed(demo, settings()), Feed(demo, settings())
    expected = plain.images(range(20))
    tried.images(range(15))
    stamps, image = demo.image_stamps_ns, demo.image(15)
    with pytest.raises(DataError, match="not later than the one before"):
        tried.odometry.add_image(int(stamps[14]), image)
    with pytest.raises(DataError, match="not later than the one before"):
        tried.odometry.add_image(int(stamps[13]), image)
    with pytest.raises(DataError, match="outside the IMU samples handed in"):
        tried.odometry.add_image(int(stamps[16]), image)
    tried.imu(int(stamps[15]))
    with pytest.raises(DataError, match="400"):
        tried.odometry.add_image(int(stamps[15]), image[:, :-1])
    with pytest.raises(DataError, match="must increase"):
        tried.odometry.add_imu(part(demo.imu, slice(0, 3)))
    got = tried.images(range(15, 20))
    np.testing.assert_array_equal(got.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(got.T_world_imu, expected.T_world_imu)


def test_dead_reckoning_is_not_led_twice_over_the_same_samples(demo: AslSequence) -> None:
    config = settings(backend__kind="dead_reckoning")
    plain, tried = Feed(demo, config), Feed(demo, config)
    expected = plain.images(range(40))
    tried.images(range(39))
    tried.imu(int(demo.image_stamps_ns[39]))
    with pytest.raises(DataError):
        tried.odometry.add_image(int(demo.image_stamps_ns[39]), demo.image(39)[:-1])
    got = tried.images(range(39, 40))
    np.testing.assert_array_equal(got.T_world_imu[-1], expected.T_world_imu[-1])


def test_dead_reckoning_goes_the_same_road(demo: AslSequence) -> None:
    feed = Feed(demo, settings(backend__kind="dead_reckoning"))
    estimate = feed.images(range(71))
    assert len(estimate) == 61
    assert len(feed.estimates[-1].window) == 1
    assert demo.truth is not None
    errors = start_aligned_errors(estimate, demo.truth.trajectory)
    assert errors.max() < 0.5
    # Its covariance grows, and covers the error.
    sigma = np.sqrt(np.trace(feed.estimates[-1].covariance[3:6, 3:6]))
    assert errors[-1] < 3.0 * sigma
    assert sigma > 10.0 * np.sqrt(np.trace(feed.estimates[0].covariance[3:6, 3:6]))


def test_no_feature_lies_where_the_mask_is_black(demo: AslSequence) -> None:
    mask = np.full((300, 400), 255, np.uint8)
    mask[:, 150:260] = 0
    feed = Feed(demo, settings(), mask)
    seen = 0
    for index in range(30):
        feed.image(index)
        pixels = feed.odometry._frontend.observations().pixels
        columns, rows = np.rint(pixels).astype(int).T
        assert (mask[rows, columns] > 0).all()
        seen += len(pixels)
    assert seen > 30 * 40
    assert len(feed.estimates) == 20


def test_finishing_before_the_start_says_why(demo: AslSequence) -> None:
    feed = Feed(demo, settings())
    for index in range(4):
        feed.image(index)
    with pytest.raises(InitializationError, match=r"no 1 s of IMU data and images in 0\.3 s"):
        feed.odometry.finish()


def test_the_cameras_clock_is_brought_to_the_imus(demo: AslSequence) -> None:
    plain, late = Feed(demo, settings()), Feed(demo, settings(dataset__time_offset_s=0.02))
    expected = plain.images(range(25))
    for index in range(25):
        stamp = int(demo.image_stamps_ns[index])
        late.imu(stamp)
        answer = late.odometry.add_image(stamp - 20_000_000, demo.image(index))
        if isinstance(answer, Estimate):
            late.estimates.append(answer)
    np.testing.assert_array_equal(late.estimates[-1].state.T_world_imu, expected.T_world_imu[-1])
    assert late.estimates[-1].state.stamp_ns == expected.stamps_ns[-1]
