"""Standing still while others drive by, and creeping while nothing else moves."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.config import StationaryConfig
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.initialization import Stillness, imu_is_quiet, stillness
from p2gd_fgo.types import NANOSECONDS, FloatArray, ImuBatch

START_NS = 1_700_000_000 * NANOSECONDS
FRAME_NS = 100_000_000
CONFIG = StationaryConfig()
SIZE = np.array([1280.0, 560.0])
CENTER = 0.5 * SIZE


def seen(motion: FloatArray, place: FloatArray, *, noise_px: float = 0.15) -> FeatureBuffer:
    """Features at ``place`` (N, 2) that move by ``motion`` (N, 2) an image."""
    rng = np.random.default_rng(3)
    buffer = FeatureBuffer(20)
    for k in range(8):
        pixels = place + k * motion + noise_px * rng.standard_normal(place.shape)
        if k == 0:
            buffer.advance(START_NS, np.zeros((0, 2)), np.zeros((0, 2)))
            buffer.add(pixels, pixels / 800.0)
        else:
            buffer.advance(START_NS + k * FRAME_NS, pixels, pixels / 800.0)
    return buffer


def quiet_imu(*, hole_s: tuple[float, float] | None = None) -> ImuBatch:
    rng = np.random.default_rng(4)
    t = np.arange(-0.5, 1.5, 0.01)
    if hole_s is not None:
        t = t[(t < hole_s[0]) | (t > hole_s[1])]
    return ImuBatch(
        START_NS + np.round(t * NANOSECONDS).astype(np.int64),
        1e-3 * rng.standard_normal((len(t), 3)),
        np.array([0.0, 0.0, 9.81]) + 0.02 * rng.standard_normal((len(t), 3)),
    )


def judge(buffer: FeatureBuffer, *, was_still: bool = False) -> Stillness:
    stamp = int(buffer.stamps_ns[-1])
    return stillness(stamp, quiet_imu(), buffer, 0.5, CONFIG, was_still=was_still)


def street(count: int = 150) -> FloatArray:
    return np.asarray(np.random.default_rng(5).uniform(0.0, 1.0, (count, 2)) * SIZE)


def passing_by(share: float) -> FeatureBuffer:
    """A share of the features rides on a car that crosses the view."""
    place = street()
    motion = np.zeros_like(place)
    motion[: round(share * len(place))] = [-18.0, 0.5]
    return seen(motion, place)


@pytest.mark.parametrize(
    ("share", "begins", "goes_on"), [(0.3, True, True), (0.65, False, True), (0.85, False, False)]
)
def test_a_part_of_the_view_may_drive_by(share: float, begins: bool, goes_on: bool) -> None:
    buffer = passing_by(share)
    assert judge(buffer).still is begins
    assert judge(buffer, was_still=True).still is goes_on


def creeping(speed_mps: float, depth_m: tuple[float, float]) -> FeatureBuffer:
    """Straight ahead: the image grows about its middle, near features faster than far ones."""
    place = street()
    depth = np.random.default_rng(6).uniform(*depth_m, len(place))
    return seen((place - CENTER) * (0.1 * speed_mps / depth)[:, None], place, noise_px=0.08)


@pytest.mark.parametrize("was_still", [False, True])
@pytest.mark.parametrize("speed_mps", [0.05, 0.1])
def test_a_creep_before_a_distant_scene_is_no_standstill(speed_mps: float, was_still: bool) -> None:
    """With half of the features below the noise threshold one by one, they grow together."""
    found = judge(creeping(speed_mps, (8.0, 45.0)), was_still=was_still)
    if speed_mps == 0.05:
        assert found.disparity_px < CONFIG.max_disparity_px
    assert found.drift_px > 1.3 * CONFIG.max_drift_px
    assert not found.still


def test_a_slow_turn_of_the_head_is_no_standstill() -> None:
    place = street()
    shifted = seen(np.full_like(place, 0.06) * [1.0, 0.0], place, noise_px=0.08)
    found = judge(shifted)
    assert found.disparity_px < CONFIG.max_disparity_px
    assert found.drift_px == pytest.approx(0.3, abs=0.05) and not found.still


def test_noise_alone_has_nothing_in_common() -> None:
    assert judge(passing_by(0.0)).drift_px < 0.5 * CONFIG.max_drift_px
    assert judge(passing_by(0.4)).drift_px < 0.5 * CONFIG.max_drift_px


def test_a_hole_in_the_imu_is_no_standstill() -> None:
    buffer = seen(np.zeros((60, 2)), street(60))
    stamp = int(buffer.stamps_ns[-1])
    inside, before = (0.4, 0.55), (-0.3, -0.1)
    assert not stillness(stamp, quiet_imu(hole_s=inside), buffer, 0.5, CONFIG).still
    assert stillness(stamp, quiet_imu(hole_s=before), buffer, 0.5, CONFIG).still
    assert not imu_is_quiet(stamp, quiet_imu(hole_s=inside), CONFIG)
    assert imu_is_quiet(stamp, quiet_imu(hole_s=before), CONFIG)
    assert not imu_is_quiet(stamp + 10 * NANOSECONDS, quiet_imu(hole_s=before), CONFIG)
