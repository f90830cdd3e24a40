"""A picture of the lens: the image as it is and undistorted, the same straight grid in both."""

from __future__ import annotations

import cv2
import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray, Image

_LINES = 12
_POINTS = 200
_COLOUR = (60, 200, 255)
_GAP = 12


def lens_picture(image: Image, camera: Camera) -> bytes:
    """PNG of the image, and beside it the image as a pinhole would have taken it.

    The lines are straight lines of the scene that are level or upright in the camera's axes: on
    the right they are straight by construction, and on a right calibration so are the edges of
    houses and doors beside them.

    Parameters
    ----------
    image
        (H, W) grey, of the camera's size.

    Raises
    ------
    DataError
        The picture can't be encoded.
    """
    left = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    right = cv2.cvtColor(_undistorted(image, camera), cv2.COLOR_GRAY2BGR)
    for line in _grid(camera):
        _draw(left, camera.distort(line))
        _draw(right, line * [camera.fx, camera.fy] + [camera.cx, camera.cy])
    gap = np.full((left.shape[0], _GAP, 3), 255, np.uint8)
    done, data = cv2.imencode(".png", np.hstack([left, gap, right]))
    if not done:
        raise DataError("the picture of the lens can't be encoded as PNG")
    return bytes(data)


def _undistorted(image: Image, camera: Camera) -> Image:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    plane = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    inside = np.hypot(plane[:, 0], plane[:, 1]) < camera.max_radius
    source = np.where(inside[:, None], camera.distort(plane), -1.0).astype(np.float32)
    shape = image.shape
    return np.asarray(
        cv2.remap(
            image, source[:, 0].reshape(shape), source[:, 1].reshape(shape), cv2.INTER_LINEAR
        ),
        dtype=np.uint8,
    )


def _grid(camera: Camera) -> list[FloatArray]:
    """Lines (N, 2) on z = 1 over the undistorted image."""
    low = np.array([-camera.cx / camera.fx, -camera.cy / camera.fy])
    high = np.array(
        [(camera.width - 1 - camera.cx) / camera.fx, (camera.height - 1 - camera.cy) / camera.fy]
    )
    low, high = np.maximum(low, -camera.max_radius), np.minimum(high, camera.max_radius)
    lines = []
    for axis in range(2):
        along = np.linspace(low[1 - axis], high[1 - axis], _POINTS)
        for at in np.linspace(low[axis], high[axis], _LINES):
            line = np.empty((_POINTS, 2))
            line[:, axis], line[:, 1 - axis] = at, along
            lines.append(line[np.hypot(line[:, 0], line[:, 1]) < camera.max_radius])
    return lines


def _draw(canvas: np.ndarray, pixels: FloatArray) -> None:
    if len(pixels):
        points = np.round(np.clip(pixels, -1e4, 1e4)).astype(np.int32)
        cv2.polylines(canvas, [points[:, None]], False, _COLOUR, 1, cv2.LINE_AA)
