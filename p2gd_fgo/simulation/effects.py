"""What a lens, a shutter and a moving shadow do to a picture, after its surfaces are known."""

from __future__ import annotations

import math

import numpy as np

from p2gd_fgo.simulation.compiled import compiled
from p2gd_fgo.simulation.raster import Float32Array, OwnerArray
from p2gd_fgo.types import FloatArray, IntArray

_MAX_TAPS = 24
_SOFT_M = 0.3  # reach of the darkness around a body's foot
_GROUND_M = 0.3  # what lies lower counts as ground


@compiled
def motion_blur(
    brightness: Float32Array,
    inverse_depth: FloatArray,
    ray_x: FloatArray,
    ray_y: FloatArray,
    steps: FloatArray,
    mover: OwnerArray,
    motions: FloatArray,
    exposure_s: float,
) -> Float32Array:  # pragma: no cover
    """Average the picture (H, W) along the way that each pixel's point travels in the exposure.

    The exposure is centred on the picture's time, so that the blur shifts nothing on average.

    Parameters
    ----------
    mover
        (H, W) which moving body is seen, −1 for what stands still.
    motions
        (B + 1, 6) velocity and angular rate of points in the camera's frame: row b + 1 of body b.
    """
    height, width = brightness.shape
    out = np.empty((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            m = motions[mover[row, column] + 1]
            x, y, w = ray_x[row, column], ray_y[row, column], inverse_depth[row, column]
            # Velocity of the point over its depth, then of its image on the plane z = 1.
            vx = m[0] * w + m[4] - m[5] * y
            vy = m[1] * w + m[5] * x - m[3]
            vz = m[2] * w + m[3] * y - m[4] * x
            dx, dy = (vx - x * vz) * exposure_s, (vy - y * vz) * exposure_s
            a, b = steps[row, column, 0], steps[row, column, 2]
            c, d = steps[row, column, 1], steps[row, column, 3]
            determinant = a * d - b * c
            across = (d * dx - b * dy) / determinant
            down = (a * dy - c * dx) / determinant
            length = math.sqrt(across * across + down * down)
            taps = min(math.ceil(length), _MAX_TAPS)
            if taps < 2:
                out[row, column] = brightness[row, column]
                continue
            total = 0.0
            for k in range(taps):
                share = (k + 0.5) / taps - 0.5
                px = min(max(column + share * across, 0.0), width - 1.001)
                py = min(max(row + share * down, 0.0), height - 1.001)
                i, j = int(px), int(py)
                fx, fy = px - i, py - j
                upper = brightness[j, i] * (1.0 - fx) + brightness[j, i + 1] * fx
                lower = brightness[j + 1, i] * (1.0 - fx) + brightness[j + 1, i + 1] * fx
                total += upper * (1.0 - fy) + lower * fy
            out[row, column] = total / taps
    return out


@compiled
def contact_shadows(
    brightness: Float32Array,
    inverse_depth: FloatArray,
    ray_x: FloatArray,
    ray_y: FloatArray,
    mover: OwnerArray,
    T_world_cam: FloatArray,
    ground_z: float,
    feet: FloatArray,
    boxes: IntArray,
    strength: float,
) -> None:  # pragma: no cover
    """Darken the ground under and around bodies, in place.

    Parameters
    ----------
    feet
        (B, 6) x, y, cosine and sine of the yaw, half length and half width.
    boxes
        (B, 4) rows and columns that may see the foot and its surroundings.
    """
    T = T_world_cam
    for b in range(feet.shape[0]):
        for row in range(boxes[b, 0], boxes[b, 1]):
            for column in range(boxes[b, 2], boxes[b, 3]):
                w = inverse_depth[row, column]
                if w <= 0.0 or mover[row, column] >= 0:
                    continue
                x, y = ray_x[row, column], ray_y[row, column]
                z_world = T[2, 3] + (T[2, 0] * x + T[2, 1] * y + T[2, 2]) / w
                if abs(z_world - ground_z) > _GROUND_M:
                    continue
                east = T[0, 3] + (T[0, 0] * x + T[0, 1] * y + T[0, 2]) / w - feet[b, 0]
                north = T[1, 3] + (T[1, 0] * x + T[1, 1] * y + T[1, 2]) / w - feet[b, 1]
                along = abs(feet[b, 2] * east + feet[b, 3] * north) - feet[b, 4]
                aside = abs(feet[b, 2] * north - feet[b, 3] * east) - feet[b, 5]
                over = max(along, 0.0) ** 2 + max(aside, 0.0) ** 2
                factor = 1.0 - strength * math.exp(-over / (_SOFT_M * _SOFT_M))
                brightness[row, column] = brightness[row, column] * factor


def exposure_at(time_s: float, swing: float, seed: int) -> float:
    """Brightness factor at a time: three slow waves, within 1 ± ``swing``."""
    rng = np.random.default_rng([seed, 77])
    frequency = rng.uniform(0.04, 0.35, 3)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    weight = rng.dirichlet(np.ones(3))
    return float(1.0 + swing * (weight @ np.sin(2.0 * np.pi * frequency * time_s + phase)))
