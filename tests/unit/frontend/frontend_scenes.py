"""Textured images with known motion, shared by the tests of the front end."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from p2gd_fgo.config import FrontendConfig
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.types import FloatArray, Image

WIDTH, HEIGHT = 320, 240
_NO_MAP = np.empty(0, np.float32)  # both coordinates are in the first map
CAMERA = RadTanCamera(WIDTH, HEIGHT, 260.0, 258.0, 161.0, 118.0, -0.25, 0.06, 3e-4, -2e-4)


def settings(**changes: object) -> FrontendConfig:
    base: dict[str, object] = {
        "max_features": 60,
        "grid": (4, 3),
        "min_distance_px": 15.0,
        "max_track_length": 10,
    }
    return FrontendConfig.model_validate({**base, **changes})


def texture(seed: int = 0, width: int = WIDTH, height: int = HEIGHT) -> Image:
    """Blurred grey blocks: corners everywhere, band-limited enough for sub-pixel flow."""
    rng = np.random.default_rng(seed)
    blocks = rng.integers(20, 236, (height // 9 + 1, width // 9 + 1)).astype(np.uint8)
    sharp = np.kron(blocks, np.ones((9, 9), np.uint8))[:height, :width]
    return np.asarray(cv2.GaussianBlur(sharp, (0, 0), 1.0), dtype=np.uint8)


def shifted(image: Image, flow: tuple[float, float]) -> Image:
    """The image moved by flow (x, y) px.

    Not by OpenCV, whose warps round positions to 1/32 px in some versions.
    """
    moved = ndimage.shift(image.astype(np.float64), flow[::-1], order=3, mode="mirror")
    return np.asarray(np.clip(np.rint(moved), 0, 255), dtype=np.uint8)


def rotated_view(image: Image, R_cam_prev: FloatArray) -> Image:
    """What CAMERA sees of the same far scene after turning by R_cam_prev."""
    u, v = np.meshgrid(np.arange(WIDTH, dtype=np.float64), np.arange(HEIGHT, dtype=np.float64))
    plane = CAMERA.undistort(np.column_stack([u.ravel(), v.ravel()]))
    rays = np.column_stack([plane, np.ones(len(plane))]) @ R_cam_prev  # into the previous frame
    source = CAMERA.distort(rays[:, :2] / rays[:, 2:]).astype(np.float32)
    maps = source.reshape(HEIGHT, WIDTH, 2)
    seen = cv2.remap(image, maps, _NO_MAP, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return np.asarray(seen, dtype=np.uint8)
