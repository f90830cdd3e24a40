"""P2GD: predict, weigh, allocate (paper III-B)."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import P2gdConfig
from p2gd_fgo.distribution.base import Decision, DistributionContext, Explanation
from p2gd_fgo.distribution.grid import GridDistribution
from p2gd_fgo.distribution.p2gd.allocate import evenly, proportional
from p2gd_fgo.distribution.p2gd.d_optimal import d_optimal, first_gains
from p2gd_fgo.distribution.p2gd.edges import image_motion_px, newly_seen_cells
from p2gd_fgo.distribution.p2gd.information import (
    Sensors,
    cell_information,
    imu_information,
    pose_information,
)
from p2gd_fgo.distribution.p2gd.predict import PredictedTracks, predict_tracks, predicted_cameras
from p2gd_fgo.distribution.p2gd.scene import Scene
from p2gd_fgo.distribution.p2gd.weigh import cell_means, total_parallax, track_length
from p2gd_fgo.frontend import CellGrid, CellQuotas
from p2gd_fgo.frontend.detector import pixel_values
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import NANOSECONDS, FloatArray, IntArray, PriorPoses


class P2gd:
    """Gives each cell features by how well the prior poses let them be tracked there.

    Parameters
    ----------
    config
        Weight, allocation, options; resolved.
    baseline
        Its quotas hold before the start, and whenever the prior poses can't be used.
    grid
        The cells.
    max_features
        To be spread.
    sensors
        For ``d_optimal``: how well the IMU and a feature measure.
    """

    def __init__(
        self,
        config: P2gdConfig,
        baseline: GridDistribution,
        grid: CellGrid,
        max_features: int,
        sensors: Sensors,
    ) -> None:
        self._config = config
        self._baseline = baseline
        self._grid = grid
        self._max_features = max_features
        self._sensors = sensors
        self._scene = Scene(config.scene)

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        even = self._baseline.quotas(context.capacity)
        if len(context.recent) == 0:
            return Decision(CellQuotas(even))
        scene, camera, T_imu_cam = self._scene, context.camera, context.T_imu_cam
        kept = scene.update(context.buffer, context.recent, T_imu_cam, camera)
        priors, T_imu0_imu = context.priors, np.zeros((0, 4, 4))
        if isinstance(priors, PriorPoses):
            T_imu0_imu, problem = priors.T_imu0_imu, None
        else:
            problem = priors
        cameras = predicted_cameras(context.recent.T_world_imu[-1], T_imu0_imu, T_imu_cam)
        tracks = predict_tracks(scene.points, cameras, camera)
        here = tracks.visible[:, 0]
        if context.allowed is not None:
            here = here & pixel_values(context.allowed, np.nan_to_num(tracks.pixels[:, 0]))
        points, tracks, kept = scene.points[here], tracks.part(here), kept[here]
        scene.keep(here)
        if len(T_imu0_imu) == 0:  # no usable priors, or the recording's last image
            return Decision(CellQuotas(even), problem=problem)

        values = self._worth(points, tracks)
        weights, quotas = self._allocated(context, even, points, tracks, values)
        if not weights.any() or self._is_still(points, tracks, camera):
            quotas = even
        scene.keep(tracks.visible[:, 1])  # paper III-C2: not seen in the first predicted camera
        lengths = tracks.lengths
        return Decision(
            CellQuotas(quotas),
            explanation=Explanation(
                points, kept, cameras, tracks.pixels, lengths, values, weights, quotas
            ),
        )

    def _worth(self, points: FloatArray, tracks: PredictedTracks) -> FloatArray:
        if self._config.weight == "track_length":
            return track_length(tracks)
        return total_parallax(points, tracks, into_loss=self._config.into_loss)

    def _allocated(
        self,
        context: DistributionContext,
        even: IntArray,
        points: FloatArray,
        tracks: PredictedTracks,
        values: FloatArray,
    ) -> tuple[FloatArray, IntArray]:
        """Weights and quotas (rows, columns): what is set aside for some cells, and the rest."""
        shape = self._grid.shape
        cells = self._grid.cell_of(tracks.pixels[:, 0])
        aside = np.minimum(self._set_aside(context, even), context.capacity)
        room, left = context.capacity - aside, self._max_features - int(aside.sum())
        if self._config.allocate == "proportional":
            weights = cell_means(values, cells, shape)
            quotas = proportional(weights.ravel(), room.ravel(), left)
            return weights, aside + quotas.reshape(shape)

        camera, sensors = context.camera, self._sensors
        sigma = sensors.pixel_noise_px / np.sqrt(camera.fx * camera.fy)
        each = pose_information(points, tracks.T_world_cam, tracks.visible, sigma)
        information = cell_information(each, cells, room.size)
        assert isinstance(context.priors, PriorPoses)
        horizon_ns = int(context.priors.stamps_ns[-1] - context.recent.stamps_ns[-1])
        known = imu_information(sensors.noise, horizon_ns / NANOSECONDS, sensors.gravity)
        known += np.tensordot(aside.ravel(), information, axes=1)
        quotas = d_optimal(information, known, room.ravel(), left)
        quotas = evenly(quotas, room.ravel(), left - int(quotas.sum()), first=quotas == 0)
        return first_gains(information, known).reshape(shape), aside + quotas.reshape(shape)

    def _set_aside(self, context: DistributionContext, even: IntArray) -> IntArray:
        """Features (rows, columns) that cells get whatever their weight."""
        out = np.zeros_like(even)
        if self._config.floor > 0.0:
            share = np.ceil(self._config.floor * even).astype(np.int64)
            out = np.where(context.corners > 0, share, 0)
        if self._config.share_new_cells:
            new = newly_seen_cells(self._grid, context, self._config.scene.min_views)
            out = np.where(new, np.maximum(even, out), out)
        return out

    def _is_still(self, points: FloatArray, tracks: PredictedTracks, camera: Camera) -> bool:
        threshold = self._config.still_parallax_px
        return threshold > 0.0 and image_motion_px(points, tracks, camera) < threshold
