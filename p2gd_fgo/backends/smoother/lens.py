"""The camera's lens in GTSAM's terms, so that residuals are pixels of the image itself.

The noise of a sighting is the same everywhere in the image that it was taken from. In an image
without distortion it isn't: behind a lens that bends strongly a pixel near the border covers
more, and in one direction more than in the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import gtsam
import numpy as np

from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray

SmartFactor: TypeAlias = (
    gtsam.SmartProjectionPoseFactorCal3_S2
    | gtsam.SmartProjectionPoseFactorCal3DS2
    | gtsam.SmartProjectionPoseFactorCal3Fisheye
)

_LATTICE = 24  # points along each side of the image at which GTSAM's inverse is tried
_INVERTED_TO_RAD = 1e-6


MakeFactor: TypeAlias = Callable[
    [gtsam.noiseModel.Base, gtsam.Pose3, gtsam.SmartProjectionParams], SmartFactor
]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredLens:
    """What the factors of tracks are made with.

    Attributes
    ----------
    K
        GTSAM's calibration.
    stand_in
        The camera of that lens where it isn't the true one.
    make_factor
        A track's factor of a noise model, the camera's pose on the body and GTSAM's settings.
    """

    K: gtsam.Cal3_S2 | gtsam.Cal3DS2 | gtsam.Cal3Fisheye
    stand_in: Camera | None
    make_factor: MakeFactor

    def measurements(self, pixels: FloatArray, normalized: FloatArray) -> FloatArray:
        """What factors measure (N, 2), px, of sightings in the image and on the plane z = 1."""
        return pixels if self.stand_in is None else self.stand_in.distort(normalized)


def measured_lens(camera: Camera) -> MeasuredLens:
    """The lens through which the smoother measures.

    GTSAM's radial-tangential lens has no third radial coefficient: where a camera has one, the two
    that come nearest to all three in the image take its place. Sightings are taken through them, so
    points lie where they should, and only the noise is off, by as much as the slopes of the two
    lenses differ. GTSAM inverts that lens by iterations that don't end for the strongest (about
    58° off the axis); such a camera is measured without its lens.
    """
    lens = _in_gtsam(camera)
    return lens if _is_inverted(lens, camera) else _undistorted(camera)


def _in_gtsam(camera: Camera) -> MeasuredLens:
    match camera:
        case RadTanCamera(k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0):
            return _pinhole(camera, None)
        case RadTanCamera(k3=0.0):
            return _radtan(camera, None)
        case RadTanCamera():
            nearest = _without_k3(camera)
            return _radtan(nearest, nearest)
        case EquidistantCamera():
            return _fisheye(camera)
        case _:
            return _undistorted(camera)


def _undistorted(c: Camera) -> MeasuredLens:
    flat = RadTanCamera(c.width, c.height, c.fx, c.fy, c.cx, c.cy, 0.0, 0.0, 0.0, 0.0)
    return _pinhole(c, flat)


def _pinhole(c: Camera, stand_in: Camera | None) -> MeasuredLens:
    K = gtsam.Cal3_S2(c.fx, c.fy, 0.0, c.cx, c.cy)
    return MeasuredLens(
        K,
        stand_in,
        lambda noise, body_P_cam, params: gtsam.SmartProjectionPoseFactorCal3_S2(
            noise, K, body_P_cam, params
        ),
    )


def _radtan(c: RadTanCamera, stand_in: Camera | None) -> MeasuredLens:
    K = gtsam.Cal3DS2(c.fx, c.fy, 0.0, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2)
    return MeasuredLens(
        K,
        stand_in,
        lambda noise, body_P_cam, params: gtsam.SmartProjectionPoseFactorCal3DS2(
            noise, K, body_P_cam, params
        ),
    )


def _fisheye(c: EquidistantCamera) -> MeasuredLens:
    K = gtsam.Cal3Fisheye(c.fx, c.fy, 0.0, c.cx, c.cy, c.k1, c.k2, c.k3, c.k4)
    return MeasuredLens(
        K,
        None,
        lambda noise, body_P_cam, params: gtsam.SmartProjectionPoseFactorCal3Fisheye(
            noise, K, body_P_cam, params
        ),
    )


def _without_k3(c: RadTanCamera) -> RadTanCamera:
    """The lens with k1 and k2 alone whose radial slopes are nearest to this one's in its image."""
    r = np.linalg.norm(c.undistort(_seen_pixels(c)), axis=1)
    slopes = 3.0 * c.k1 * r**2 + 5.0 * c.k2 * r**4 + 7.0 * c.k3 * r**6
    (k1, k2), *_ = np.linalg.lstsq(np.stack([3.0 * r**2, 5.0 * r**4], axis=1), slopes)
    return replace(c, k1=float(k1), k2=float(k2), k3=0.0)


def _is_inverted(lens: MeasuredLens, camera: Camera) -> bool:
    """Whether GTSAM finds the points on z = 1 back, all over the image."""
    pixels = _seen_pixels(camera)
    normalized = camera.undistort(pixels)
    try:
        found = [lens.K.calibrate(z) for z in lens.measurements(pixels, normalized)]
    except RuntimeError:  # what GTSAM throws when its iterations don't end
        return False
    error = np.linalg.norm(np.array(found) - normalized, axis=1)
    angle = error / (1.0 + np.square(normalized).sum(axis=1))
    return bool(angle.max() < _INVERTED_TO_RAD)


def _seen_pixels(camera: Camera) -> FloatArray:
    """Pixels (N, 2) of a lattice over the image, those that see something."""
    u = np.linspace(0.0, camera.width - 1.0, _LATTICE)
    v = np.linspace(0.0, camera.height - 1.0, _LATTICE)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    return np.asarray(pixels[camera.invertible(pixels)])
