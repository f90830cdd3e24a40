"""Compiled kernels of the renderer: which surface a pixel sees, and how bright it is.

A flat patch with corner O, edges a and b is met by the ray t·d (d = (x, y, 1), so t is the depth)
where 1/t, u/t and v/t are linear in d, u and v being the coordinates along the edges. Three
3-vectors per surface therefore give visibility, texture and footprint for any lens, without
clipping or interpolation.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from p2gd_fgo.simulation.compiled import compiled
from p2gd_fgo.types import FloatArray, IntArray

RECTANGLE, TRIANGLE, DISC = 0, 1, 2
NOTHING = -1
NEAREST_M = 0.05  # what is closer than this isn't drawn

_SUBSAMPLES = 4  # per axis, in pixels on an edge
_MAX_CANDIDATES = 9
_MAX_TAPS = 8  # of the anisotropic texture filter
_SOFTNESS = 0.5  # octaves of extra blur, as a lens has: without it sharp edges jump between pixels

Float32Array = NDArray[np.float32]
OwnerArray = NDArray[np.int32]


@compiled
def _covers(
    forms: FloatArray, shapes: IntArray, m: int, x: float, y: float
) -> float:  # pragma: no cover
    """Inverse depth of surface m along the ray (x, y, 1), or 0 where the ray misses it."""
    w = forms[m, 0, 0] * x + forms[m, 0, 1] * y + forms[m, 0, 2]
    if w <= 0.0 or w > 1.0 / NEAREST_M:
        return 0.0
    u = forms[m, 1, 0] * x + forms[m, 1, 1] * y + forms[m, 1, 2]
    if u < 0.0 or u > w:
        return 0.0
    v = forms[m, 2, 0] * x + forms[m, 2, 1] * y + forms[m, 2, 2]
    if v < 0.0 or v > w:
        return 0.0
    if shapes[m] == TRIANGLE and u + v > w:
        return 0.0
    if shapes[m] == DISC and (u - 0.5 * w) ** 2 + (v - 0.5 * w) ** 2 > 0.25 * w * w:
        return 0.0
    return float(w)


@compiled
def visibility(
    ray_x: FloatArray, ray_y: FloatArray, forms: FloatArray, shapes: IntArray, boxes: IntArray
) -> tuple[OwnerArray, FloatArray]:  # pragma: no cover
    """Nearest surface (H, W), ``NOTHING`` for the sky, and its inverse depth (H, W), 1/m.

    Parameters
    ----------
    ray_x, ray_y
        (H, W) undistorted coordinates of each pixel's ray.
    forms
        (M, 3, 3) rows 1/t, u/t, v/t in the camera frame.
    shapes
        (M,) ``RECTANGLE``, ``TRIANGLE`` (u + v ≤ 1) or ``DISC`` (inscribed ellipse).
    boxes
        (M, 4) first and past-the-last row, first and past-the-last column to scan.
    """
    height, width = ray_x.shape
    owner = np.full((height, width), NOTHING, np.int32)
    inverse_depth = np.zeros((height, width))
    for m in range(forms.shape[0]):
        w_x, w_y, w_1 = forms[m, 0, 0], forms[m, 0, 1], forms[m, 0, 2]
        for row in range(boxes[m, 0], boxes[m, 1]):
            for column in range(boxes[m, 2], boxes[m, 3]):
                x, y = ray_x[row, column], ray_y[row, column]
                if w_x * x + w_y * y + w_1 <= inverse_depth[row, column]:
                    continue  # hidden wherever in its plane it ends
                w = _covers(forms, shapes, m, x, y)
                if w > inverse_depth[row, column]:
                    inverse_depth[row, column] = w
                    owner[row, column] = m
    return owner, inverse_depth


@compiled
def _bilinear(
    texels: NDArray[np.uint8], levels: IntArray, texture: int, level: int, s: float, t: float
) -> float:  # pragma: no cover
    """One level of a texture that repeats; (s, t) in units of the whole texture."""
    offset = levels[texture, level, 0]
    width, height = levels[texture, level, 1], levels[texture, level, 2]
    x, y = s * width - 0.5, t * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    i0, j0 = int(x0) & (width - 1), int(y0) & (height - 1)
    i1, j1 = (i0 + 1) & (width - 1), (j0 + 1) & (height - 1)
    upper = texels[offset + j0 * width + i0] * (1.0 - fx) + texels[offset + j0 * width + i1] * fx
    lower = texels[offset + j1 * width + i0] * (1.0 - fx) + texels[offset + j1 * width + i1] * fx
    return float(upper * (1.0 - fy) + lower * fy)


@compiled
def _texture(
    forms: FloatArray,
    mappings: FloatArray,
    texture: int,
    levels: IntArray,
    texels: NDArray[np.uint8],
    m: int,
    x: float,
    y: float,
    steps: FloatArray,
    row: int,
    column: int,
) -> float:  # pragma: no cover
    """Anisotropic trilinear lookup in the texture of surface m along the ray (x, y, 1)."""
    w_x, w_y = forms[m, 0, 0], forms[m, 0, 1]
    depth = 1.0 / (w_x * x + w_y * y + forms[m, 0, 2])
    u = (forms[m, 1, 0] * x + forms[m, 1, 1] * y + forms[m, 1, 2]) * depth
    v = (forms[m, 2, 0] * x + forms[m, 2, 1] * y + forms[m, 2, 2]) * depth
    s_scale, t_scale = mappings[m, 0] * depth, mappings[m, 1] * depth
    s_x, s_y = s_scale * (forms[m, 1, 0] - u * w_x), s_scale * (forms[m, 1, 1] - u * w_y)
    t_x, t_y = t_scale * (forms[m, 2, 0] - v * w_x), t_scale * (forms[m, 2, 1] - v * w_y)
    s, t = mappings[m, 0] * u + mappings[m, 2], mappings[m, 1] * v + mappings[m, 3]

    # The footprint of the pixel: its long side gets several taps, its short side sets the level.
    x_along, y_along = steps[row, column, 0], steps[row, column, 1]
    x_down, y_down = steps[row, column, 2], steps[row, column, 3]
    ds, dt = s_x * x_along + s_y * y_along, t_x * x_along + t_y * y_along
    ds_down, dt_down = s_x * x_down + s_y * y_down, t_x * x_down + t_y * y_down
    width, height = levels[texture, 0, 1], levels[texture, 0, 2]
    major = math.sqrt((ds * width) ** 2 + (dt * height) ** 2)
    minor = math.sqrt((ds_down * width) ** 2 + (dt_down * height) ** 2)
    if minor > major:
        major, minor, ds, dt = minor, major, ds_down, dt_down
    taps = min(max(math.ceil(major / max(minor, 1.0) - 0.25), 1), _MAX_TAPS)
    level = min(max(math.log2(max(major / taps, 1e-9)) + _SOFTNESS, 0.0), levels.shape[1] - 1.001)
    fine = int(level)
    blend = level - fine
    total = 0.0
    for k in range(taps):
        shift = (k + 0.5) / taps - 0.5
        sk, tk = s + shift * ds, t + shift * dt
        value = _bilinear(texels, levels, texture, fine, sk, tk)
        if blend > 0.0:
            value += blend * (_bilinear(texels, levels, texture, fine + 1, sk, tk) - value)
        total += value
    return total / taps


@compiled
def _light(
    forms: FloatArray, lumels: Float32Array, grids: IntArray, m: int, x: float, y: float
) -> float:  # pragma: no cover
    """Bilinear lookup in the light map of surface m along the ray (x, y, 1)."""
    offset, columns, rows = grids[m, 0], grids[m, 1], grids[m, 2]
    if columns * rows == 1:
        return float(lumels[offset])
    depth = 1.0 / (forms[m, 0, 0] * x + forms[m, 0, 1] * y + forms[m, 0, 2])
    u = (forms[m, 1, 0] * x + forms[m, 1, 1] * y + forms[m, 1, 2]) * depth
    v = (forms[m, 2, 0] * x + forms[m, 2, 1] * y + forms[m, 2, 2]) * depth
    i_real = min(max(u * columns - 0.5, 0.0), columns - 1.0)
    j_real = min(max(v * rows - 0.5, 0.0), rows - 1.0)
    i, j = int(i_real), int(j_real)
    fx, fy = i_real - i, j_real - j
    i1 = min(i + 1, columns - 1)
    first, second = offset + j * columns, offset + min(j + 1, rows - 1) * columns
    upper = lumels[first + i] * (1.0 - fx) + lumels[first + i1] * fx
    lower = lumels[second + i] * (1.0 - fx) + lumels[second + i1] * fx
    return float(upper * (1.0 - fy) + lower * fy)


@compiled
def shade(
    ray_x: FloatArray,
    ray_y: FloatArray,
    steps: FloatArray,
    owner: OwnerArray,
    forms: FloatArray,
    shapes: IntArray,
    mappings: FloatArray,
    textures: IntArray,
    texels: NDArray[np.uint8],
    levels: IntArray,
    lumels: Float32Array,
    grids: IntArray,
    sky: FloatArray,
) -> Float32Array:  # pragma: no cover
    """Brightness (H, W), 0 to 255, anti-aliased.

    Inside a surface one filtered lookup per pixel; where the 3x3 neighbourhood holds several
    surfaces, each of those is looked up once and weighted by its share of 4x4 sub-pixel rays.

    Parameters
    ----------
    steps
        (H, W, 4) change of the ray per pixel: x and y along the row, x and y down the column.
    mappings
        (M, 4) scale and offset from (u, v) to texture repeats: s = m0 u + m2, t = m1 v + m3.
    textures
        (M,) index into ``levels`` (T, L, 3).
    grids
        (M, 3) light map of each surface in ``lumels``.
    sky
        (5,) brightness at the horizon, the vector (camera frame) whose product with a ray's
        direction is the change with elevation, and the haze's extinction, 1/m.
    """
    height, width = ray_x.shape
    out = np.empty((height, width), np.float32)
    candidates = np.empty(_MAX_CANDIDATES, np.int64)
    hits = np.empty(_MAX_CANDIDATES, np.int64)
    sum_x = np.empty(_MAX_CANDIDATES)
    sum_y = np.empty(_MAX_CANDIDATES)
    for row in range(height):
        for column in range(width):
            first, last = max(row - 1, 0), min(row + 2, height)
            left, right = max(column - 1, 0), min(column + 2, width)
            candidates[0], count = owner[row, column], 1
            for r in range(first, last):
                for c in range(left, right):
                    m = owner[r, c]
                    if m == candidates[0]:
                        continue
                    k = 1
                    while k < count and candidates[k] != m:
                        k += 1
                    if k == count:
                        candidates[count] = m
                        count += 1
            x, y = ray_x[row, column], ray_y[row, column]
            if count == 1:
                hits[0], sum_x[0], sum_y[0] = 1, x, y
            else:
                hits[:count], sum_x[:count], sum_y[:count] = 0, 0.0, 0.0
                for i in range(_SUBSAMPLES * _SUBSAMPLES):
                    along = (i % _SUBSAMPLES + 0.5) / _SUBSAMPLES - 0.5
                    down = (i // _SUBSAMPLES + 0.5) / _SUBSAMPLES - 0.5
                    xs = x + along * steps[row, column, 0] + down * steps[row, column, 2]
                    ys = y + along * steps[row, column, 1] + down * steps[row, column, 3]
                    nearest, best = 0.0, -1
                    for k in range(count):
                        if candidates[k] == NOTHING:
                            if best == -1:
                                best = k
                            continue
                        w = _covers(forms, shapes, candidates[k], xs, ys)
                        if w > nearest:
                            nearest, best = w, k
                    if best == -1:
                        continue  # a crack between the candidates: the others stand for it
                    hits[best] += 1
                    sum_x[best] += xs
                    sum_y[best] += ys
            total, weight = 0.0, 0
            for k in range(count):
                if hits[k] == 0:
                    continue
                xs, ys, m = sum_x[k] / hits[k], sum_y[k] / hits[k], candidates[k]
                if m == NOTHING:
                    change = sky[1] * xs + sky[2] * ys + sky[3]
                    value = sky[0] + change / math.sqrt(1.0 + xs * xs + ys * ys)
                else:
                    value = _texture(
                        forms, mappings, textures[m], levels, texels, m, xs, ys, steps, row, column
                    ) * _light(forms, lumels, grids, m, xs, ys)
                    if sky[4] > 0.0:
                        w = forms[m, 0, 0] * xs + forms[m, 0, 1] * ys + forms[m, 0, 2]
                        value = sky[0] + (value - sky[0]) * math.exp(-sky[4] / max(w, 1e-9))
                total += hits[k] * value
                weight += hits[k]
            out[row, column] = total / max(weight, 1)
    return out
