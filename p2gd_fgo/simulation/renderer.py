"""From a world, a pose and a lens to a grey image, with the depth of every pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.simulation.raster import NEAREST_M, Float32Array, shade, visibility
from p2gd_fgo.simulation.world import Surfaces, World
from p2gd_fgo.types import FloatArray, Image, IntArray

_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """What the camera sees from one pose.

    Attributes
    ----------
    brightness
        (H, W) 0 to 255, before the sensor.
    inverse_depth
        (H, W) 1/m along the optical axis; 0 is the sky.
    """

    brightness: Float32Array
    inverse_depth: FloatArray


class Renderer:
    """One lens looking at one world.

    The rays of all pixels are computed once, by the camera model's own ``undistort``, so that the
    images have exactly the distortion that the estimator is told.
    """

    def __init__(self, camera: Camera, world: World) -> None:
        self._world = world
        shape = (camera.height, camera.width)
        rows, columns = np.indices(shape, dtype=np.float64)
        rays = camera.undistort(np.stack([columns.ravel(), rows.ravel()], -1)).reshape(*shape, 2)
        self._ray_x, self._ray_y = (np.ascontiguousarray(rays[..., k]) for k in range(2))
        along, down = np.gradient(rays, axis=1), np.gradient(rays, axis=0)
        self._steps = np.ascontiguousarray(np.concatenate([along, down], -1))
        # Widest reach of every column and row, made monotonic, for the search of the boxes.
        self._columns = _reach(rays[..., 0].min(0), rays[..., 0].max(0))
        self._rows = _reach(rays[..., 1].min(1), rays[..., 1].max(1))

    def render(self, T_world_cam: FloatArray) -> Rendering:
        """Render the view from T_world_cam (4, 4)."""
        world = self._world
        surfaces = world.surfaces
        T_cam_world = inverse(T_world_cam)
        forms, boxes = self._project(surfaces, T_cam_world)
        owner, inverse_depth = visibility(self._ray_x, self._ray_y, forms, surfaces.shape, boxes)
        up = T_cam_world[:3, 2] * (world.sky.zenith - world.sky.horizon)
        brightness = shade(
            self._ray_x,
            self._ray_y,
            self._steps,
            owner,
            forms,
            surfaces.shape,
            surfaces.mapping,
            surfaces.texture,
            world.atlas.texels,
            world.atlas.levels,
            world.light.values,
            world.light.grids,
            np.array([world.sky.horizon, *up]),
        )
        return Rendering(brightness, inverse_depth)

    def _project(self, surfaces: Surfaces, T_cam_world: FloatArray) -> tuple[FloatArray, IntArray]:
        """Find the forms 1/t, u/t, v/t (M, 3, 3) and the pixel boxes (M, 4) of the surfaces."""
        seen = surfaces.transformed(T_cam_world)
        o, a, b = seen.corner, seen.edge_u, seen.edge_v
        n, dual_u, dual_v = seen.normals_and_duals()
        height = np.einsum("mi,mi->m", n, o)  # of the camera over the plane, times |n|
        facing = np.abs(height) > 1e-9 * np.linalg.norm(n, axis=1)
        inverse_t = n / np.where(facing, height, 1.0)[:, None]
        forms = np.empty((len(surfaces), 3, 3))
        forms[:, 0] = inverse_t
        for row, dual in ((1, dual_u), (2, dual_v)):
            forms[:, row] = dual - np.einsum("mi,mi->m", dual, o)[:, None] * inverse_t
        boxes = self._boxes(np.stack([o, o + a, o + a + b, o + b], 1))
        boxes[~facing] = 0
        return forms, boxes

    def _boxes(self, corners: FloatArray) -> IntArray:
        """Rows and columns (M, 4) that may see the quads with these corners (M, 4, 3)."""
        start, end = corners[:, _EDGES[:, 0]], corners[:, _EDGES[:, 1]]
        drop = end[..., 2] - start[..., 2]
        crosses = (start[..., 2] < NEAREST_M) != (end[..., 2] < NEAREST_M)
        share = (NEAREST_M - start[..., 2]) / np.where(crosses, drop, 1.0)
        clipped = start + share[..., None] * (end - start)
        points = np.concatenate([corners, clipped], 1)
        seen = np.concatenate([corners[..., 2] >= NEAREST_M, crosses], 1)
        xy = points[..., :2] / np.where(seen, points[..., 2], 1.0)[..., None]
        low = np.where(seen[..., None], xy, np.inf).min(1)
        high = np.where(seen[..., None], xy, -np.inf).max(1)
        boxes = np.empty((len(corners), 4), np.int64)
        for k, (begin, end_) in enumerate((self._rows, self._columns)):
            axis = 1 - k
            boxes[:, 2 * k] = np.searchsorted(end_, low[:, axis], "left")
            boxes[:, 2 * k + 1] = np.searchsorted(begin, high[:, axis], "right")
        return boxes


def _reach(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest ray coordinate of each line, both made non-decreasing and wider."""
    return np.minimum.accumulate(low[::-1])[::-1], np.maximum.accumulate(high)


@dataclass(frozen=True, slots=True)
class SensorModel:
    """From brightness to grey levels.

    Attributes
    ----------
    noise_sigma
        Standard deviation of the noise of each pixel, grey levels.
    vignetting
        Loss of brightness in the corners, 0 to 1; it grows with the square of the radius.
    """

    noise_sigma: float = 2.0
    vignetting: float = 0.15

    def expose(self, brightness: Float32Array, rng: np.random.Generator) -> Image:
        """Grey image (H, W) of a rendering's brightness (H, W)."""
        height, width = brightness.shape
        y = (np.arange(height, dtype=np.float32) / (height - 1) * 2.0 - 1.0)[:, None]
        x = (np.arange(width, dtype=np.float32) / (width - 1) * 2.0 - 1.0)[None, :]
        falloff = 1.0 - np.float32(self.vignetting) * 0.5 * (x * x + y * y)
        noise = rng.standard_normal(brightness.shape, dtype=np.float32)
        values = brightness * falloff + np.float32(self.noise_sigma) * noise
        return np.asarray(np.clip(np.rint(values), 0.0, 255.0), np.uint8)
