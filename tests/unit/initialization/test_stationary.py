"""Standing still: the IMU and the images must both say so."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.config import StationaryConfig
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.initialization import Stillness, stillness
from p2gd_fgo.types import NANOSECONDS, ImuBatch

START_NS = 1_700_000_000 * NANOSECONDS
FRAME_NS = 50_000_000
CONFIG = StationaryConfig()


def images(
    count: int = 15, *, drift_px: float = 0.0, noise_px: float = 0.1, features: int = 60
) -> FeatureBuffer:
    """Features that move by ``drift_px`` an image."""
    rng = np.random.default_rng(0)
    buffer = FeatureBuffer(20)
    place = rng.uniform(0.0, 500.0, (features, 2))
    for k in range(count):
        pixels = place + [k * drift_px, 0.0] + noise_px * rng.standard_normal((features, 2))
        if k == 0:
            buffer.advance(START_NS, np.zeros((0, 2)), np.zeros((0, 2)))
            buffer.add(pixels, pixels / 400.0)
        else:
            buffer.advance(START_NS + k * FRAME_NS, pixels, pixels / 400.0)
    return buffer


def samples(
    *, gyro_noise: float = 1e-3, accel_noise: float = 0.02, first_s: float = -0.5
) -> ImuBatch:
    """200 Hz until 2 s, with large constant biases."""
    rng = np.random.default_rng(1)
    stamps = START_NS + np.arange(int(first_s * 200), 400) * 5_000_000
    n = (len(stamps), 3)
    return ImuBatch(
        stamps,
        np.array([0.08, -0.05, 0.1]) + gyro_noise * rng.standard_normal(n),
        np.array([0.3, 0.4, 9.9]) + accel_noise * rng.standard_normal(n),
    )


def judge(
    buffer: FeatureBuffer, imu: ImuBatch | None = None, *, window_s: float = 0.5,
    was_still: bool = False,
) -> Stillness:  # fmt: skip
    stamp = int(buffer.stamps_ns[-1])
    imu = samples() if imu is None else imu
    return stillness(stamp, imu, buffer, window_s, CONFIG, was_still=was_still)


def test_quiet_imu_and_quiet_images_are_still() -> None:
    found = judge(images())
    assert found.still and found.covered
    assert found.features == 60
    # Three axes; means of four samples at 200 Hz halve white noise.
    assert found.gyro_std == pytest.approx(0.5e-3 * np.sqrt(3.0), rel=0.25)
    assert found.accel_std == pytest.approx(0.01 * np.sqrt(3.0), rel=0.25)
    assert found.disparity_px < 0.3
    assert 0.0 < found.score < 1.0


def test_constant_velocity_has_a_quiet_imu_but_moving_images() -> None:
    found = judge(images(drift_px=0.2))
    assert not found.still and found.covered
    assert found.disparity_px == pytest.approx(2.0, abs=0.1)
    assert found.score == pytest.approx(found.disparity_px / CONFIG.max_disparity_px)


@pytest.mark.parametrize(
    "imu", [samples(gyro_noise=0.03), samples(accel_noise=0.4)], ids=["gyro", "accel"]
)
def test_a_distant_scene_hardly_moves_but_the_imu_does(imu: ImuBatch) -> None:
    found = judge(images(), imu)
    assert not found.still and found.covered
    assert found.disparity_px < CONFIG.max_disparity_px
    assert found.score > 1.0


@pytest.mark.parametrize(
    ("buffer", "imu"),
    [
        (images(6), samples()),
        (images(), samples(first_s=0.3)),
        (images(), ImuBatch(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))),
        (FeatureBuffer(20), samples()),
    ],
    ids=["few images", "young imu", "no imu", "no image"],
)
def test_what_does_not_reach_back_over_the_window_is_no_standstill(
    buffer: FeatureBuffer, imu: ImuBatch
) -> None:
    found = judge(buffer, imu)
    assert not found.still and not found.covered
    assert found.score == np.inf


def test_a_hole_in_the_images_is_no_standstill() -> None:
    """The image before the window's beginning is too old to stand for it."""
    buffer = images(12)
    late = int(buffer.stamps_ns[-1]) + NANOSECONDS
    buffer.advance(late, buffer.pixels, buffer.normalized)
    assert not judge(buffer).covered


def test_few_features_are_no_proof() -> None:
    found = judge(images(features=CONFIG.min_features - 1))
    assert not found.still and found.covered
    assert found.features == CONFIG.min_features - 1
    assert judge(images(features=CONFIG.min_features)).still


def young_tracks(*, drift_px: float = 0.0) -> FeatureBuffer:
    """In a standstill all tracks ended together three images ago."""
    old, new = images(), images(15, drift_px=drift_px)
    new.pixel_history[:, :-4] = np.nan
    assert (old.stamps_ns == new.stamps_ns).all()
    return new


def test_once_still_a_shorter_span_will_do() -> None:
    assert not judge(young_tracks()).still
    again = judge(young_tracks(), was_still=True)
    assert again.still
    assert again.features == 60
    assert not judge(young_tracks(drift_px=1.0), was_still=True).still
    assert not judge(young_tracks(), samples(accel_noise=0.3), was_still=True).still


def test_a_buffer_too_short_for_the_window_counts_as_far_as_it_reaches() -> None:
    found = judge(images(20), window_s=1.2)
    assert found.still and found.covered
    assert found.since_ns == START_NS
    assert not judge(images(19), window_s=1.2).covered
    assert not judge(images(20, drift_px=0.1), window_s=1.2).still


def test_the_span_compared_is_told() -> None:
    buffer = images()
    assert judge(buffer).since_ns == buffer.stamps_ns[-1] - 10 * FRAME_NS
    assert judge(young_tracks(), was_still=True).since_ns == buffer.stamps_ns[-1] - 3 * FRAME_NS


@pytest.mark.parametrize("begin_ns", [0, -3 * NANOSECONDS])
def test_stamps_may_begin_anywhere(begin_ns: int) -> None:
    buffer, imu = images(), samples()
    buffer.stamps_ns = np.where(buffer.stamps_ns == -1, -1, buffer.stamps_ns - START_NS + begin_ns)
    moved = ImuBatch(imu.stamps_ns - START_NS + begin_ns, imu.gyro, imu.accel)
    assert judge(buffer, moved).still


def test_the_description_has_values_and_thresholds() -> None:
    text = judge(images(drift_px=0.2)).describe(CONFIG)
    for part in (
        "(threshold 0.01)",
        "(threshold 0.15)",
        "60 features (threshold 0.5 px",
        "at least 10",
    ):
        assert part in text


def test_the_sensors_rate_does_not_matter_for_its_white_noise() -> None:
    """At 800 Hz a sensor is twice as noisy as at 200 Hz, but no less still."""
    dense = samples(accel_noise=0.02)
    rng = np.random.default_rng(4)
    stamps = np.arange(dense.stamps_ns[0], dense.stamps_ns[-1], 1_250_000)
    shape = (len(stamps), 3)
    fast = ImuBatch(
        stamps,
        2e-3 * rng.standard_normal(shape),
        np.array([0.3, 0.4, 9.9]) + 0.04 * rng.standard_normal(shape),
    )
    slow_found, fast_found = judge(images(), dense), judge(images(), fast)
    assert fast_found.accel_std == pytest.approx(slow_found.accel_std, rel=0.35)


def test_a_standstill_outlives_the_end_of_its_tracks() -> None:
    """In the image in which all tracks were consumed no feature has a past."""
    buffer = images(12)
    stamp = int(buffer.stamps_ns[-1]) + FRAME_NS
    buffer.keep(np.zeros(len(buffer), dtype=bool))
    buffer.advance(stamp, buffer.pixels, buffer.normalized)
    buffer.add(np.full((30, 2), 100.0), np.full((30, 2), 0.1))
    assert not judge(buffer).still
    assert judge(buffer, was_still=True).still
    assert not judge(buffer, samples(accel_noise=0.4), was_still=True).still
