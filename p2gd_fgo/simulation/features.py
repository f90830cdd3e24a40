"""Feature tracks without images: landmarks along a route, seen, lost and found again.

Estimators are tested on these: noise and outliers are exactly what they are said to be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.simulation.trajectory import SplineTrajectory
from p2gd_fgo.types import BoolArray, FloatArray, IntArray, Observations

Unhidden = Callable[[FloatArray, FloatArray], BoolArray]


@dataclass(frozen=True, slots=True)
class FeatureModel:
    """How many features there are, and how they behave.

    Attributes
    ----------
    landmarks_per_m
        Density along the path; a standing start has 50 m worth of them ahead.
    side_m, height_m
        Nearest and farthest distance from the path, lowest and highest above the ground (the
        ground lies ``camera_height_m`` below the IMU).
    ground_share
        Share of the landmarks that lie on the ground, anywhere between the sides.
    max_range_m
        Farther landmarks are not seen.
    features
        Tracked at once.
    survival
        Chance of a track to go on to the next image.
    max_track_length
        A longer track ends and its landmark may start a new one.
    pixel_noise_px
        1 sigma.
    outlier_share
        Share of tracks that slide off their landmark in their first images, by up to 50 px an axis.
    """

    landmarks_per_m: float = 20.0
    side_m: tuple[float, float] = (4.0, 30.0)
    height_m: tuple[float, float] = (0.0, 8.0)
    ground_share: float = 0.3
    camera_height_m: float = 1.5
    max_range_m: float = 120.0
    features: int = 150
    survival: float = 0.92
    max_track_length: int = 20
    pixel_noise_px: float = 1.0
    outlier_share: float = 0.0


CAR_FEATURES = FeatureModel(landmarks_per_m=12.0, features=180, survival=0.85)
ROBOT_FEATURES = FeatureModel(
    landmarks_per_m=60.0, side_m=(2.0, 15.0), height_m=(0.0, 5.0), camera_height_m=0.6,
    max_range_m=50.0,
)  # fmt: skip


def scatter_landmarks(
    trajectory: SplineTrajectory, model: FeatureModel, rng: np.random.Generator
) -> FloatArray:
    """Landmarks (M, 3) in the world along both sides of the route and on its ground."""
    first, last = trajectory.span_ns
    stamps = first + np.linspace(0, last - first, 2000).astype(np.int64)
    T = trajectory.sample(stamps).T_world_imu
    position = T[:, :3, 3]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    heading = np.arctan2(T[:, 1, 0], T[:, 0, 0])
    beyond = 50.0
    count = int(model.landmarks_per_m * (arc[-1] + beyond))
    s = rng.uniform(0.0, arc[-1] + beyond, count)
    along = np.minimum(s, arc[-1])
    index = np.minimum(np.searchsorted(arc, along), len(arc) - 1)
    near, far = model.side_m
    on_ground = rng.random(count) < model.ground_share
    side = rng.choice([-1.0, 1.0], count) * rng.uniform(np.where(on_ground, 0.0, near), far)
    direction = np.stack([np.cos(heading[index]), np.sin(heading[index])], -1)
    normal = np.stack([-direction[:, 1], direction[:, 0]], -1)
    xy = position[index, :2] + direction * (s - along)[:, None] + normal * side[:, None]
    height = np.where(on_ground, 0.0, rng.uniform(*model.height_m, count))
    return np.column_stack([xy, height - model.camera_height_m])


def simulate_features(
    trajectory: SplineTrajectory,
    image_stamps_ns: IntArray,
    camera: Camera,
    T_imu_cam: FloatArray,
    model: FeatureModel,
    rng: np.random.Generator,
    *,
    landmarks: FloatArray | None = None,
    unhidden: Unhidden | None = None,
) -> list[Observations]:
    """One :class:`Observations` per image; ids are unique per track.

    Parameters
    ----------
    landmarks
        (M, 3) in the world; None: :func:`scatter_landmarks`.
    unhidden
        Says of T_world_cam (4, 4) and points (N, 3) in view which (N,) nothing stands before;
        None: nothing ever does.
    """
    if landmarks is None:
        landmarks = scatter_landmarks(trajectory, model, rng)
    T_world_cam = trajectory.sample(image_stamps_ns).T_world_imu @ T_imu_cam
    track_of = np.full(len(landmarks), -1, dtype=np.int64)  # track id of each landmark, or -1
    length = np.zeros(len(landmarks), dtype=np.int64)
    drift = np.zeros((len(landmarks), 2))
    next_id = 0
    frames = []
    for stamp, T in zip(image_stamps_ns.tolist(), T_world_cam, strict=True):
        seen, pixels = _see(landmarks, inverse(T), camera, model.max_range_m)
        if unhidden is not None:
            seen[seen] = unhidden(T, landmarks[seen])
        tracked = track_of >= 0
        ends = ~seen | (rng.random(len(landmarks)) > model.survival)
        ends |= length >= model.max_track_length
        track_of[tracked & ends] = -1
        free = np.flatnonzero(seen & (track_of < 0) & ~tracked)
        wanted = min(model.features - int((track_of >= 0).sum()), len(free))
        new = rng.permutation(free)[: max(wanted, 0)]
        track_of[new] = next_id + np.arange(len(new))
        next_id += len(new)
        length[new] = 0
        drift[new] = 0.0
        strays = new[rng.random(len(new)) < model.outlier_share]
        drift[strays] = rng.uniform(-50.0, 50.0, (len(strays), 2)) / 5.0
        current = np.flatnonzero(track_of >= 0)
        length[current] += 1
        # A stray slides off its landmark over five images and then stays 50 px away at most.
        offset = drift[current] * np.minimum(length[current] - 1, 5)[:, None]
        noise = model.pixel_noise_px * rng.standard_normal((len(current), 2))
        z = pixels[current] + offset + noise
        frames.append(Observations(stamp, track_of[current].copy(), z, camera.undistort(z)))
    return frames


def _see(
    landmarks: FloatArray, T_cam_world: FloatArray, camera: Camera, max_range_m: float
) -> tuple[np.ndarray[tuple[int], np.dtype[np.bool_]], FloatArray]:
    """Which landmarks are in view, and the pixels (M, 2) of those."""
    points = landmarks @ T_cam_world[:3, :3].T + T_cam_world[:3, 3]
    ahead = (points[:, 2] > 0.5) & (points[:, 2] < max_range_m)
    pixels = np.zeros((len(landmarks), 2))
    seen = np.zeros(len(landmarks), dtype=bool)
    index = np.flatnonzero(ahead)
    pixels[index] = camera.project(points[index])
    seen[index] = camera.visible(points[index], pixels[index])
    return seen, pixels
