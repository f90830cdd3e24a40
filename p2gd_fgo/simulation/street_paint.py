"""Textures of the street: lane markings, shop windows, cars, clothes, signs."""

from __future__ import annotations

import cv2
import numpy as np

from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.simulation.textures import enlarge, noise, soften

ROAD_M = (16.0, 13.0)
"""Length that the road's texture repeats after, and width from kerb to kerb, kerbs included."""
ZEBRA_M = 4.0
SHOP_M = (6.0, 3.2)

_KERB_M = 0.3
_LINE_M = 0.14


def road(rng: np.random.Generator, ground: Float32Array) -> Float32Array:
    """Four lanes: a double line in the middle, dashes, edge lines, gutters and kerb stones."""
    height, width = ground.shape
    image = ground.copy()
    y = (np.arange(height) + 0.5) * ROAD_M[1] / height
    x = (np.arange(width) + 0.5) * ROAD_M[0] / width
    wear = np.clip(0.82 + 0.14 * noise(rng, ground.shape, 64, octaves=6), 0.0, 1.0)
    # Wheels polish two tracks a lane.
    lane = (y - ROAD_M[1] / 2.0) / 3.2
    tracks = np.exp(-((np.abs((lane % 1.0) - 0.5) - 0.25) ** 2) / 0.008)
    image *= (1.0 - 0.08 * tracks).astype(np.float32)[:, None]
    middle = 0.5 * ROAD_M[1]
    dash = (x % 8.0) < 3.2
    always = np.ones(width, bool)
    lines = [(middle - 0.16, always), (middle + 0.16, always)]
    lines += [(middle - 3.2, dash), (middle + 3.2, dash)]
    lines += [(_KERB_M + 0.35, always), (ROAD_M[1] - _KERB_M - 0.35, always)]
    for center, where in lines:
        share = np.clip((0.5 * _LINE_M - np.abs(y - center)) * height / ROAD_M[1] + 0.5, 0.0, 1.0)
        part = share.astype(np.float32)[:, None] * where[None, :] * wear
        image += part * (208.0 - image)
    stones = rng.normal(168.0, 9.0, 16)
    for k in range(2):
        from_edge = y if k == 0 else ROAD_M[1] - y
        kerb = from_edge < _KERB_M
        gutter = (from_edge >= _KERB_M) & (from_edge < _KERB_M + 0.1)
        joint = (x % 1.0) < 0.03
        row = stones[np.floor(x).astype(int) % 16] - 70.0 * joint
        image[kerb] = row[None, :] + 5.0 * noise(rng, ground.shape, 8, octaves=3)[kerb]
        image[gutter] *= 0.55
    return soften(image, 0.6)


def zebra(rng: np.random.Generator, ground: Float32Array) -> Float32Array:
    """A crossing on foot: bars along the street (the columns), and a stop line before them."""
    height, width = ground.shape
    y = (np.arange(height) + 0.5) * ROAD_M[1] / height
    x = (np.arange(width) + 0.5) / width
    wear = np.clip(0.8 + 0.15 * noise(rng, ground.shape, 64, octaves=6), 0.0, 1.0)
    edge = np.minimum(y, ROAD_M[1] - y)
    bars = ((y % 1.0) < 0.5) & (edge > 0.6)
    place = bars[:, None] & (x < 0.72)[None, :]
    stop = ((x > 0.88) & (x < 0.98))[None, :] & ((edge > 0.5) & (y < 0.5 * ROAD_M[1]))[:, None]
    share = (place | stop) * wear
    image = ground * (1.0 - share) + 210.0 * share
    kerb = edge < _KERB_M
    image[kerb] = 168.0 + 6.0 * noise(rng, ground.shape, 8, octaves=3)[kerb]
    return soften(np.asarray(image, np.float32), 0.6)


def shop(rng: np.random.Generator, size: tuple[int, int] = (512, 256)) -> Float32Array:
    """A shop's front: a board with a name over windows full of things, and a door."""
    width, height = size
    image: Float32Array = np.full((height, width), 60.0, np.float32)
    image += 4.0 * noise(rng, (height, width), 32, octaves=4)
    top = int(0.78 * height)
    board = float(rng.choice([40.0, 110.0, 190.0]))
    image[top : height - 8] = board + 3.0 * noise(rng, (height, width), 32)[top : height - 8]
    ink = 215.0 if board < 120.0 else 45.0
    x = int(0.12 * width)
    while x < 0.85 * width:  # letters
        w = int(rng.integers(8, 18))
        low, high = top + 12, height - 20
        image[low:high, x : x + 4] = ink
        for y in rng.choice([low, (low + high) // 2, high - 4], 2, replace=False):
            image[y : y + 4, x : x + w] = ink
        if rng.random() < 0.5:
            image[low:high, x + w - 4 : x + w] = ink
        x += w + int(rng.integers(5, 20))
    edges = np.linspace(0.03, 0.97, 5) * width
    door = int(rng.integers(4))
    for k in range(4):
        a, b = int(edges[k]) + 4, int(edges[k + 1]) - 4
        low = 10 if k == door else int(0.16 * height)
        pane = image[low : top - 8, a:b]
        pane[:] = np.linspace(95.0, 40.0, pane.shape[0], dtype=np.float32)[:, None]
        for _ in range(12):
            cx, cy = int(rng.integers(a + 4, b - 8)), int(rng.integers(low, low + 80))
            w, h = int(rng.integers(5, 22)), int(rng.integers(8, 34))
            image[cy : min(cy + h, top - 10), cx : min(cx + w, b - 2)] = rng.uniform(40.0, 225.0)
        image[low : top - 8, a : a + 2] = 185.0
        image[low : top - 8, b - 2 : b] = 185.0
    return soften(image, 0.6)


def body_paint(rng: np.random.Generator, shade: float, size: int = 128) -> Float32Array:
    """Clean lacquer with a little sky in it."""
    sheen = np.linspace(-10.0, 14.0, size, dtype=np.float32)[:, None]
    return soften(shade + sheen + 1.5 * noise(rng, (size, size), 64, octaves=5), 0.8)


def car_side(rng: np.random.Generator, shade: float) -> Float32Array:
    """The lower side of a car, 4.3 m x 0.65 m: doors, handles, sill, lights at the ends."""
    width, height = 512, 64
    image = body_paint(rng, shade, 512)[::8].copy()
    dark = 0.35 * shade + 8.0
    image[: int(0.16 * height)] = dark
    for x in (0.27, 0.5, 0.74):
        column = int(x * width)
        image[8:, column : column + 2] = dark
    for x in (0.44, 0.68):
        image[44:48, int(x * width) : int(x * width) + 16] = min(shade + 55.0, 240.0)
    image[30:33] = np.clip(shade - 22.0, 5.0, 255.0)
    image[40:56, :14] = 130.0
    image[40:56, -20:] = 225.0
    for x in (0.2, 0.8):  # arches of the wheels
        cv2.circle(image, (int(x * width), 4), 44, 14.0, -1)
    return soften(image, 0.6)


def car_end(rng: np.random.Generator) -> Float32Array:
    """Nose or tail of a car, 1.75 m x 0.65 m: lights, plate, grille."""
    image: Float32Array = np.full((128, 256), 105.0, np.float32)
    image += 2.0 * noise(rng, (128, 256), 64, octaves=5)
    image[:26] = 30.0
    image[70:108, 8:60] = image[70:108, -60:-8] = 185.0
    image[74:104, 14:34] = image[74:104, -34:-14] = 95.0
    image[58:92, 76:180] = 38.0
    for y in range(62, 90, 8):
        image[y : y + 2, 78:178] = 120.0
    image[30:52, 92:164] = 215.0
    for x in range(98, 158, 9):
        image[35:47, x : x + 5] = 45.0
    return soften(image, 0.6)


def glass(rng: np.random.Generator) -> Float32Array:
    """A car's window: dark, with the sky and a seat in it."""
    image: Float32Array = np.full((64, 64), 38.0, np.float32)
    image += np.linspace(0.0, 42.0, 64, dtype=np.float32)[:, None]
    image[6:34, 36:48] = 34.0
    image[:3] = image[-3:] = 16.0
    image[:, :3] = image[:, -3:] = 16.0
    return soften(image + 2.0 * noise(rng, (64, 64), 16), 0.6)


def tyre() -> Float32Array:
    """A wheel, to be cut out as a disc."""
    image: Float32Array = np.full((128, 128), 22.0, np.float32)
    cv2.circle(image, (64, 64), 42, 165.0, -1)
    for angle in np.arange(5) * 2.0 * np.pi / 5.0:
        x, y = 64 + 25 * np.cos(angle), 64 + 25 * np.sin(angle)
        cv2.circle(image, (int(x), int(y)), 11, 45.0, -1)
    cv2.circle(image, (64, 64), 8, 90.0, -1)
    return soften(image, 0.6)


def cloth(rng: np.random.Generator, shade: float) -> Float32Array:
    """A coat: folds, a seam, pockets."""
    image = shade + 10.0 * noise(rng, (128, 128), 32, octaves=4) + 4.0 * noise(rng, (128, 128), 2)
    folds = noise(rng, (8, 128), 16, octaves=4, persistence=0.9)
    image += 7.0 * enlarge(folds, (128, 128))
    image[:, 63:65] = 0.7 * shade
    for x, y in ((24, 40), (88, 40)):  # pockets
        cv2.rectangle(image, (x, y), (x + 22, y + 3), 0.7 * shade, -1)
    return soften(np.asarray(image, np.float32), 0.8)


def sign(rng: np.random.Generator, kind: int) -> Float32Array:
    """Traffic sign: 0 round with a bar, 1 blue square with an arrow, 2 board with lines of text."""
    image: Float32Array = np.full((128, 128), 190.0, np.float32)
    if kind == 0:
        cv2.circle(image, (64, 64), 62, 80.0, -1)
        cv2.circle(image, (64, 64), 48, 225.0, -1)
        image[54:74, 30:98] = 45.0
    elif kind == 1:
        image[:] = 75.0
        cv2.arrowedLine(image, (64, 18), (64, 108), 235.0, 12, tipLength=0.4)
        cv2.rectangle(image, (4, 4), (123, 123), 230.0, 4)
    else:
        image[:] = 60.0
        for y in range(22, 110, 24):
            x = 12
            while x < 108:
                w = int(rng.integers(8, 26))
                image[y : y + 11, x : min(x + w, 116)] = 225.0
                x += w + 7
    return soften(image, 0.6)


def hills(rng: np.random.Generator) -> Float32Array:
    """Woods seen from far away."""
    image = 100.0 + 12.0 * noise(rng, (256, 512), 64, octaves=6, persistence=0.75)
    return soften(image, 0.8)
