"""From a world, a pose and a lens to a grey image, with the depth of every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.simulation.effects import contact_shadows, motion_blur
from p2gd_fgo.simulation.movers import Mover, face_light
from p2gd_fgo.simulation.raster import NEAREST_M, Float32Array, OwnerArray, shade, visibility
from p2gd_fgo.simulation.world import Surfaces, World, concatenate
from p2gd_fgo.types import FloatArray, Image, IntArray

_LEAST_PX = 0.5  # smaller surfaces are left out
_SHADOW, _SHADOW_M = 0.5, 0.7  # of a body on the ground: depth and reach
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
    mover
        (H, W) index of the moving body that is seen, −1 for everything else.
    """

    brightness: Float32Array
    inverse_depth: FloatArray
    mover: OwnerArray

    def mask(self) -> Image:
        """Mask (H, W): 0 on moving bodies and a pixel around them, 255 elsewhere."""
        still = np.where(self.mover >= 0, 0, 255).astype(np.uint8)
        return np.asarray(cv2.erode(still, np.ones((3, 3), np.uint8)), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """The camera's motion while the shutter is open.

    Attributes
    ----------
    seconds
        Shutter time, around the time of the pose.
    velocity
        (3,) of the camera in the world, m/s.
    angular_rate
        (3,) in the camera's frame, rad/s.
    """

    seconds: float
    velocity: FloatArray
    angular_rate: FloatArray


class Renderer:
    """One lens looking at one world.

    The rays of all pixels are computed once, by the camera model's own ``undistort``, so that the
    images have exactly the distortion that the estimator is told.

    Parameters
    ----------
    movers
        Bodies that move through the world.
    """

    def __init__(self, camera: Camera, world: World, movers: Sequence[Mover] = ()) -> None:
        self._world = world
        self._movers = tuple(movers)
        shape = (camera.height, camera.width)
        rows, columns = np.indices(shape, dtype=np.float64)
        rays = camera.undistort(np.stack([columns.ravel(), rows.ravel()], -1)).reshape(*shape, 2)
        self._ray_x, self._ray_y = (np.ascontiguousarray(rays[..., k]) for k in range(2))
        along, down = np.gradient(rays, axis=1), np.gradient(rays, axis=0)
        self._steps = np.ascontiguousarray(np.concatenate([along, down], -1))
        # Widest reach of every column and row, made monotonic, for the search of the boxes.
        self._columns = _reach(rays[..., 0].min(0), rays[..., 0].max(0))
        self._rows = _reach(rays[..., 1].min(1), rays[..., 1].max(1))
        self._tangents = np.array(
            [rays[..., 0].min(), rays[..., 0].max(), rays[..., 1].min(), rays[..., 1].max()]
        )
        self._px_per_rad = float(max(camera.fx, camera.fy))
        surfaces = world.surfaces
        self._middle = surfaces.corner + 0.5 * (surfaces.edge_u + surfaces.edge_v)
        diagonals = np.stack([surfaces.edge_u + surfaces.edge_v, surfaces.edge_u - surfaces.edge_v])
        self._radius = 0.5 * np.linalg.norm(diagonals, axis=2).max(0)
        # The faces of bodies get their light anew in every image, behind that of the world.
        faces = sum(len(mover.surfaces) for mover in self._movers)
        self._pool = len(world.light.values)
        self._lumels = np.concatenate([world.light.values, np.zeros(faces, np.float32)])

    def render(
        self, T_world_cam: FloatArray, time_s: float = 0.0, exposure: Exposure | None = None
    ) -> Rendering:
        """Render the view from T_world_cam (4, 4).

        Parameters
        ----------
        time_s
            Of the movers.
        exposure
            For motion blur; None: an instant.
        """
        world = self._world
        T_cam_world = inverse(T_world_cam)
        seen = self._in_view(T_cam_world)
        surfaces, grids = world.surfaces.subset(seen), world.light.grids[seen]
        still = len(surfaces)
        present = [(k, T) for k, m in enumerate(self._movers) if (T := m.pose(time_s)) is not None]
        if present:
            surfaces, grids = self._with_bodies(surfaces, grids, present)
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
            self._lumels,
            grids,
            np.array([world.sky.horizon, *up, world.sky.haze_per_m]),
        )
        body_of = np.full(len(surfaces) + 1, -1, np.int32)  # the last entry stands for the sky
        first = still
        for k, _ in present:
            last = first + len(self._movers[k].surfaces)
            body_of[first:last] = k
            first = last
        rendering = Rendering(brightness, inverse_depth, body_of[owner])
        if present:
            self._shadow(rendering, T_world_cam, present)
        if exposure is None or exposure.seconds <= 0.0:
            return rendering
        return replace(rendering, brightness=self._blur(rendering, T_world_cam, time_s, exposure))

    def inverse_depth(self, T_world_cam: FloatArray) -> FloatArray:
        """Inverse depth (H, W) of the standing world, 1/m, without shading."""
        T_cam_world = inverse(T_world_cam)
        surfaces = self._world.surfaces.subset(self._in_view(T_cam_world))
        forms, boxes = self._project(surfaces, T_cam_world)
        return visibility(self._ray_x, self._ray_y, forms, surfaces.shape, boxes)[1]

    def _in_view(self, T_cam_world: FloatArray) -> IntArray:
        """Indices of the surfaces that may be seen: bounding spheres that meet the frustum."""
        p = self._middle @ T_cam_world[:3, :3].T + T_cam_world[:3, 3]
        x, y, z = p.T
        reach = self._radius
        left, right, top, bottom = self._tangents
        seen = z > -reach
        for tangent, axis, sign in ((left, x, 1), (right, x, -1), (top, y, 1), (bottom, y, -1)):
            seen &= sign * (axis - tangent * z) > -reach * np.sqrt(1.0 + tangent * tangent)
        # Leaves and the like that fill less than half a pixel.
        seen &= 2.0 * reach * self._px_per_rad > _LEAST_PX * z
        return np.flatnonzero(seen)

    def _with_bodies(
        self, surfaces: Surfaces, grids: IntArray, present: list[tuple[int, FloatArray]]
    ) -> tuple[Surfaces, IntArray]:
        """Add the faces of bodies at T_world_body, and light them."""
        bodies = [self._movers[k].surfaces.transformed(T) for k, T in present]
        sun, ambient = np.asarray(self._world.sun), self._world.ambient
        light = np.concatenate([face_light(body, sun, ambient) for body in bodies])
        self._lumels[self._pool : self._pool + len(light)] = light
        pool = np.ones((len(light), 3), np.int64)
        pool[:, 0] = self._pool + np.arange(len(light))
        return concatenate([surfaces, *bodies]), np.vstack([grids, pool])

    def _shadow(
        self, rendering: Rendering, T_world_cam: FloatArray, present: list[tuple[int, FloatArray]]
    ) -> None:
        feet, corners = [], []
        for k, T in present:
            length, width, _ = self._movers[k].size
            feet.append([T[0, 3], T[1, 3], T[0, 0], T[1, 0], 0.5 * length, 0.5 * width])
            around = 0.5 * np.array([length, width]) + _SHADOW_M
            corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * around
            corners.append(np.column_stack([corner, np.zeros(4)]) @ T[:3, :3].T + T[:3, 3])
        seen = np.array(corners) @ T_world_cam[:3, :3]
        seen -= T_world_cam[:3, 3] @ T_world_cam[:3, :3]
        contact_shadows(
            rendering.brightness,
            rendering.inverse_depth,
            self._ray_x,
            self._ray_y,
            rendering.mover,
            T_world_cam,
            self._world.ground_z,
            np.array(feet),
            self._boxes(seen),
            _SHADOW,
        )

    def _blur(
        self, rendering: Rendering, T_world_cam: FloatArray, time_s: float, exposure: Exposure
    ) -> Float32Array:
        R_cam_world = T_world_cam[:3, :3].T
        motions = np.zeros((len(self._movers) + 1, 6))
        motions[:, :3] = -R_cam_world @ exposure.velocity
        motions[:, 3:] = -exposure.angular_rate
        for k, mover in enumerate(self._movers):
            motions[k + 1, :3] += R_cam_world @ mover.velocity(time_s)
        return motion_blur(
            rendering.brightness,
            rendering.inverse_depth,
            self._ray_x,
            self._ray_y,
            self._steps,
            rendering.mover,
            motions,
            exposure.seconds,
        )

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
    shot_noise
        Variance that each grey level of light adds.
    """

    noise_sigma: float = 2.0
    vignetting: float = 0.15
    shot_noise: float = 0.0

    def expose(
        self, brightness: Float32Array, rng: np.random.Generator, gain: float = 1.0
    ) -> Image:
        """Grey image (H, W) of a rendering's brightness (H, W), times ``gain``."""
        height, width = brightness.shape
        y = (np.arange(height, dtype=np.float32) / (height - 1) * 2.0 - 1.0)[:, None]
        x = (np.arange(width, dtype=np.float32) / (width - 1) * 2.0 - 1.0)[None, :]
        falloff = 1.0 - np.float32(self.vignetting) * 0.5 * (x * x + y * y)
        noise = rng.standard_normal(brightness.shape, dtype=np.float32)
        light = brightness * falloff * np.float32(gain)
        sigma: np.float32 | Float32Array = np.float32(self.noise_sigma)
        if self.shot_noise > 0.0:
            variance = np.float32(self.noise_sigma) ** 2 + np.float32(self.shot_noise) * light
            sigma = np.sqrt(np.maximum(variance, 0.0))
        values = light + sigma * noise
        return np.asarray(np.clip(np.rint(values), 0.0, 255.0), np.uint8)
