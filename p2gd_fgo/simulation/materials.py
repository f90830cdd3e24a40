"""Procedural materials with detail at every scale: what the ground and things are made of.

Each is a texture as :mod:`p2gd_fgo.simulation.textures` has them; its size in the world is the
builder's choice, a few millimetres a texel for the ground.
"""

from __future__ import annotations

import cv2
import numpy as np

from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.simulation.textures import crack, enlarge, noise, soften, speckle


def asphalt(rng: np.random.Generator, size: int = 2048) -> Float32Array:
    """Old asphalt: grains, patches, cracks. Meant for about 4 mm a texel."""
    shape = (size, size)
    image = 92.0 + 7.0 * noise(rng, shape, size // 8, octaves=5)
    speckle(rng, image, 5, (60, 130), (70, 84), stretch=0.6)  # mended places
    image += 7.0 * noise(rng, shape, 8, octaves=4, persistence=1.1)
    speckle(rng, image, size * size // 180, (0.6, 1.6), (112, 165), stretch=0.5)
    speckle(rng, image, size * size // 400, (0.6, 1.8), (45, 70), stretch=0.5)
    for _ in range(9):
        crack(rng, image, int(rng.integers(200, 900)), 40.0)
    speckle(rng, image, 60, (3, 8), (55, 170), stretch=0.4)  # leaves
    return soften(image, 0.7)


def parking(rng: np.random.Generator, ground: Float32Array) -> Float32Array:
    """Paint the worn lines of three bays along the rows' axis onto a ground (H, W).

    They are part of the texture, not surfaces above it, so that far away they fade with it
    instead of breaking into dashes.
    """
    height, width = ground.shape
    column = np.abs((np.arange(width) * 3.0 / width) % 1.0 - 0.5) * width / 3.0
    line = np.clip(0.007 * width - column, 0.0, 1.0).astype(np.float32)
    wear = np.clip(0.85 + 0.12 * noise(rng, (height, width), 64, octaves=6), 0.0, 1.0)
    share = line[None, :] * wear
    return np.asarray(ground * (1.0 - share) + 205.0 * share, np.float32)


def slabs(
    rng: np.random.Generator,
    size: int = 2048,
    slab: tuple[int, int] = (128, 128),
    shade: float = 142.0,
) -> Float32Array:
    """Pavement of slabs, each with a tone of its own; ``slab`` (columns, rows) in texels."""
    shape = (size, size)
    place = np.arange(size)
    course = place // slab[1]
    shifted = place + np.array([[0], [slab[0] // 2]])  # every other course by half a slab
    tones = rng.normal(0.0, 11.0, (size // slab[1], size // slab[0])).astype(np.float32)
    column = (shifted // slab[0]) % (size // slab[0])
    image = shade + tones[course[:, None], column[course % 2]]
    image += 5.0 * noise(rng, shape, 64, octaves=4) + 6.0 * noise(rng, shape, 4, octaves=3)
    speckle(rng, image, size * size // 900, (0.8, 2.8), (70, 105), stretch=0.6)
    speckle(rng, image, size * size // 1200, (0.8, 2.4), (180, 215), stretch=0.6)
    speckle(rng, image, 160, (3, 8), (70, 110), stretch=0.7)  # gum and stains
    joint = 2.5 + 0.8 * noise(rng, shape, 32, octaves=3)
    side = np.minimum(shifted % slab[0], slab[0] - 1 - shifted % slab[0]).astype(np.float32)
    bed = np.minimum(place % slab[1], slab[1] - 1 - place % slab[1]).astype(np.float32)
    gap = np.minimum(side[course % 2], bed[:, None])
    moss = 62.0 + 12.0 * noise(rng, shape, 16, octaves=4)
    share = np.clip(joint - gap, 0.0, 1.0)
    image = image * (1.0 - share) + moss * share
    for _ in range(7):
        crack(rng, image, int(rng.integers(60, 220)), 75.0)
    speckle(rng, image, 50, (5, 12), (50, 200), stretch=0.4)  # leaves
    return soften(image, 0.7)


def grass(rng: np.random.Generator, size: int = 2048) -> Float32Array:
    """Lawn: blades, clumps, daisies, bare spots."""
    shape = (size, size)
    image = 88.0 + 9.0 * noise(rng, shape, size // 8, octaves=4)
    image += 17.0 * noise(rng, shape, 32, octaves=6, persistence=0.85)
    count = size * size // 160
    start = rng.uniform(0.0, size, (count, 2))
    heading = rng.uniform(0.0, 2.0 * np.pi, count)
    reach = rng.uniform(6.0, 20.0, count)[:, None]
    end = start + reach * np.stack([np.cos(heading), np.sin(heading)], -1)
    tones = rng.uniform(45.0, 150.0, 12)
    for k, tone in enumerate(tones):
        part = np.rint(np.stack([start[k::12], end[k::12]], 1)).astype(np.int32)
        cv2.polylines(image, list(part), False, float(tone), 1)
    speckle(rng, image, 260, (2.5, 6.0), (170, 235), stretch=0.7)
    speckle(rng, image, 120, (4.0, 10.0), (40, 60), stretch=0.4)
    return soften(image, 0.8)


def concrete(rng: np.random.Generator, size: int = 512, shade: float = 150.0) -> Float32Array:
    """Cast concrete: clouds, pores, streaks."""
    shape = (size, size)
    image = shade + 9.0 * noise(rng, shape, size // 4, octaves=5)
    image += 5.0 * noise(rng, shape, 4, octaves=3)
    streaks = noise(rng, (1, size), 32, octaves=5)
    image += 4.0 * streaks
    speckle(rng, image, size * size // 700, (0.8, 3.0), (shade - 65, shade - 25))
    return soften(image, 0.7)


def planks(rng: np.random.Generator, size: int = 512, plank: int = 64) -> Float32Array:
    """Weathered boards along the columns, with grain, nails, gaps and two battens."""
    shape = (size, size)
    board = np.arange(size)[:, None] // plank
    tones = rng.normal(0.0, 14.0, size // plank).astype(np.float32)
    grain = noise(rng, (size, max(size // 32, 1)), 8, octaves=4, persistence=0.9)
    image = 150.0 + tones[board] + 12.0 * enlarge(grain, shape)
    image += 5.0 * noise(rng, shape, 64, octaves=6)
    inside = np.arange(size) % plank
    image[(inside < 2) | (inside > plank - 2)] = 45.0
    speckle(rng, image, 14, (5, 12), (75, 105), stretch=0.5)  # knots
    for column in (0, size - size // 8):
        batten = image[:, column : column + size // 8]
        batten[:] = 128.0 + 7.0 * noise(rng, batten.shape, 64, octaves=6)
        batten[:, [0, 1, -2, -1]] = 55.0
        for row in range(plank // 2, size, plank):
            for shift in (-plank // 5, plank // 5):
                cv2.circle(image, (column + size // 16, row + shift), 3, 50.0, -1)
    return soften(image, 0.7)


def foliage(rng: np.random.Generator, size: int = 512, shade: float = 105.0) -> Float32Array:
    """Leaves in front of leaves."""
    shape = (size, size)
    image = 30.0 + 8.0 * noise(rng, shape, 32, octaves=4)
    for depth in np.linspace(0.3, 1.0, 5):
        tone = float(shade * depth)
        speckle(rng, image, size * size // 450, (5, 13), (tone * 0.7, tone * 1.3), stretch=0.45)
    return soften(image + 4.0 * noise(rng, shape, 4, octaves=3), 0.8)


def bark(rng: np.random.Generator, size: int = 256) -> Float32Array:
    """Furrowed bark, furrows along the rows' axis (upright on a trunk)."""
    furrows = enlarge(noise(rng, (size // 16, size), 16, octaves=5, persistence=0.9), (size, size))
    return soften(82.0 + 22.0 * furrows + 8.0 * noise(rng, (size, size), 8, octaves=4), 0.6)


def painted(rng: np.random.Generator, size: int = 256, shade: float = 120.0) -> Float32Array:
    """Painted metal: smooth, with scratches, rust and a rim."""
    shape = (size, size)
    image = shade + 5.0 * noise(rng, shape, size // 2, octaves=7)
    speckle(rng, image, size // 4, (0.8, 4.0), (shade - 60, shade + 45), stretch=0.5)
    cv2.rectangle(image, (4, 4), (size - 5, size - 5), shade - 45.0, 3)
    for y in (size // 4, size // 2, 3 * size // 4):
        cv2.line(image, (16, y), (size - 17, y), shade - 30.0, 2)
    return soften(image, 0.6)
