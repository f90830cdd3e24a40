"""Camera models with batched projection, inverse and Jacobians."""

from __future__ import annotations

from p2gd_fgo.geometry.camera_base import MIN_DEPTH, Camera
from p2gd_fgo.geometry.equidistant import EquidistantCamera
from p2gd_fgo.geometry.radtan import RadTanCamera

__all__ = ["MIN_DEPTH", "Camera", "EquidistantCamera", "RadTanCamera"]
