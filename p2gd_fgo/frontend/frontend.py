"""The front end: track, reject, extract (paper III-A, III-C2)."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np

from p2gd_fgo.config import FrontendConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.frontend.anchors import AnchorPatches
from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.frontend.detector import CornerDetector, pixel_values
from p2gd_fgo.frontend.features import FeatureBuffer
from p2gd_fgo.frontend.health import ImageHealth, ImageWatch
from p2gd_fgo.frontend.orb import OrbTracker
from p2gd_fgo.frontend.outliers import motion_inliers
from p2gd_fgo.frontend.selection import Selection
from p2gd_fgo.frontend.track_summary import TrackSummary
from p2gd_fgo.frontend.tracker import Flow, KltTracker, Tracker
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import BoolArray, FloatArray, Image, IntArray, Observations

_THRESHOLD_OFFSETS = (0, 1, -1)  # of the FAST threshold, by seed modulo 3
_MIN_DEPTH = 1e-2  # of a rotated unit-depth ray; beyond, there is no prediction

T = TypeVar("T")


class Frontend:
    """Tracks features from image to image and finds new ones where a selection asks for them.

    Per image: :meth:`track`, then the caller decides on a selection, :meth:`extract`, then
    :meth:`observations`.

    Parameters
    ----------
    camera
        Intrinsics and distortion.
    config
        Resolved: no field is None.
    seed
        Varies what a rerun would vary: the FAST threshold by at most 1, and the order of the
        points before RANSAC. The same seed on the same images gives the same features.
    mask
        Grey image of the camera's size; in every image features only where it is not 0.

    Attributes
    ----------
    buffer
        The features of the newest image and their past.
    grid
        The cells that quotas are for.
    allowed
        (height, width) false under the newest image's masks; None: no mask.
    capacity
        (rows, columns) features that a cell can hold at the minimum distance, outside the masks.

    Raises
    ------
    ConfigError
        The configuration is not resolved.
    DataError
        The mask does not have the camera's size.
    """

    def __init__(
        self,
        camera: Camera,
        config: FrontendConfig,
        seed: int,
        mask: Image | None = None,
    ) -> None:
        columns, rows = _resolved(config.grid, "grid")
        max_length = _resolved(config.max_track_length, "max_track_length")
        self._camera = camera
        self._config = config
        self._max_features = _resolved(config.max_features, "max_features")
        self._rng = np.random.default_rng(seed)
        self._image: Image | None = None
        self._stamp_ns = -1
        self._skipped = False
        self._watch = ImageWatch()
        fast_threshold = config.fast_threshold + _THRESHOLD_OFFSETS[seed % 3]
        self._tracker = _tracker(config, fast_threshold)
        self._anchors = AnchorPatches(config.klt_window_px) if config.anchor else None
        self.grid = CellGrid(columns, rows, camera.width, camera.height)
        self._min_distance_px = _resolved(config.min_distance_px, "min_distance_px")
        self._detector = CornerDetector(
            self.grid,
            fast_threshold=fast_threshold,
            min_distance_px=self._min_distance_px,
            border_px=config.klt_window_px // 2 + 1,
            subpixel=config.subpixel,
        )
        self._always = _both(self._opened(mask, "dataset.mask"), _seen_by_lens(camera))
        self.allowed = self._always
        self._always_capacity = self.grid.capacities(self._min_distance_px, self._always)
        self.capacity = self._always_capacity
        self.buffer = FeatureBuffer(max_length)

    def look(self, image: Image) -> ImageHealth:
        """Judge a new image (height, width) before it is tracked or skipped.

        Raises
        ------
        DataError
            It does not have the camera's size.
        """
        return self._watch.look(self._sized(image))

    def track(
        self,
        stamp_ns: int,
        image: Image,
        R_cam_prev: FloatArray | None,
        mask: Image | None = None,
    ) -> TrackSummary:
        """Find the previous image's features in a new one.

        Parameters
        ----------
        stamp_ns
            Time of the image on the IMU's clock.
        image
            (height, width) grey.
        R_cam_prev
            (3, 3) takes vectors of the previous camera frame to the current one, as the IMU
            predicts; None where nothing is known.
        mask
            Of the image's size; in this image features only where it is not 0, beside what the
            mask of all images says.

        Raises
        ------
        DataError
            The image or the mask does not have the camera's size.
        """
        prepared = self._prepared(image)
        self._mask(mask)
        previous, self._image, self._stamp_ns = self._image, prepared, stamp_ns
        self._skipped = False
        buffer = self.buffer
        complete = buffer.lengths >= buffer.history
        if self._config.continue_consumed:
            buffer.rename(complete)
        else:
            buffer.keep(~complete)
        consumed = int(complete.sum())
        count = len(buffer)
        if previous is None or count == 0:
            buffer.advance(stamp_ns, buffer.pixels, buffer.normalized)
            return TrackSummary(consumed=consumed)

        guess = self._predicted(R_cam_prev) if self._config.predict_flow else None
        flow = self._tracker.track(previous, self._image, buffer.pixels, guess)
        pixels = self._anchored(previous, self._image, flow)
        inside = flow.consistent & self._permitted(pixels)
        normalized = self._camera.undistort(pixels[inside])
        inlier = motion_inliers(
            buffer.normalized[inside],
            normalized,
            R_cam_prev,
            self._camera,
            self._config.ransac_px,
            self._rng,
        )
        buffer.keep(inside)
        buffer.keep(inlier)
        buffer.advance(stamp_ns, pixels[inside][inlier], normalized[inlier])
        found, consistent = int(flow.found.sum()), int(flow.consistent.sum())
        return TrackSummary(
            tracked=len(buffer),
            consumed=consumed,
            lost_klt=count - found,
            lost_forward_backward=found - consistent,
            lost_outside=consistent - int(inside.sum()),
            lost_outlier=len(inlier) - len(buffer),
        )

    def skip(self, stamp_ns: int) -> None:
        """Leave an image out: it has no observations, and the next is tracked from the last."""
        self._stamp_ns = stamp_ns
        self._skipped = True

    def extract(self, selection: Selection) -> int:
        """Add new features of the current image, as ``selection`` chooses them.

        Returns
        -------
        int
            Their number; with the tracked ones at most ``max_features``.
        """
        if self._image is None:
            raise ValueError("extract() needs an image: call track() first")
        kept = self.buffer.pixels
        new = self._detector.detect(self._image, kept, selection, self._max_features, self.allowed)
        self.buffer.add(new, self._camera.undistort(new))
        return len(new)

    @property
    def corner_counts(self) -> IntArray:
        """(rows, columns) corners found in the last image that was searched."""
        return self._detector.corner_counts

    def observations(self) -> Observations:
        """All features of the current image, tracked and new; none if it was skipped."""
        buffer = self.buffer
        if self._skipped:
            nothing = np.zeros((0, 2))
            return Observations(self._stamp_ns, np.zeros(0, np.int64), nothing, nothing)
        return Observations(
            self._stamp_ns, buffer.ids.copy(), buffer.pixels.copy(), buffer.normalized.copy()
        )

    def _sized(self, image: Image) -> Image:
        size = (self._camera.height, self._camera.width)
        if image.shape != size:
            raise DataError(
                f"an image has shape {image.shape}, but the camera's calibration says {size}: "
                "give grey images of that size"
            )
        return image

    def _prepared(self, image: Image) -> Image:
        image = np.ascontiguousarray(self._sized(image))
        return np.asarray(cv2.equalizeHist(image)) if self._config.equalize else image

    def _opened(self, mask: Image | None, name: str) -> BoolArray | None:
        size = (self._camera.height, self._camera.width)
        if mask is None:
            return None
        if mask.shape != size:
            raise DataError(
                f"{name} is an image of shape {mask.shape}, but must be grey and "
                f"{size[1]}x{size[0]} as the camera's images"
            )
        return np.asarray(mask != 0)

    def _mask(self, mask: Image | None) -> None:
        """Join the mask of the newest image with that of all images."""
        opened = self._opened(mask, "the image's mask")
        if opened is None:
            self.allowed, self.capacity = self._always, self._always_capacity
            return
        self.allowed = _both(opened, self._always)
        self.capacity = self.grid.capacities(self._min_distance_px, self.allowed)

    def _predicted(self, R_cam_prev: FloatArray | None) -> FloatArray | None:
        """Where the features' pixels (N, 2) would be if the camera had only rotated."""
        if R_cam_prev is None:
            return None
        here = self.buffer.normalized
        rays = here @ R_cam_prev[:, :2].T + R_cam_prev[:, 2]
        x, y = (rays[:, :2] / np.maximum(rays[:, 2:], _MIN_DEPTH)).T
        usable = (rays[:, 2] > _MIN_DEPTH) & (np.hypot(x, y) < self._camera.max_radius)
        pixels = self._camera.distort(np.where(usable[:, None], np.column_stack([x, y]), here))
        return np.where(usable[:, None], pixels, self.buffer.pixels)

    def _anchored(self, previous: Image, current: Image, flow: Flow) -> FloatArray:
        """The flow's pixels (N, 2), drift taken out where the configuration asks for it."""
        if self._anchors is None:
            return flow.pixels
        ids = self.buffer.ids
        self._anchors.keep(ids)
        self._anchors.begin(previous, ids, self.buffer.pixels)
        pixels = flow.pixels.copy()
        followed = flow.consistent
        pixels[followed], _ = self._anchors.align(current, ids[followed], pixels[followed])
        return pixels

    def _permitted(self, pixels: FloatArray) -> BoolArray:
        inside = self._camera.inside(pixels)
        return inside if self.allowed is None else inside & pixel_values(self.allowed, pixels)


def _both(one: BoolArray | None, other: BoolArray | None) -> BoolArray | None:
    """Where both allow features; None allows them everywhere."""
    if one is None or other is None:
        return other if one is None else one
    return one & other


def _seen_by_lens(camera: Camera) -> BoolArray | None:
    """(height, width) pixels that a direction maps to; None where all are, as of most lenses.

    In the corners of a fisheye there is none, or one beyond what the model covers: its bearing
    would be another one's.
    """
    columns, rows = np.arange(camera.width), np.arange(camera.height)
    border = [np.broadcast_arrays(columns, edge) for edge in (0, camera.height - 1)]
    border += [np.broadcast_arrays(edge, rows) for edge in (0, camera.width - 1)]
    edges = np.concatenate([np.column_stack(side) for side in border]).astype(np.float64)
    if camera.invertible(edges).all():
        return None
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    return camera.invertible(pixels).reshape(camera.height, camera.width)


def _tracker(config: FrontendConfig, fast_threshold: int) -> Tracker:
    if config.tracker == "orb":
        return OrbTracker(
            fast_threshold,
            search_px=config.orb_search_px,
            max_hamming=config.orb_max_hamming,
            ratio=config.orb_ratio,
        )
    return KltTracker(config.klt_window_px, config.klt_levels, config.forward_backward_px)


def _resolved(value: T | None, name: str) -> T:
    if value is None:
        raise ConfigError(f"frontend.{name} is null: resolve the configuration for the image first")
    return value
