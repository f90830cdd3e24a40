"""The mip-mapped atlas that holds all textures, and the noise and strokes they are made of.

A texture is a (H, W) float32 image, 0 to 255, whose sizes are powers of two and whose borders join
(it repeats). Row 0 is the bottom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.types import IntArray


@dataclass(frozen=True, slots=True, eq=False)
class TextureAtlas:
    """Images with all their halvings, in one array.

    Attributes
    ----------
    texels
        All levels of all textures, one after the other.
    levels
        (T, L, 3) offset, width and height; small textures repeat their last level.
    """

    texels: NDArray[np.uint8]
    levels: IntArray


def build_atlas(images: Sequence[Float32Array]) -> TextureAtlas:
    """Mip-map images (H, W) of power-of-two sizes, brightness 0 to 255.

    Raises
    ------
    ValueError
        A size is not a power of two.
    """
    chunks: list[NDArray[np.uint8]] = []
    table: list[list[tuple[int, int, int]]] = []
    offset = 0
    for image in images:
        height, width = image.shape
        if height & (height - 1) or width & (width - 1):
            raise ValueError(f"a texture of {width} x {height} has a size that is no power of two")
        level = np.clip(image, 0.0, 255.0).astype(np.float32)
        rows: list[tuple[int, int, int]] = []
        while True:
            height, width = level.shape
            chunks.append(np.rint(level).astype(np.uint8).ravel())
            rows.append((offset, width, height))
            offset += width * height
            if width == height == 1:
                break
            if width > 1:
                level = 0.5 * (level[:, 0::2] + level[:, 1::2])
            if height > 1:
                level = 0.5 * (level[0::2] + level[1::2])
        table.append(rows)
    depth = max(len(rows) for rows in table)
    padded = [rows + [rows[-1]] * (depth - len(rows)) for rows in table]
    return TextureAtlas(np.concatenate(chunks), np.array(padded, np.int64))


def noise(
    rng: np.random.Generator,
    shape: tuple[int, int],
    coarsest: int,
    *,
    octaves: int = 4,
    persistence: float = 0.6,
) -> Float32Array:
    """Fractal noise (H, W), periodic, zero mean, unit deviation.

    Parameters
    ----------
    coarsest
        Size in texels of the largest lumps, a power of two; each octave halves it.
    persistence
        Amplitude of an octave relative to the one before.
    """
    cell, amplitude = coarsest, 1.0
    total = np.zeros((max(shape[0] // cell, 1), max(shape[1] // cell, 1)), np.float32)
    for octave in range(octaves):
        total += np.float32(amplitude) * rng.standard_normal(total.shape, dtype=np.float32)
        if cell == 1 or octave == octaves - 1:
            break
        cell, amplitude = cell // 2, amplitude * persistence
        finer = (max(shape[0] // cell, 1), max(shape[1] // cell, 1))
        total = enlarge(total, finer)
    total -= total.mean()
    total /= np.float32(max(float(total.std()), 1e-6))
    return enlarge(total, shape)


def enlarge(grid: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Resize a periodic grid to ``shape``; its borders still join."""
    if grid.shape == shape:
        return grid
    zoom = (shape[0] // grid.shape[0], shape[1] // grid.shape[1])
    padded = np.pad(grid, 2, mode="wrap")
    size = (padded.shape[1] * zoom[1], padded.shape[0] * zoom[0])
    large = cv2.resize(padded, size, interpolation=cv2.INTER_CUBIC)
    top, left = 2 * zoom[0], 2 * zoom[1]
    return np.asarray(large[top : top + shape[0], left : left + shape[1]], np.float32)


def speckle(
    rng: np.random.Generator,
    image: Float32Array,
    count: int,
    radius: tuple[float, float],
    value: tuple[float, float],
    *,
    stretch: float = 1.0,
) -> None:
    """Draw soft-edged ellipses into ``image``: gravel, leaves, chewing gum; radii in texels."""
    height, width = image.shape
    centers = rng.uniform(0.0, 1.0, (count, 2)) * (width, height)
    radii = rng.uniform(*radius, count)
    values = rng.uniform(*value, count)
    angles = rng.uniform(0.0, 180.0, count)
    ratios = rng.uniform(min(1.0, stretch), max(1.0, stretch), count)
    for (x, y), r, v, angle, ratio in zip(centers, radii, values, angles, ratios, strict=True):
        axes = (max(int(r * 16), 1), max(int(r * ratio * 16), 1))
        cv2.ellipse(
            image, (int(x * 16), int(y * 16)), axes, angle, 0, 360, float(v), -1, cv2.LINE_8, 4
        )


def crack(rng: np.random.Generator, image: Float32Array, length: int, value: float) -> None:
    """Draw a crooked line of about ``length`` texels."""
    height, width = image.shape
    steps = max(length // 12, 2)
    heading = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.normal(0.0, 0.45, steps))
    path = np.cumsum(12.0 * np.stack([np.cos(heading), np.sin(heading)], -1), 0)
    path += rng.uniform(0.0, 1.0, 2) * (width, height)
    cv2.polylines(image, [np.rint(path).astype(np.int32)[:, None]], False, value, 2)


def soften(image: Float32Array, sigma: float) -> Float32Array:
    """Blurred a little (wrapping), as a lookup between texels expects."""
    padded = np.pad(image, 4, mode="wrap").astype(np.float32)
    blurred = cv2.GaussianBlur(padded, (0, 0), sigma)
    return np.clip(blurred[4:-4, 4:-4], 0.0, 255.0).astype(np.float32)
