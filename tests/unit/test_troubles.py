"""What is noticed about images and samples, and how it is told."""

from __future__ import annotations

import numpy as np
import pytest

from p2gd_fgo.frontend import ImageHealth, TrackSummary
from p2gd_fgo.imu import UnknownMotion
from p2gd_fgo.troubles import Trouble, TroubleWatch, trouble_events
from p2gd_fgo.types import NANOSECONDS

FINE = ImageHealth(blank=False, repeated=False, brightness=1.0)
TRACKED = TrackSummary(tracked=100, lost_klt=5, lost_outlier=5)
FRAME_NS = 100_000_000


def kinds(troubles: list[Trouble]) -> list[str]:
    return [t.kind for t in troubles]


def look(
    watch: TroubleWatch, k: float, health: ImageHealth = FINE, tracked: TrackSummary = TRACKED,
    unknown: UnknownMotion | None = None,
) -> list[Trouble]:  # fmt: skip
    return watch.look(round(k * FRAME_NS), health, tracked, unknown, used=health.usable)


def test_nothing_is_wrong_with_a_healthy_run() -> None:
    watch = TroubleWatch()
    assert not any(look(watch, k + 0.2 * (k % 2)) for k in range(50))


@pytest.mark.parametrize(("interval", "gap"), [(3.0, False), (4.0, True), (30.0, True)])
def test_a_gap_is_told_against_the_usual_interval(interval: float, gap: bool) -> None:
    watch = TroubleWatch()
    for k in range(10):
        assert not look(watch, k)
    assert kinds(look(watch, 9 + interval)) == (["image_gap"] if gap else [])
    assert not look(watch, 10 + interval)


def test_a_slow_camera_has_no_gaps() -> None:
    watch = TroubleWatch()
    assert not any(look(watch, 20 * k) for k in range(10))


def test_blank_and_repeated_images_are_told_apart() -> None:
    watch = TroubleWatch()
    assert kinds(look(watch, 0, ImageHealth(True, True, 1.0))) == ["image_blank"]
    assert kinds(look(watch, 1, ImageHealth(False, True, 1.0))) == ["image_frozen"]
    # Used for want of another, as before the start: then it is told by its tracks alone.
    assert not watch.look(2 * FRAME_NS, ImageHealth(False, True, 1.0), TRACKED, None, used=True)


@pytest.mark.parametrize("ratio", [1.5, 0.5])
def test_a_jump_of_brightness_is_told_with_its_size(ratio: float) -> None:
    (trouble,) = look(TroubleWatch(), 0, ImageHealth(False, False, ratio))
    assert trouble.kind == "brightness_jump" and f"{ratio:.2f}" in trouble.message
    assert trouble.extent == max(ratio, 1.0 / ratio)


def test_a_hole_in_the_imu_is_told_with_its_length() -> None:
    unknown = UnknownMotion(np.array([0.1]), np.array([1.0]), 0.73)
    (trouble,) = look(TroubleWatch(), 0, unknown=unknown)
    assert trouble.kind == "imu_gap_bridged" and trouble.extent == 0.73


def test_lost_tracks() -> None:
    few = TrackSummary(tracked=20, lost_klt=70, lost_outside=10)
    assert kinds(look(TroubleWatch(), 0, tracked=few)) == ["tracks_lost"]
    assert not look(TroubleWatch(), 0, tracked=TrackSummary(tracked=5, lost_klt=14))


def test_rejections_count_when_they_go_on() -> None:
    watch = TroubleWatch()
    many = TrackSummary(tracked=60, lost_outlier=40)
    assert [kinds(look(watch, k, tracked=many)) for k in range(4)] == [
        [], [], ["many_tracks_rejected"], ["many_tracks_rejected"],
    ]  # fmt: skip
    look(watch, 4)
    assert not look(watch, 5, tracked=many)


def test_a_stretch_is_one_event_told_by_its_worst_image() -> None:
    def trouble(at_s: float, kind: str, extent: float) -> Trouble:
        return Trouble(round(at_s * NANOSECONDS), kind, f"{kind} {extent}", extent)

    events = trouble_events(
        [trouble(1.0, "a", 0.3), trouble(1.5, "b", 1.0), trouble(1.9, "a", 0.8),
         trouble(2.2, "a", 0.5), trouble(4.0, "a", 0.1)]
    )  # fmt: skip
    assert [(e.kind, e.stamp_ns) for e in events] == [
        ("a", NANOSECONDS), ("a", 4 * NANOSECONDS), ("b", 1_500_000_000)
    ]  # fmt: skip
    assert events[0].message == "a 0.8 (3 images in 1.2 s)"
    assert events[0].data == {"images": 3, "duration_s": pytest.approx(1.2), "worst": 0.8}
    assert events[1].message == "a 0.1"
