"""Rigid things that move through a world: where they are at any time, and how bright."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.simulation.world import Surfaces
from p2gd_fgo.types import FloatArray

_SKY_UP, _SKY_ASIDE = 0.78, 0.66  # light from the sky on level and on upright faces


@dataclass(frozen=True, slots=True, eq=False)
class Mover:
    """A body that follows a path on the ground, absent outside the path's times.

    Attributes
    ----------
    surfaces
        In the body's frame: x forward, y left, z up from the ground.
    size
        Length along x, width along y and height, m.
    times_s
        (K,) increasing, K ≥ 2.
    places
        (K, 3) x, y in the world and yaw, rad, without jumps of 2π.
    ground_z
        Height of the ground in the world.
    """

    surfaces: Surfaces
    size: tuple[float, float, float]
    times_s: FloatArray
    places: FloatArray
    ground_z: float

    def place(self, time_s: float) -> FloatArray | None:
        """Find x, y and yaw (3,) at a time; None: not there."""
        if not self.times_s[0] <= time_s <= self.times_s[-1]:
            return None
        return np.array([np.interp(time_s, self.times_s, column) for column in self.places.T])

    def pose(self, time_s: float) -> FloatArray | None:
        """Find T_world_body (4, 4) at a time; None: not there."""
        place = self.place(time_s)
        if place is None:
            return None
        c, s = np.cos(place[2]), np.sin(place[2])
        T = np.eye(4)
        T[:2, :2] = [[c, -s], [s, c]]
        T[:3, 3] = place[0], place[1], self.ground_z
        return T

    def velocity(self, time_s: float, step_s: float = 0.02) -> FloatArray:
        """Velocity (3,) in the world, m/s, zero where it isn't there."""
        before, after = self.place(time_s - step_s), self.place(time_s + step_s)
        if before is None or after is None:
            return np.zeros(3)
        return np.append((after - before)[:2] / (2.0 * step_s), 0.0)


def face_light(surfaces: Surfaces, sun: FloatArray, ambient: float) -> FloatArray:
    """Light on each face (M,) of a body in the open, its gain included.

    Parameters
    ----------
    surfaces
        In the world.
    sun
        (3,) towards the sun, its length the sun's strength.
    ambient
        Factor on the sky's light.
    """
    n, _, _ = surfaces.normals_and_duals()
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    center = surfaces.corner + 0.5 * (surfaces.edge_u + surfaces.edge_v)
    outwards = np.einsum("mi,mi->m", n, center - center.mean(0))
    n = np.where(outwards[:, None] < 0.0, -n, n)
    sky = ambient * np.where(np.abs(n[:, 2]) > 0.5, _SKY_UP, _SKY_ASIDE)
    return np.asarray(surfaces.gain * (sky + np.clip(n @ sun, 0.0, None)))
