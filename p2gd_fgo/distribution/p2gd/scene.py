"""The sparse 3-D scene: triangulated features (paper III-B1, III-C2)."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.config import SceneConfig
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.geometry.camera_base import MIN_DEPTH
from p2gd_fgo.geometry.triangulation import acceptable, triangulate
from p2gd_fgo.types import BoolArray, FloatArray, IntArray, Trajectory


class Scene:
    """The 3-D points that are known now.

    Attributes
    ----------
    ids
        (P,) of the tracks.
    points
        (P, 3) in the world.
    firm
        (P,) seen from so many views that the position is kept as it is.
    outlived
        (P,) the track ended at its maximum length; the point stays as part of the scene.
    """

    def __init__(self, config: SceneConfig) -> None:
        self._config = config
        self.ids: IntArray = np.zeros(0, np.int64)
        self.points: FloatArray = np.zeros((0, 3))
        self.firm: BoolArray = np.zeros(0, np.bool_)
        self.outlived: BoolArray = np.zeros(0, np.bool_)
        self._full: BoolArray = np.zeros(0, np.bool_)

    def __len__(self) -> int:
        return len(self.ids)

    def update(
        self, buffer: FeatureBuffer, recent: Trajectory, T_imu_cam: FloatArray, camera: Camera
    ) -> BoolArray:
        """Triangulate what the newest image tells.

        Points of lost tracks go, those of complete tracks stay, those known firmly are not
        computed again.

        Parameters
        ----------
        buffer
            The features and their sightings.
        recent
            Estimated poses at (some of) the buffer's images.
        T_imu_cam
            (4, 4).
        camera
            For the size of a pixel.

        Returns
        -------
        BoolArray
            (P,) whether the position was kept, not computed now.
        """
        row = _rows_of(self.ids, buffer.ids)
        self.outlived |= (row < 0) & self._full
        keep = self.outlived | (self.firm & (row >= 0))
        self.keep(keep)
        row = row[keep]

        config = self._config
        columns, poses = _common(buffer.stamps_ns, recent)
        wanted = buffer.lengths >= config.min_views
        wanted[row[row >= 0]] = False
        new = np.flatnonzero(wanted)
        found = triangulate(buffer.normalized_history[new[:, None], columns], poses @ T_imu_cam)
        # A pixel's side on the plane z = 1, there where the newest image has the feature.
        area = np.linalg.det(camera.distort_jacobian(buffer.normalized[new]))
        pixel = 1.0 / np.sqrt(np.where(area > 0.0, area, np.inf))
        good = acceptable(
            found,
            min_views=config.min_views,
            max_condition=config.max_condition,
            min_depth=MIN_DEPTH,
            max_depth=config.max_depth,
            max_residual=config.max_reprojection_px * pixel,
        )
        new = new[good]
        kept = len(self)
        row = np.concatenate([row, new])
        self.ids = np.concatenate([self.ids, buffer.ids[new]])
        self.points = np.concatenate([self.points, found.points[good]])
        self.firm = np.concatenate([self.firm, found.views[good] > config.keep_after_views])
        self.outlived = np.concatenate([self.outlived, np.zeros(len(new), np.bool_)])
        tracked = row >= 0
        self._full = tracked.copy()
        self._full[tracked] = buffer.lengths[row[tracked]] >= buffer.history
        return np.arange(len(self)) < kept

    def keep(self, which: BoolArray) -> None:
        """Forget the points whose entry in which (P,) is false."""
        self.ids, self.points = self.ids[which], self.points[which]
        self.firm, self.outlived = self.firm[which], self.outlived[which]
        self._full = self._full[which]


def _rows_of(ids: IntArray, among: IntArray) -> IntArray:
    """Index (P,) of each of ids (P,) in ``among`` (N,), -1 where it isn't there."""
    if len(among) == 0:
        return np.full(len(ids), -1, np.int64)
    order = np.argsort(among)
    place = np.minimum(np.searchsorted(among, ids, sorter=order), len(among) - 1)
    row = order[place]
    return np.where(among[row] == ids, row, -1)


def _common(stamps_ns: IntArray, recent: Trajectory) -> tuple[IntArray, FloatArray]:
    """Columns of the buffer (V,) that have an estimated pose, and these poses (V, 4, 4)."""
    row = _rows_of(stamps_ns, recent.stamps_ns)
    columns = np.flatnonzero(row >= 0)
    return columns, recent.T_world_imu[row[columns]]
