"""Walls of houses: brick or plaster, with a plinth, storeys of windows and doors, and weather."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from p2gd_fgo.simulation.raster import Float32Array
from p2gd_fgo.simulation.textures import noise

_BRICK_M = (0.25, 0.083)  # with its mortar
_MORTAR_M = 0.011


@dataclass(frozen=True, slots=True)
class FacadeStyle:
    """How one house looks.

    Attributes
    ----------
    brick
        Brickwork, or plaster.
    shade
        Mean brightness of the wall.
    storey_m, plinth_m
        Heights of a storey and of the plinth.
    window_m
        Width and height of a window.
    spacing_m
        From window to window.
    """

    brick: bool
    shade: float
    storey_m: float = 3.1
    plinth_m: float = 0.55
    window_m: tuple[float, float] = (1.15, 1.55)
    spacing_m: float = 2.5


def random_style(rng: np.random.Generator) -> FacadeStyle:
    """Any of many plausible houses."""
    brick = bool(rng.random() < 0.7)
    return FacadeStyle(
        brick,
        float(rng.uniform(82.0, 128.0) if brick else rng.uniform(135.0, 185.0)),
        float(rng.uniform(2.9, 3.4)),
        float(rng.uniform(0.3, 0.8)),
        (float(rng.uniform(0.95, 1.5)), float(rng.uniform(1.35, 1.8))),
        float(rng.uniform(2.1, 3.0)),
    )


class _Canvas:
    """An image addressed in metres, origin at the bottom left."""

    def __init__(self, width_m: float, height_m: float, texels_per_m: float) -> None:
        shape = tuple(2 ** round(np.log2(m * texels_per_m)) for m in (height_m, width_m))
        self.shape = (int(shape[0]), int(shape[1]))
        self.image: Float32Array = np.zeros(self.shape, np.float32)
        self.x = ((np.arange(self.shape[1]) + 0.5) * width_m / self.shape[1]).astype(np.float32)
        self.y = ((np.arange(self.shape[0]) + 0.5) * height_m / self.shape[0]).astype(np.float32)
        self._scale = (self.shape[1] / width_m, self.shape[0] / height_m)

    def part(self, x0: float, y0: float, x1: float, y1: float) -> Float32Array:
        """View the texels of a rectangle."""
        columns = np.rint(np.array([x0, x1]) * self._scale[0]).astype(int)
        rows = np.rint(np.array([y0, y1]) * self._scale[1]).astype(int)
        (c0, c1), (r0, r1) = np.maximum(columns, 0), np.maximum(rows, 0)
        return self.image[r0:r1, c0:c1]

    def fill(self, x0: float, y0: float, x1: float, y1: float, value: float) -> None:
        """Paint a rectangle."""
        self.part(x0, y0, x1, y1)[:] = value


def facade(
    rng: np.random.Generator,
    width_m: float,
    height_m: float,
    style: FacadeStyle,
    texels_per_m: float,
) -> Float32Array:
    """Paint the texture (H, W) of one wall of width_m x height_m, to be stretched once over it.

    ``texels_per_m`` is met only roughly: sizes are powers of two.
    """
    canvas = _Canvas(width_m, height_m, texels_per_m)
    _wall(rng, canvas, style)
    storeys = max(int((height_m - 0.4) / style.storey_m), 1)
    bays = max(int((width_m - 0.6) / style.spacing_m), 1)
    margin = 0.5 * (width_m - bays * style.spacing_m)
    doors = set(rng.choice(bays, size=max(1, bays // 6), replace=False).tolist())
    for storey in range(storeys):
        floor = style.plinth_m * 0.4 + storey * style.storey_m
        if storey > 0:
            canvas.fill(0.0, floor + 0.15, width_m, floor + 0.27, style.shade + 38.0)
            canvas.fill(0.0, floor + 0.11, width_m, floor + 0.15, style.shade - 40.0)
        for bay in range(bays):
            middle = margin + (bay + 0.5) * style.spacing_m
            if storey == 0 and bay in doors:
                _door(rng, canvas, middle)
            elif rng.random() < 0.94:
                _window(rng, canvas, middle, floor + 1.0, style)
    for x in (0.12, width_m - 0.2):  # down pipes
        canvas.fill(x, 0.0, x + 0.1, height_m, 70.0)
        canvas.fill(x + 0.03, 0.0, x + 0.06, height_m, 120.0)
    canvas.fill(0.0, height_m - 0.35, width_m, height_m, 0.6 * style.shade)  # eaves
    canvas.fill(0.0, height_m - 0.12, width_m, height_m, 190.0)
    dirt = noise(rng, canvas.shape, 256, octaves=6)
    image = canvas.image * (1.0 + 0.035 * dirt) + 2.5 * noise(rng, canvas.shape, 2, octaves=2)
    return np.asarray(np.clip(cv2.GaussianBlur(image, (0, 0), 0.6), 0.0, 255.0), np.float32)


def _wall(rng: np.random.Generator, canvas: _Canvas, style: FacadeStyle) -> None:
    image = canvas.image
    weather = noise(rng, canvas.shape, 128, octaves=6)
    if style.brick:
        course = np.floor(canvas.y / _BRICK_M[1]).astype(int)
        shift = 0.5 * _BRICK_M[0] * (course % 2)[:, None]
        place = (canvas.x[None, :] + shift) / _BRICK_M[0]
        tones = rng.normal(0.0, 15.0, (course.max() + 1, int(canvas.x[-1] / _BRICK_M[0]) + 3))
        odd = rng.random(tones.shape) < 0.06
        tones[odd] -= rng.uniform(15.0, 40.0, int(odd.sum()))
        image[:] = style.shade + tones[course[:, None], place.astype(int)]
        image += 4.0 * weather + 3.0 * noise(rng, canvas.shape, 4, octaves=3)
        side = np.abs(place - np.rint(place)) * _BRICK_M[0]
        bed = np.abs(canvas.y / _BRICK_M[1] - np.rint(canvas.y / _BRICK_M[1])) * _BRICK_M[1]
        mortar = np.minimum(side, bed[:, None]) < 0.5 * _MORTAR_M
        image[mortar] = style.shade + 42.0 + 8.0 * weather[mortar]
    else:
        image[:] = style.shade + 5.0 * weather + 4.0 * noise(rng, canvas.shape, 4, octaves=3)
        for _ in range(int(canvas.x[-1] * 0.7)):  # bare and patched places
            center = (int(rng.integers(image.shape[1])), int(rng.integers(image.shape[0])))
            axes = (int(rng.integers(4, 36)), int(rng.integers(3, 22)))
            tone = style.shade + rng.uniform(-45.0, 20.0)
            cv2.ellipse(image, center, axes, float(rng.uniform(0, 90)), 0, 360, float(tone), -1)
    plinth = canvas.part(0.0, 0.0, float(canvas.x[-1]) + 1.0, style.plinth_m)
    blocks = np.floor(canvas.x / 0.6).astype(int)
    tones = rng.normal(0.0, 9.0, int(blocks.max()) + 1)
    plinth[:] = 0.35 * plinth + 0.65 * (105.0 + tones[blocks])[None, :]
    plinth[:, np.diff(blocks, prepend=0) > 0] = 62.0
    canvas.fill(0.0, style.plinth_m - 0.05, float(canvas.x[-1]) + 1.0, style.plinth_m, 165.0)


def _window(
    rng: np.random.Generator, canvas: _Canvas, middle: float, sill: float, style: FacadeStyle
) -> None:
    width, height = style.window_m
    x0, x1, y1 = middle - 0.5 * width, middle + 0.5 * width, sill + height
    canvas.fill(x0 - 0.12, y1, x1 + 0.12, y1 + 0.2, style.shade + 48.0)  # lintel
    canvas.fill(x0 - 0.1, sill - 0.1, x1 + 0.1, sill, 178.0)
    canvas.fill(x0 - 0.1, sill - 0.14, x1 + 0.1, sill - 0.1, 45.0)  # the sill's shadow
    streak = canvas.part(x0 - 0.1, sill - 0.14 - rng.uniform(0.2, 0.7), x1 + 0.1, sill - 0.14)
    streak *= 1.0 - 0.12 * rng.random(streak.shape[1], dtype=np.float32)
    canvas.fill(x0, sill, x1, y1, 205.0)
    glass = canvas.part(x0 + 0.06, sill + 0.06, x1 - 0.06, y1 - 0.06)
    glow = np.linspace(rng.uniform(25.0, 50.0), rng.uniform(45.0, 110.0), glass.shape[0])
    slant = np.linspace(0.0, rng.uniform(-25.0, 25.0), glass.shape[1])
    glass[:] = glow[:, None] + slant
    if rng.random() < 0.45:  # a blind, or curtains
        if rng.random() < 0.5:
            low = y1 - 0.06 - rng.uniform(0.2, 0.8) * (height - 0.12)
            blind = canvas.part(x0 + 0.06, low, x1 - 0.06, y1 - 0.06)
            blind[:] = 150.0 - 30.0 * ((np.arange(blind.shape[0]) // 3) % 2)[:, None]
        else:
            for a, b in ((x0 + 0.06, x0 + 0.3), (x1 - 0.3, x1 - 0.06)):
                cloth = canvas.part(a, sill + 0.06, b, y1 - 0.06)
                folds = np.sin(np.arange(cloth.shape[1]) * rng.uniform(0.5, 1.0))
                cloth[:] = rng.uniform(110.0, 170.0) + 18.0 * folds
    if rng.random() < 0.25:  # something on the window board
        x = rng.uniform(x0 + 0.15, x1 - 0.3)
        canvas.fill(
            x, sill + 0.06, x + 0.14, sill + rng.uniform(0.2, 0.45), rng.uniform(60.0, 170.0)
        )
    canvas.fill(middle - 0.035, sill, middle + 0.035, y1, 205.0)
    bar = sill + 0.68 * height
    canvas.fill(x0, bar - 0.03, x1, bar + 0.03, 205.0)
    canvas.part(x0 + 0.06, y1 - 0.1, x1 - 0.06, y1 - 0.06)[:] *= 0.5  # the reveal's shadow


def _door(rng: np.random.Generator, canvas: _Canvas, middle: float) -> None:
    width, height = float(rng.uniform(1.0, 1.7)), float(rng.uniform(2.1, 2.35))
    x0, x1 = middle - 0.5 * width, middle + 0.5 * width
    tone = float(rng.uniform(45.0, 120.0))
    canvas.fill(x0 - 0.18, 0.0, x1 + 0.18, height + 0.2, 175.0)
    canvas.fill(x0 - 0.04, 0.0, x1 + 0.04, height + 0.05, 90.0)
    canvas.fill(x0, 0.12, x1, height, tone)
    canvas.fill(x0 - 0.25, 0.0, x1 + 0.25, 0.12, 150.0)  # step
    for a, b in ((0.12, 0.46), (0.54, 0.88)):
        left, right = x0 + a * width, x0 + b * width
        for low, high in ((0.3, 0.95), (1.05, 1.75)):
            canvas.fill(left, low, right, high, tone + 28.0)
            canvas.fill(left + 0.04, low + 0.04, right - 0.04, high - 0.04, tone - 14.0)
        canvas.fill(left, 1.82, right, height - 0.08, 40.0)
    canvas.fill(x1 - 0.14, 0.98, x1 - 0.08, 1.12, 215.0)
    canvas.fill(x1 + 0.25, 1.35, x1 + 0.47, 1.5, 210.0)  # name plates
    for y in (1.38, 1.43):
        canvas.fill(x1 + 0.27, y, x1 + 0.45, y + 0.02, 50.0)
