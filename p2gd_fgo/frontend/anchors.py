"""Alignment of every track to the patch in which it began, so that it doesn't drift.

From image to image Lucas-Kanade errs by a tenth of a pixel, and the errors add up: a track's error
is a walk, not the white noise that a back end believes in. Here the position it finds is moved to
where the track's *first* patch fits, under an affine map of the patch (Shi and Tomasi, "Good
features to track", CVPR 1994) and a change of brightness and contrast, by inverse-compositional
Gauss-Newton (Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 2004), all tracks at once.
"""

from __future__ import annotations

import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, Image, IntArray

_STEPS = 8
_CONVERGED_PX = 0.01
_LEAST_CORRELATION = 0.8  # below, the patch shows something else, or its surface has turned away
_MAX_CORRECTION_PX = 1.5  # beyond, it is another optimum than the tracker's
_AREAS = (0.2, 6.0)  # of the patch against the first: beyond, it has too few pixels in one of them
_WEIGHT_RADII = 0.6  # sigma of the pixels' weights: the patch's rim is where depths differ
# Of a step of the shift and of the map, as shares of the shift's own information. An isolated blob
# fits under many maps, and the point beside it would wander with them: the map follows slowly.
_DAMPING = np.diag([1e-6] * 2 + [0.01] * 4)
_FLAT = 1e-6  # grey levels, contrast of such a patch


class AnchorPatches:
    """The first patches of tracks, in the order of their ids.

    Parameters
    ----------
    side_px
        Of a patch; an even number counts as the next.
    """

    def __init__(self, side_px: int) -> None:
        self._radius = side_px // 2
        axis = np.arange(-self._radius, self._radius + 1) / self._radius
        x, y = np.meshgrid(axis, axis)
        self._x, self._y = x.ravel(), y.ravel()  # of a patch's pixels, in radii
        weights = np.exp(-0.5 * (self._x**2 + self._y**2) / _WEIGHT_RADII**2)
        self._weights = weights / weights.sum()
        pixels = len(weights)
        self._ids: IntArray = np.zeros(0, np.int64)
        self._patches: FloatArray = np.zeros((0, pixels))
        self._solvers: FloatArray = np.zeros((0, 6, pixels))  # residuals to a step of the map
        self._maps: FloatArray = np.zeros((0, 2, 2))  # the first patch's offsets to the newest's

    def keep(self, ids: IntArray) -> None:
        """Forget all tracks but these."""
        self._select(np.isin(self._ids, ids))

    def begin(self, image: Image, ids: IntArray, pixels: FloatArray) -> None:
        """Take the patches of those tracks that have none, at their pixels (N, 2) in an image."""
        new = ~np.isin(ids, self._ids)
        centres = pixels[new]
        maps = np.tile(np.eye(2), (len(centres), 1, 1))
        patches, contrast = self._normalized(self._sampled(image, centres, maps))
        right, left, down, up = (
            self._sampled(image, centres + step, maps)
            for step in ([1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0])
        )
        gx, gy = (right - left) / (2.0 * contrast), (down - up) / (2.0 * contrast)
        J = np.stack([gx, gy, gx * self._x, gx * self._y, gy * self._x, gy * self._y], axis=1)
        # What a change of brightness or contrast would explain moves nothing.
        J -= (J @ self._weights)[..., None]
        J -= (J @ (self._weights * patches)[..., None]) * patches[:, None]
        weighted = J * self._weights
        H = weighted @ np.swapaxes(J, 1, 2)
        level = np.trace(H[:, :2, :2], axis1=1, axis2=2)[:, None] + _FLAT
        solvers = np.linalg.solve(H + level[..., None] * _DAMPING, weighted)
        order = np.argsort(np.concatenate([self._ids, ids[new]]), kind="stable")
        self._ids = np.concatenate([self._ids, ids[new]])[order]
        self._patches = np.concatenate([self._patches, patches])[order]
        self._solvers = np.concatenate([self._solvers, solvers])[order]
        self._maps = np.concatenate([self._maps, maps])[order]

    def align(
        self, image: Image, ids: IntArray, pixels: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Move tracks to where their first patches fit.

        Parameters
        ----------
        image
            (height, width) grey.
        ids
            (N,) of tracks that have a patch.
        pixels
            (N, 2) where they were found in the image, to within a pixel or so.

        Returns
        -------
        tuple[FloatArray, BoolArray]
            (N, 2) their pixels, and (N,) which of them were moved. The others are where they were,
            and their patches are forgotten: the next begins where they are.
        """
        at = np.searchsorted(self._ids, ids)
        patches, solvers = self._patches[at], self._solvers[at]
        centres, maps = pixels.copy(), self._maps[at]
        moving = np.arange(len(ids))
        for _ in range(_STEPS):
            seen, _ = self._normalized(self._sampled(image, centres[moving], maps[moving]))
            residuals = seen - patches[moving]
            step = (solvers[moving] @ residuals[..., None])[..., 0]
            change = np.linalg.inv(np.eye(2) + step[:, 2:].reshape(-1, 2, 2) / self._radius)
            shift = -(maps[moving] @ change @ step[:, :2, None])[..., 0]
            centres[moving] += shift
            maps[moving] = maps[moving] @ change
            moving = moving[np.linalg.norm(shift, axis=1) > _CONVERGED_PX]
            if len(moving) == 0:
                break
        good = self._fits(image, patches, centres, maps)
        good &= np.linalg.norm(centres - pixels, axis=1) < _MAX_CORRECTION_PX
        self._maps[at] = maps
        bad = np.zeros(len(self._ids), np.bool_)
        bad[at[~good]] = True
        self._select(~bad)
        return np.where(good[:, None], centres, pixels), good

    def _fits(
        self, image: Image, patches: FloatArray, centres: FloatArray, maps: FloatArray
    ) -> BoolArray:
        """(N,) whether a patch lies in the image, looks like the first, and is about as large."""
        seen, _ = self._normalized(self._sampled(image, centres, maps))
        correlation = (seen * patches) @ self._weights
        area = np.linalg.det(maps)
        reach = self._radius * np.abs(maps).sum(axis=2)
        height, width = image.shape
        inside = ((centres - reach >= 0) & (centres + reach <= [width - 1, height - 1])).all(axis=1)
        return np.asarray(
            inside & (correlation > _LEAST_CORRELATION) & (area > _AREAS[0]) & (area < _AREAS[1])
        )

    def _sampled(self, image: Image, centres: FloatArray, maps: FloatArray) -> FloatArray:
        """(N, pixels) grey levels about centres (N, 2), bilinear; beyond the rim, the rim's.

        Not by OpenCV, which rounds positions to 1/32 px.
        """
        height, width = image.shape
        offsets = self._radius * np.stack([self._x, self._y])
        where = centres[:, :, None] + maps @ offsets
        u = np.clip(where[:, 0], 0.0, width - 1.001)
        v = np.clip(where[:, 1], 0.0, height - 1.001)
        column, row = u.astype(np.int32), v.astype(np.int32)
        du, dv = (u - column).astype(np.float32), (v - row).astype(np.float32)
        flat, first = image.ravel(), row * width + column
        upper, right, lower, last = (flat.take(first + k) for k in (0, 1, width, width + 1))
        top = upper + du * (right.astype(np.float32) - upper)
        bottom = lower + du * (last.astype(np.float32) - lower)
        return np.asarray(top + dv * (bottom - top))

    def _normalized(self, grey: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Patches (N, pixels) of mean 0 and contrast 1, and their contrasts (N, 1)."""
        centred = grey - (grey @ self._weights)[:, None]
        contrast = np.sqrt((centred**2) @ self._weights)[:, None] + _FLAT
        return centred / contrast, contrast

    def _select(self, which: BoolArray) -> None:
        self._ids = self._ids[which]
        self._patches = self._patches[which]
        self._solvers = self._solvers[which]
        self._maps = self._maps[which]
