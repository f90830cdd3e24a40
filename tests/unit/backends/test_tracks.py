"""One landmark's way through the factors, its gates, and the account of sightings."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from p2gd_fgo.backends.smoother.tracks import TrackFactors
from p2gd_fgo.config import SmootherConfig
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.types import FloatArray, Observations

CAMERA = RadTanCamera(800, 600, 500.0, 500.0, 400.0, 300.0, -0.1, 0.05, 0.0, 0.0)
STEP_M = 0.5  # sideways, from image to image
NEAR = np.array([0.5, 0.3, 8.0])


def values(frames: int) -> gtsam.Values:
    out = gtsam.Values()
    for k in range(frames):
        out.insert(X(k), pose3=gtsam.Pose3(gtsam.Rot3(), np.array([k * STEP_M, 0.0, 0.0])))
    return out


def sighting(
    point: FloatArray, frame: int, offset_px: tuple[float, float], track: int = 7
) -> Observations:
    x, y, z = point - [frame * STEP_M, 0.0, 0.0]
    pixels = CAMERA.distort(np.array([[x / z, y / z]])) + np.array(offset_px)
    return Observations(frame, np.array([track]), pixels, CAMERA.undistort(pixels))


def tracked(point: FloatArray, frames: int, *, offset_px: float = 0.0) -> TrackFactors:
    """A point seen in all frames, the middle one off by so much across the motion."""
    factors = TrackFactors(CAMERA, np.eye(4), 1.0, SmootherConfig())
    for k in range(frames):
        factors.add(sighting(point, k, (0.0, offset_px if k == frames // 2 else 0.0)), k)
    return factors


@pytest.mark.parametrize(
    ("point", "offset_px", "fate"),
    [
        (NEAR, 0.0, "marginalized"),
        (NEAR, 2.0, "marginalized"),
        (NEAR, 6.0, "rejected_chi_square"),
        (NEAR, 40.0, "rejected_outlier"),
        (np.array([1.0, 1.0, 200.0]), 0.0, "rejected_far"),
    ],
)
def test_gates(point: FloatArray, offset_px: float, fate: str) -> None:
    factors = tracked(point, 5, offset_px=offset_px)
    leaving = factors.take_starting_at(0)
    accepted = factors.accept(leaving, values(5))
    assert factors.counts == {fate: 5}
    assert accepted == (leaving if fate == "marginalized" else [])


@pytest.mark.parametrize(("frames", "offset_px", "used"), [(2, 4.0, 1), (2, 6.0, 0), (5, 6.0, 0)])
def test_live_tracks_pass_the_chi_square_gate_at_every_image(
    frames: int, offset_px: float, used: int
) -> None:
    """Two sightings share 6 px: 3 px each are within GTSAM's limit, and 4.2 standard deviations."""
    factors = tracked(NEAR, frames, offset_px=offset_px)
    live, settled = factors.usable(frames - 1, values(frames))
    assert (live.size(), settled.size()) == (used, 0)
    assert factors.live_observations() == frames  # left out this time, not let go


def test_single_sighting_and_no_baseline_are_not_used() -> None:
    factors = TrackFactors(CAMERA, np.eye(4), 1.0, SmootherConfig())
    factors.add(sighting(NEAR, 0, (0.0, 0.0)), 0)
    assert factors.usable(0, values(1))[0].size() == 0
    factors.accept(factors.take_starting_at(0), values(1))
    assert factors.counts == {"single_view": 1}

    still = gtsam.Values()
    for k in range(4):
        still.insert(X(k), pose3=gtsam.Pose3(gtsam.Rot3(), np.array([0.001 * k, 0.0, 0.0])))
        factors.add(sighting(NEAR, 0, (0.3 * k, 0.0)), k)
    factors.accept(factors.take_starting_at(0), still)
    assert factors.counts["rejected_degenerate"] == 4


def test_track_seen_again_after_folding_starts_anew() -> None:
    factors = tracked(NEAR, 4)
    (folded,) = factors.take_starting_at(0)
    assert folded.frames == [0, 1, 2, 3]
    assert factors.live_observations() == 0
    for k in (4, 5):
        factors.add(sighting(NEAR, k, (0.0, 0.0)), k)
    assert [folded.factor.keys()[i] for i in range(4)] == [X(k) for k in range(4)]
    live = factors.usable(5, values(6))[0]
    assert live.size() == 1
    assert [live.at(0).keys()[i] for i in range(2)] == [X(4), X(5)]
    assert factors.live_observations() == 2


def test_live_and_settled_tracks_are_told_apart() -> None:
    factors = tracked(NEAR, 3)
    for k in (1, 2, 3):
        factors.add(sighting(NEAR + 1.0, k, (0.0, 0.0), track=8), k)
    assert factors.usable(3, values(4))[0].size() == 1
    assert factors.usable(3, values(4))[1].size() == 1
    assert factors.usable(4, values(4))[1].size() == 2
    assert [t.frames for t in factors.take_starting_at(1)] == [[1, 2, 3]]


def test_a_point_that_comes_behind_a_camera_within_gtsams_tolerance_is_let_go() -> None:
    """Two sightings of a point at the second camera: GTSAM keeps it while poses move by 1e-3."""
    factors = tracked(NEAR, 3)
    for frame, ray in ((0, [0.25, 0.0]), (1, [0.0, 0.0])):
        normalized = np.array([ray])
        pixels = CAMERA.distort(normalized)
        factors.add(Observations(frame, np.array([8]), pixels, normalized), frame)

    def poses(forward: float) -> gtsam.Values:
        out = gtsam.Values()
        for k, at in enumerate(([0.0, 0.0, 0.0], [0.5, 0.0, 1.9999 + forward], [1.0, 0.0, 0.0])):
            out.insert(X(k), pose3=gtsam.Pose3(gtsam.Rot3(), np.array(at)))
        return out

    before, after = poses(0.0), poses(5e-4)
    _, settled = factors.usable(2, before)
    settled.linearize(before)
    assert not factors.drop_those_behind(before)
    with pytest.raises(RuntimeError, match="Cheirality"):
        settled.linearize(after)
    assert factors.drop_those_behind(after)
    assert factors.counts == {"rejected_behind_camera": 2}
    assert factors.live_observations() == 3
    live, settled = factors.usable(2, values(3))
    assert live.size() == 1 and settled.size() == 0
    assert len(factors.take_starting_at(0)) == 1
