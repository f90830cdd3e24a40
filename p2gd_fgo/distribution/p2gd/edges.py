"""Where the prediction knows nothing: standing still, and what a turn brings into view."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.distribution.base import DistributionContext
from p2gd_fgo.distribution.p2gd.predict import PredictedTracks
from p2gd_fgo.distribution.p2gd.weigh import total_parallax
from p2gd_fgo.frontend import CellGrid
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import BoolArray, FloatArray


def image_motion_px(points: FloatArray, tracks: PredictedTracks, camera: Camera) -> float:
    """Mean predicted parallax per image and point, in px; infinite where nothing is predicted.

    Parameters
    ----------
    points
        (P, 3) in the world.
    tracks
        Of these points.
    camera
        For the size of a pixel.
    """
    images = int(tracks.lengths.sum())
    if images == 0:
        return float("inf")
    angle = float(total_parallax(points, tracks).sum()) / images
    return angle * float(np.sqrt(camera.fx * camera.fy))


def newly_seen_cells(grid: CellGrid, context: DistributionContext, images: int) -> BoolArray:
    """Cells (rows, columns) whose centre was outside the image ``images`` images ago.

    The scene is taken as far away, so only the rotation counts; what came into view since then
    can't have been triangulated yet. None where the window doesn't reach back that far.
    """
    if len(context.recent) <= images:
        return np.zeros(grid.shape, np.bool_)
    row, column = np.divmod(np.arange(grid.rows * grid.columns), grid.columns)
    centres = np.column_stack(
        [(column + 0.5) * grid.width / grid.columns, (row + 0.5) * grid.height / grid.rows]
    )
    rays = np.ones((len(centres), 3))
    rays[:, :2] = context.camera.undistort(centres)
    poses = context.recent.T_world_imu[[-1 - images, -1]] @ context.T_imu_cam
    R_then_now = poses[0, :3, :3].T @ poses[1, :3, :3]
    return np.asarray(~context.camera.visible(rays @ R_then_now.T).reshape(grid.shape))
