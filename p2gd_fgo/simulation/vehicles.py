"""Bodies that stand or move in the street: cars, people, carts; x forward, z up from the ground."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.simulation.palette import Palette
from p2gd_fgo.simulation.raster import DISC, TRIANGLE
from p2gd_fgo.simulation.world import Look, Surfaces, box, concatenate, patches, prism
from p2gd_fgo.types import FloatArray

CAR_M = (4.3, 1.78, 1.45)
VAN_M = (5.2, 1.95, 2.3)
PERSON_M = (0.45, 0.5, 1.72)
CART_M = (1.3, 0.75, 1.55)

_SILL_M, _WAIST_M, _WHEEL_M = 0.24, 0.89, 0.33


def car(palette: Palette, rng: np.random.Generator) -> Surfaces:
    """A saloon or a hatchback."""
    length, width, height = CAR_M
    tone = int(rng.integers(len(palette.paint)))
    estate = bool(rng.random() < 0.5)
    gain = float(rng.uniform(0.85, 1.15))
    side = Look(palette.car_side[tone], gain=gain)
    lacquer, glass = Look(palette.paint[tone], gain=gain), Look(palette.glass)
    x, y = 0.5 * length, 0.5 * width
    parts = _hull(x, y, _SILL_M, _WAIST_M, side, Look(palette.plate, gain=gain), lacquer)
    rear, front = (-x + 0.08 if estate else -x + 0.75), x - 0.95
    back, fore = (-x + 0.35 if estate else -x + 1.35), x - 1.75
    inset = 0.14
    for sign in (-1.0, 1.0):
        low, high = sign * (y - 0.03), sign * (y - inset)
        lean = [0.0, high - low, height - _WAIST_M]
        parts.append(patches([back, low, _WAIST_M], [fore - back, 0.0, 0.0], lean, glass))
        corner = Look(palette.glass, shape=TRIANGLE)
        parts.append(patches([back, low, _WAIST_M], [rear - back, 0.0, 0.0], lean, corner))
        parts.append(patches([fore, low, _WAIST_M], [front - fore, 0.0, 0.0], lean, corner))
        post = [0.07, 0.0, 0.0]
        middle = 0.5 * (back + fore)
        parts.append(patches([middle, 1.003 * low, _WAIST_M], post, lean, lacquer))
    across = [0.0, 2.0 * (y - 0.08), 0.0]
    for base, top in ((front, fore), (rear, back)):
        slope = [top - base, 0.0, height - _WAIST_M]
        parts.append(patches([base, -(y - 0.08), _WAIST_M], across, slope, glass))
    roof = [0.0, 2.0 * (y - inset), 0.0]
    parts.append(patches([back, -(y - inset), height], [fore - back, 0.0, 0.0], roof, lacquer))
    parts += _wheels(palette, 0.3 * length, y)
    return concatenate(parts)


def van(palette: Palette, rng: np.random.Generator) -> Surfaces:
    """A van or a small lorry."""
    length, width, height = VAN_M
    tone = int(rng.integers(2, len(palette.paint)))
    x, y = 0.5 * length, 0.5 * width
    plain = Look(palette.paint[tone])
    end = Look(palette.plate)
    parts = _hull(x, y, 0.3, height, plain, plain, plain)
    for sign in (-1.0, 1.0):
        glass = [x - 1.25, sign * (y + 0.005), 1.25]
        parts.append(patches(glass, [0.9, 0.0, 0.0], [0.0, 0.0, 0.7], Look(palette.glass)))
        label = [-x + 0.7, sign * (y + 0.005), 0.95]
        text = Look(palette.signs[2], gain=float(rng.uniform(0.8, 1.3)))
        parts.append(patches(label, [2.2, 0.0, 0.0], [0.0, 0.0, 0.9], text))
        parts.append(
            patches(
                [sign * (x + 0.005), -0.85 * y, 1.3],
                [0.0, 1.7 * y, 0.0],
                [0.0, 0.0, 0.75],
                Look(palette.glass),
            )
        )
        parts.append(
            patches([sign * (x + 0.004), -y, 0.3], [0.0, width, 0.0], [0.0, 0.0, 0.6], end)
        )
    parts += _wheels(palette, 0.3 * length, y)
    return concatenate(parts)


def person(palette: Palette, rng: np.random.Generator) -> Surfaces:
    """Somebody in a coat: legs, trunk, arms and head, all rounded."""
    scale = float(rng.uniform(0.92, 1.08))
    coat = int(rng.choice(palette.cloth))
    trousers = Look(palette.cloth[int(rng.integers(2))], (0.6, 0.9), gain=0.8)
    cloth, sleeve = Look(coat, (1.2, 0.8)), Look(coat, (0.6, 0.9), gain=0.85)
    skin, hair = Look(palette.paint[2], gain=float(rng.uniform(0.7, 1.1))), Look(palette.paint[0])
    stride = float(rng.uniform(0.06, 0.16))
    parts = [
        prism([stride, 0.09, 0.0], 0.085, 0.86, trousers),
        prism([-stride, -0.09, 0.0], 0.085, 0.86, trousers),
        prism([stride + 0.05, 0.09, 0.0], 0.09, 0.08, hair),
        prism([0.05 - stride, -0.09, 0.0], 0.09, 0.08, hair),
        _oval([0.0, 0.0, 0.74], 0.15, 0.2, 0.42, cloth),
        _oval([0.0, 0.0, 1.1], 0.13, 0.22, 0.32, cloth),
        _oval([0.0, 0.0, 1.4], 0.1, 0.16, 0.07, sleeve),
        prism([0.06, 0.26, 0.8], 0.055, 0.6, sleeve),
        prism([-0.06, -0.26, 0.8], 0.055, 0.6, sleeve),
        prism([0.0, 0.0, 1.44], 0.055, 0.1, skin),
        _oval([0.01, 0.0, 1.52], 0.1, 0.08, 0.15, skin),
        _oval([-0.01, 0.0, 1.63], 0.11, 0.09, 0.08, hair),
        _oval([-0.01, 0.0, 1.7], 0.08, 0.065, 0.04, hair),
    ]
    return concatenate(parts).transformed(np.diag([scale, scale, scale, 1.0]))


def cart(palette: Palette, rng: np.random.Generator) -> Surfaces:
    """Somebody pushes a tall cart of crates."""
    length, width, _ = CART_M
    wood = Look(palette.materials.planks, gain=float(rng.uniform(0.8, 1.2)))
    metal = Look(palette.materials.painted[1])
    parts = [
        box([0.2, 0.0, 0.15], [length - 0.4, width, 0.12], 0.0, metal),
        box([0.2, 0.0, 0.27], [0.85, 0.7, 0.66], 0.0, wood),
        box([0.25, 0.02, 0.93], [0.65, 0.6, 0.6], 0.12, Look(palette.materials.planks, gain=0.9)),
    ]
    pusher = person(palette, rng)
    T = np.eye(4)
    T[0, 3] = -0.75
    return concatenate([*parts, pusher.transformed(T)])


def _hull(
    x: float, y: float, low: float, high: float, side: Look, end: Look, top: Look
) -> list[Surfaces]:
    """Sides, ends, lid and floor of a box of half length x and half width y."""
    up, along, across = [0.0, 0.0, high - low], [2.0 * x, 0.0, 0.0], [0.0, 2.0 * y, 0.0]
    return [
        patches([-x, -y, low], along, up, side),
        patches([-x, y, low], along, up, side),
        patches([[-x, -y, low], [x, -y, low]], across, up, end),
        patches([-x, -y, high], along, across, top),
        patches([-x, -y, low], along, across, Look(side.texture, gain=0.15)),
    ]


def _wheels(palette: Palette, x: float, y: float) -> list[Surfaces]:
    size = 2.0 * _WHEEL_M
    out: list[Surfaces] = []
    for sx in (-x, x):
        for sy in (-y - 0.012, y + 0.012):
            corner: FloatArray = np.array([sx - _WHEEL_M, sy, 0.0])
            look = Look(palette.tyre, shape=DISC)
            out.append(patches(corner, [size, 0.0, 0.0], [0.0, 0.0, size], look))
            inner = Look(palette.tyre, gain=0.3, shape=DISC)
            shift = np.array([0.0, -0.2 * np.sign(sy), 0.0])
            out.append(patches(corner + shift, [size, 0.0, 0.0], [0.0, 0.0, size], inner))
    return out


def _oval(foot: list[float], along: float, aside: float, height: float, look: Look) -> Surfaces:
    """An upright prism over an ellipse, closed above."""
    mantle = prism([0.0, 0.0, 0.0], 1.0, height, look)
    lid = Look(look.texture, gain=look.gain, shape=DISC)
    top = patches([-1.0, -1.0, height], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], lid)
    T = np.diag([along, aside, 1.0, 1.0])
    T[:3, 3] = foot
    return concatenate([mantle, top]).transformed(T)
