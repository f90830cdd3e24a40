"""What a camera can see: flat textured patches in arrays, their light, and the sky."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from p2gd_fgo.simulation.raster import RECTANGLE, Float32Array
from p2gd_fgo.simulation.textures import TextureAtlas
from p2gd_fgo.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """M flat patches, visible from both sides: corner + u edge_u + v edge_v, 0 ≤ u, v ≤ 1.

    Attributes
    ----------
    corner, edge_u, edge_v
        (M, 3) m, in one frame.
    shape
        (M,) ``RECTANGLE`` (any parallelogram), ``TRIANGLE`` (the half with u + v ≤ 1) or ``DISC``
        (the inscribed ellipse).
    texture
        (M,) index into the atlas.
    mapping
        (M, 4) texture coordinates in repeats: s = m₀u + m₂, t = m₁v + m₃.
    gain
        (M,) factor on the texture's brightness.
    """

    corner: FloatArray
    edge_u: FloatArray
    edge_v: FloatArray
    shape: IntArray
    texture: IntArray
    mapping: FloatArray
    gain: FloatArray

    def __len__(self) -> int:
        return len(self.corner)

    @property
    def size_m(self) -> FloatArray:
        """(M, 2) lengths of the edges."""
        return np.stack(
            [np.linalg.norm(self.edge_u, axis=1), np.linalg.norm(self.edge_v, axis=1)], -1
        )

    def normals_and_duals(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find the normals edge_u x edge_v and the vectors that read u, v off a point, (M, 3) each.

        For p on the patch, u = dual_u · (p − corner) and v = dual_v · (p − corner).
        """
        n = np.cross(self.edge_u, self.edge_v)
        squared = np.einsum("mi,mi->m", n, n)[:, None]
        return n, np.cross(self.edge_v, n) / squared, np.cross(n, self.edge_u) / squared

    def subset(self, index: IntArray) -> Surfaces:
        """Take the patches at index (N,)."""
        return Surfaces(**{f.name: getattr(self, f.name)[index] for f in fields(Surfaces)})

    def transformed(self, T_a_b: FloatArray) -> Surfaces:
        """Express patches of frame b in frame a, T_a_b (4, 4): a body that moves, at one time."""
        R, p = T_a_b[:3, :3], T_a_b[:3, 3]
        return replace(
            self,
            corner=self.corner @ R.T + p,
            edge_u=self.edge_u @ R.T,
            edge_v=self.edge_v @ R.T,
        )


@dataclass(frozen=True, slots=True, eq=False)
class LightMaps:
    """Light that falls on each of M surfaces, a small grid for each.

    Attributes
    ----------
    values
        Concatenated grids, rows along v: the factor on the texture's brightness.
    grids
        (M, 3) offset into ``values``, columns (along u), rows (along v).
    """

    values: Float32Array
    grids: IntArray

    @classmethod
    def uniform(cls, count: int) -> LightMaps:
        """Shine the same light, 1, on ``count`` surfaces."""
        return cls(np.ones(1, np.float32), np.tile(np.array([[0, 1, 1]]), (count, 1)))


@dataclass(frozen=True, slots=True)
class Sky:
    """Brightness, 0 to 255, at the horizon and at the zenith; the sine of elevation between.

    ``haze_per_m`` is the extinction that lets far things fade into the horizon.
    """

    horizon: float = 205.0
    zenith: float = 165.0
    haze_per_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """A static scene, z up, and the light that falls on what moves through it.

    Attributes
    ----------
    sun
        (3,) towards the sun, its length the brightness that it adds.
    ambient
        Factor on the sky's light.
    ground_z
        Height of the ground.
    """

    surfaces: Surfaces
    light: LightMaps
    atlas: TextureAtlas
    sky: Sky
    sun: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ambient: float = 1.0
    ground_z: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How patches are covered.

    Attributes
    ----------
    texture
        Index into the atlas, or one for each patch.
    repeat_m
        Size of the texture in the world; None: stretched once over the patch.
    offset
        (2,) or (M, 2) shift of the texture, in repeats.
    gain
        Factor on the brightness, or one for each patch.
    shape
        ``RECTANGLE``, ``TRIANGLE`` or ``DISC``.
    """

    texture: int | IntArray
    repeat_m: tuple[float, float] | None = None
    offset: ArrayLike = (0.0, 0.0)
    gain: float | FloatArray = 1.0
    shape: int = RECTANGLE


def concatenate(parts: Sequence[Surfaces]) -> Surfaces:
    """All patches of ``parts``, in order."""
    return Surfaces(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Surfaces)}
    )


def patches(corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, look: Look) -> Surfaces:
    """Patches with one look; corner and edges (3,) or (M, 3) each."""
    o, u, v = np.broadcast_arrays(
        *(np.atleast_2d(np.asarray(a, np.float64)) for a in (corner, edge_u, edge_v))
    )
    m = len(o)
    lengths = np.stack([np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)], -1)
    scale = np.ones_like(lengths) if look.repeat_m is None else lengths / np.array(look.repeat_m)
    shift = np.broadcast_to(np.asarray(look.offset, np.float64), (m, 2))
    return Surfaces(
        o,
        u,
        v,
        np.full(m, look.shape),
        np.broadcast_to(np.asarray(look.texture, np.int64), (m,)),
        np.hstack([scale, shift]),
        np.broadcast_to(np.asarray(look.gain, np.float64), (m,)),
    )


def box(center: ArrayLike, size: ArrayLike, yaw: float, look: Look) -> Surfaces:
    """Four sides and the top of an upright box.

    Parameters
    ----------
    center
        (3,) of the bottom face.
    size
        (3,) along the box's x, y and z.
    yaw
        Of the box's x axis, rad.
    """
    c, (sx, sy, sz) = np.asarray(center, np.float64), np.asarray(size, np.float64)
    ex = np.array([np.cos(yaw), np.sin(yaw), 0.0]) * sx
    ey = np.array([-np.sin(yaw), np.cos(yaw), 0.0]) * sy
    ez = np.array([0.0, 0.0, sz])
    corners = c + 0.5 * np.array([-ex - ey, ex - ey, ex + ey, ey - ex])
    sides = patches(corners, np.array([ex, ey, -ex, -ey]), ez, look)
    return concatenate([sides, patches(corners[0] + ez, ex, ey, look)])


def prism(
    center: ArrayLike, radius: float, height: float, look: Look, *, sides: int = 8
) -> Surfaces:
    """Build the mantle of an upright prism (pole, trunk, bin); ``center`` (3,) of its bottom."""
    angles = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], -1) * radius
    ring += np.asarray(center, np.float64)
    around = np.stack([np.arange(sides) / sides, np.zeros(sides)], -1)
    look = replace(look, offset=np.asarray(look.offset) + around)
    return patches(ring[:-1], np.diff(ring, axis=0), [0.0, 0.0, height], look)
