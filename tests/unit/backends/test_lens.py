"""The smoother's residuals are pixels of the image, whatever the lens."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from p2gd_fgo.backends.smoother.lens import measured_lens
from p2gd_fgo.backends.smoother.tracks import TrackFactors
from p2gd_fgo.config import SmootherConfig
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray, Observations

PINHOLE = RadTanCamera(640, 480, 400.0, 400.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0)
TWO_RADIAL = RadTanCamera(752, 480, 458.7, 457.3, 367.2, 248.4, -0.283, 0.074, 2e-4, 2e-5)
THREE_RADIAL = RadTanCamera(1392, 512, 984.2, 980.8, 690, 233.2, -0.373, 0.204, 2e-3, 1e-3, -0.072)
FISHEYE = EquidistantCamera(512, 512, 191.0, 191.0, 254.9, 256.9, 3.5e-3, 7e-4, -2e-3, 2e-4)
STEEP = RadTanCamera(752, 480, 270.0, 270.0, 375.0, 240.0, -0.28, 0.074, 0.0, 0.0)
LENSES = {
    "pinhole": (PINHOLE, gtsam.Cal3_S2),
    "two radial": (TWO_RADIAL, gtsam.Cal3DS2),
    "three radial": (THREE_RADIAL, gtsam.Cal3DS2),
    "fisheye": (FISHEYE, gtsam.Cal3Fisheye),
    "steep": (STEEP, gtsam.Cal3_S2),  # GTSAM can't invert it
}
IMAGES, STEP_M, TRACKS = 8, 0.15, 400


def side_views(
    camera: Camera, noise_px: float, rng: np.random.Generator
) -> tuple[TrackFactors, gtsam.Values]:
    """Points all over the image, 2 to 10 m away, seen by a camera that moves to its right."""
    factors = TrackFactors(camera, np.eye(4), 1.0, SmootherConfig())
    values = gtsam.Values()
    first = rng.uniform([0.0, 0.0], [camera.width, camera.height], (TRACKS, 2))
    first = first[camera.invertible(first)]
    points = np.column_stack([camera.undistort(first), np.ones(len(first))])
    points *= (rng.uniform(2.0, 10.0, len(first)) / np.linalg.norm(points, axis=1))[:, None]
    for k in range(IMAGES):
        position = np.array([k * STEP_M, 0.0, 0.0])
        values.insert(X(k), gtsam.Pose3(gtsam.Rot3(), position))
        seen = points - position
        pixels = camera.distort(seen[:, :2] / seen[:, 2:]) + rng.normal(0, noise_px, (len(seen), 2))
        in_view = camera.visible(seen) & camera.inside(pixels)
        in_view[in_view] = camera.invertible(pixels[in_view])
        factors.add(sightings(camera, np.flatnonzero(in_view), pixels[in_view]), k)
    return factors, values


def sightings(camera: Camera, ids: np.ndarray, pixels: FloatArray) -> Observations:
    return Observations(0, ids, pixels, camera.undistort(pixels))


@pytest.mark.parametrize(("camera", "calibration"), LENSES.values(), ids=LENSES)
def test_measurements_are_inverted(camera: Camera, calibration: type) -> None:
    rng = np.random.default_rng(0)
    lens = measured_lens(camera)
    assert type(lens.K) is calibration
    pixels = rng.uniform([0.0, 0.0], [camera.width - 1.0, camera.height - 1.0], (300, 2))
    pixels = pixels[camera.invertible(pixels)]
    normalized = camera.undistort(pixels)
    near = np.linalg.norm(normalized, axis=1) < np.tan(np.radians(80.0))
    pixels, normalized = pixels[near], normalized[near]
    found = np.array([lens.K.calibrate(z) for z in lens.measurements(pixels, normalized)])
    np.testing.assert_allclose(found, normalized, atol=1e-5)


@pytest.mark.parametrize("camera", [c for c, _ in LENSES.values()], ids=LENSES)
def test_perfect_tracks_have_no_error(camera: Camera) -> None:
    factors, values = side_views(camera, 0.0, np.random.default_rng(1))
    tracks = [t for k in range(IMAGES) for t in factors.take_starting_at(k) if len(t.frames) > 2]
    valid = [t for t in tracks if t.factor.point(values).valid()]
    assert len(valid) > 0.8 * len(tracks) > 100
    assert max(t.factor.error(values) for t in valid) < 1e-4


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("two radial", 0.05), ("three radial", 0.05), ("fisheye", 0.2)],
)  # of the fisheye, GTSAM's linear triangulation weighs rays far from the axis too much
def test_noise_of_the_image_passes_the_gate(name: str, tolerance: float) -> None:
    """Behind a lens, too, the share of good tracks that pass is the gate's."""
    factors, values = side_views(LENSES[name][0], 1.0, np.random.default_rng(2))
    tracks = [t for k in range(IMAGES) for t in factors.take_starting_at(k) if len(t.frames) > 2]
    valid = [t for t in tracks if t.factor.point(values).valid()]
    accepted = factors.accept(valid, values)
    assert len(accepted) > 0.95 * len(valid)
    misfit = sum(2.0 * t.factor.error(values) for t in valid)
    assert misfit / sum(2 * len(t.frames) - 3 for t in valid) == pytest.approx(1.0, abs=tolerance)
