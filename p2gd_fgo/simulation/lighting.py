"""Sun, shadows and stains, baked once into a small light map per surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.simulation.compiled import compiled
from p2gd_fgo.simulation.raster import DISC, TRIANGLE, Float32Array
from p2gd_fgo.simulation.textures import noise
from p2gd_fgo.simulation.world import LightMaps, Surfaces
from p2gd_fgo.types import BoolArray, FloatArray, IntArray

_FLAT_M = 0.6  # smaller surfaces get one value
_MAX_CELLS = 1024
_BLOCK = 8  # cells a side that share a list of what may shade them
_OFFSET_M = 0.03  # of the shadow ray's start from its surface
_SMALL_M, _COLUMN_M = 4.2, 2.0  # radius of small surfaces, and width of the bins they are kept in
_CONTACT_M = 0.9  # reach of the darkening near the ground and near walls


@dataclass(frozen=True, slots=True)
class Sun:
    """Light of a day.

    Attributes
    ----------
    direction
        Towards the sun.
    strength
        Brightness that it adds where it falls straight.
    ambient
        Factor on the light from the sky.
    """

    direction: tuple[float, float, float] = (0.45, -0.4, 0.8)
    strength: float = 0.65
    ambient: float = 1.0


def bake(
    surfaces: Surfaces,
    sun: Sun,
    rng: np.random.Generator,
    *,
    cell_m: float | FloatArray = 0.125,
    casters: BoolArray | None = None,
) -> LightMaps:
    """Light on every surface: sky from above, sun where nothing stands before it, uneven dirt.

    Parameters
    ----------
    cell_m
        Size of a cell of the light maps, or one for each surface (M,).
    casters
        (M,) which surfaces throw shadows; None: all.
    """
    direction = np.asarray(sun.direction) / np.linalg.norm(sun.direction)
    size = surfaces.size_m
    cell = np.broadcast_to(cell_m, len(surfaces))[:, None]
    cells = np.where(size < _FLAT_M, 1, np.ceil(size / cell).clip(1, _MAX_CELLS)).astype(np.int64)
    cells[(size < _FLAT_M).all(1)] = 1
    counts = cells.prod(1)
    offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
    grids = np.column_stack([offsets, cells])
    normal, dual_u, dual_v = surfaces.normals_and_duals()
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sunny = normal @ direction
    lit = np.zeros(int(counts.sum()), np.float32)
    middle = surfaces.corner + 0.5 * (surfaces.edge_u + surfaces.edge_v)
    radius = 0.5 * size.sum(1)
    forms = np.stack([dual_u, dual_v, normal], 1)
    _cast(
        surfaces.corner,
        surfaces.edge_u,
        surfaces.edge_v,
        surfaces.shape,
        forms,
        middle,
        radius,
        grids,
        direction,
        *_bins(middle, radius, direction, casters),
        lit,
    )
    sky = sun.ambient * np.where(np.abs(normal[:, 2]) > 0.5, 0.78, 0.66)
    of = np.repeat(np.arange(len(surfaces)), counts)
    values = sky[of] + sun.strength * np.abs(sunny)[of] * lit
    values *= surfaces.gain[of]
    light = LightMaps(values.astype(np.float32), grids)
    _stain(surfaces, light, rng)
    return light


def _bins(
    middle: FloatArray, radius: FloatArray, sun: FloatArray, casters: BoolArray | None
) -> tuple[FloatArray, FloatArray, IntArray, IntArray, IntArray, IntArray]:
    """Sort the small surfaces into columns along the sun's direction.

    Returns
    -------
    Places (M, 2) across the sun, in columns from 0 on; the axes (2, 3) across; how many columns
    (2,); the small surfaces column by column; where each column starts in them, one more than
    there are; the large ones.
    """
    side = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(sun, side)])
    across = middle @ axes.T
    across = (across - across.min(0)) / _COLUMN_M
    casts = np.ones(len(radius), bool) if casters is None else casters
    small = np.flatnonzero((radius <= _SMALL_M) & casts)
    count = np.floor(across.max(0)).astype(np.int64) + 1
    column = np.floor(across[small]).astype(np.int64) @ np.array([count[1], 1])
    order = np.argsort(column, kind="stable")
    starts = np.searchsorted(column[order], np.arange(count.prod() + 1))
    return across, axes, count, small[order], starts, np.flatnonzero((radius > _SMALL_M) & casts)


def _stain(surfaces: Surfaces, light: LightMaps, rng: np.random.Generator) -> None:
    """Blotches of some metres and darker foots of walls, so that repeats of a texture differ."""
    for m, (offset, columns, rows) in enumerate(light.grids):
        if columns * rows < 64:
            continue
        part = light.values[offset : offset + columns * rows].reshape(rows, columns)
        shape = (_power_of_two(int(rows)), _power_of_two(int(columns)))
        blotches = noise(rng, shape, 64, octaves=5, persistence=0.75)[:rows, :columns]
        part *= 1.0 + 0.07 * blotches
        if abs(surfaces.edge_v[m, 2]) > 0.5 * np.linalg.norm(surfaces.edge_v[m]):
            height = (np.arange(rows) + 0.5) / rows * abs(surfaces.edge_v[m, 2])
            part *= (1.0 - 0.35 * np.exp(-height / (0.3 * _CONTACT_M))).astype(np.float32)[:, None]


def _power_of_two(n: int) -> int:
    return 1 << max(n - 1, 0).bit_length()


@compiled
def _cast(
    corner: FloatArray,
    edge_u: FloatArray,
    edge_v: FloatArray,
    shapes: IntArray,
    forms: FloatArray,
    middle: FloatArray,
    radius: FloatArray,
    grids: IntArray,
    sun: FloatArray,
    across: FloatArray,
    axes: FloatArray,
    columns_of: IntArray,
    small: IntArray,
    starts: IntArray,
    large: IntArray,
    lit: Float32Array,
) -> None:  # pragma: no cover
    """Set ``lit`` to 1 where the ray towards the sun meets no other surface."""
    m_count = corner.shape[0]
    everything, around, near = (
        np.empty(m_count, np.int64),
        np.empty(m_count, np.int64),
        np.empty(m_count, np.int64),
    )
    p = np.empty(3)
    for m in range(m_count):
        offset, columns, rows = grids[m, 0], grids[m, 1], grids[m, 2]
        side = forms[m, 2, 0] * sun[0] + forms[m, 2, 1] * sun[1] + forms[m, 2, 2] * sun[2]
        lift = _OFFSET_M if side > 0.0 else -_OFFSET_M
        found = 0
        for k in large:
            if k != m:
                everything[found] = k
                found += 1
        found = _between(middle, radius, everything, found, middle[m], radius[m], sun, around)
        for first_row in range(0, rows, _BLOCK):
            for first_column in range(0, columns, _BLOCK):
                last_row = min(first_row + _BLOCK, rows)
                last_column = min(first_column + _BLOCK, columns)
                u = 0.5 * (first_column + last_column) / columns
                v = 0.5 * (first_row + last_row) / rows
                p[:] = corner[m] + u * edge_u[m] + v * edge_v[m]
                share = max((last_row - first_row) / rows, (last_column - first_column) / columns)
                count = _between(middle, radius, around, found, p, share * radius[m], sun, near)
                reach = (share * radius[m] + _SMALL_M + _OFFSET_M) / _COLUMN_M
                across_u = across[m, 0] + _dot(p, middle[m], axes[0]) / _COLUMN_M
                across_v = across[m, 1] + _dot(p, middle[m], axes[1]) / _COLUMN_M
                i0, i1 = int(max(across_u - reach, 0.0)), int(across_u + reach) + 1
                j0, j1 = int(max(across_v - reach, 0.0)), int(across_v + reach) + 1
                those = 0
                for i in range(i0, min(i1, columns_of[0])):
                    row_of = i * columns_of[1]
                    begin, end = row_of + min(j0, columns_of[1]), row_of + min(j1, columns_of[1])
                    for k in small[starts[begin] : starts[end]]:
                        if k != m:
                            everything[those] = k
                            those += 1
                count += _between(
                    middle, radius, everything, those, p, share * radius[m], sun, near[count:]
                )
                count = _over(corner, forms, near, count, p, share * radius[m], sun)
                last = -1
                for row in range(first_row, last_row):
                    for column in range(first_column, last_column):
                        u, v = (column + 0.5) / columns, (row + 0.5) / rows
                        for i in range(3):
                            p[i] = corner[m, i] + u * edge_u[m, i] + v * edge_v[m, i]
                            p[i] += lift * forms[m, 2, i]
                        blocked = last >= 0 and _blocks(corner, shapes, forms, last, p, sun)
                        k = 0
                        while not blocked and k < count:
                            if _blocks(corner, shapes, forms, near[k], p, sun):
                                blocked, last = True, near[k]
                            k += 1
                        lit[offset + row * columns + column] = 0.0 if blocked else 1.0


@compiled
def _dot(p: FloatArray, q: FloatArray, axis: FloatArray) -> float:  # pragma: no cover
    """How far p lies beyond q along an axis."""
    return float((p[0] - q[0]) * axis[0] + (p[1] - q[1]) * axis[1] + (p[2] - q[2]) * axis[2])


@compiled
def _between(
    middle: FloatArray,
    radius: FloatArray,
    those: IntArray,
    count: int,
    p: FloatArray,
    reach: float,
    sun: FloatArray,
    out: IntArray,
) -> int:  # pragma: no cover
    """Those whose bounding sphere may stand between a sphere at p and the sun; how many."""
    found = 0
    for k in those[:count]:
        x, y, z = middle[k, 0] - p[0], middle[k, 1] - p[1], middle[k, 2] - p[2]
        ahead = x * sun[0] + y * sun[1] + z * sun[2]
        both = radius[k] + reach + _OFFSET_M
        if ahead > -both and x * x + y * y + z * z - ahead * ahead < both * both:
            out[found] = k
            found += 1
    return found


@compiled
def _over(
    corner: FloatArray,
    forms: FloatArray,
    those: IntArray,
    count: int,
    p: FloatArray,
    reach: float,
    sun: FloatArray,
) -> int:  # pragma: no cover
    """Keep those whose outline, seen along the sun, meets a sphere at p; how many."""
    found = 0
    for k in those[:count]:
        n, u_of, v_of = forms[k, 2], forms[k, 0], forms[k, 1]
        along = n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2]
        if abs(along) > 1e-9:
            gx, gy, gz = corner[k, 0] - p[0], corner[k, 1] - p[1], corner[k, 2] - p[2]
            t = (n[0] * gx + n[1] * gy + n[2] * gz) / along
            hx, hy, hz = t * sun[0] - gx, t * sun[1] - gy, t * sun[2] - gz
            u = u_of[0] * hx + u_of[1] * hy + u_of[2] * hz
            v = v_of[0] * hx + v_of[1] * hy + v_of[2] * hz
            stretch = 1.01 * (reach + 2.0 * _OFFSET_M) / abs(along)
            du = stretch * math.sqrt(u_of[0] ** 2 + u_of[1] ** 2 + u_of[2] ** 2)
            dv = stretch * math.sqrt(v_of[0] ** 2 + v_of[1] ** 2 + v_of[2] ** 2)
            if t < -stretch or u < -du or u > 1.0 + du or v < -dv or v > 1.0 + dv:
                continue
        those[found] = k
        found += 1
    return found


@compiled
def _blocks(
    corner: FloatArray, shapes: IntArray, forms: FloatArray, k: int, p: FloatArray, sun: FloatArray
) -> bool:  # pragma: no cover
    """Whether surface k stands between p and the sun."""
    nx, ny, nz = forms[k, 2, 0], forms[k, 2, 1], forms[k, 2, 2]
    along = nx * sun[0] + ny * sun[1] + nz * sun[2]
    if abs(along) < 1e-9:
        return False
    gx, gy, gz = corner[k, 0] - p[0], corner[k, 1] - p[1], corner[k, 2] - p[2]
    t = (nx * gx + ny * gy + nz * gz) / along
    if t <= 0.0:
        return False
    hx, hy, hz = t * sun[0] - gx, t * sun[1] - gy, t * sun[2] - gz
    u = forms[k, 0, 0] * hx + forms[k, 0, 1] * hy + forms[k, 0, 2] * hz
    v = forms[k, 1, 0] * hx + forms[k, 1, 1] * hy + forms[k, 1, 2] * hz
    if u < 0.0 or u > 1.0 or v < 0.0 or v > 1.0:
        return False
    if shapes[k] == TRIANGLE:
        return bool(u + v <= 1.0)
    if shapes[k] == DISC:
        return bool((u - 0.5) ** 2 + (v - 0.5) ** 2 <= 0.25)
    return True
