"""What the images of the start window saw: reprojection errors with the points eliminated.

A point is (a, b, ρ) in a fixed frame of its own, with centre c₀ and rotation R₀: the direction
R₀ (a, b, 1) from c₀, at depth 1/ρ. So points at infinity are points like others, and a point
depends on no state but through its sightings.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.types import BoolArray, FloatArray

_HUBER = 2.0  # standard deviations
_LEAST_DEPTH = 1e-2  # over a point's distance from its own frame, both in the same unit
_WEAK = 1e-3  # m², information on ρ: so little that it tells nothing, but nothing is singular
_HELD = 1e4  # m², times its damping: what holds a point that has no parallax
_FIRST_DAMPING, _POINT_STEPS = 1e-3, 3


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """M points: ``R`` (M, 3, 3) and ``center`` (M, 3) of their frames, ``abr`` (M, 3)."""

    R: FloatArray
    center: FloatArray
    abr: FloatArray

    def moved(self, step: FloatArray) -> Points:
        """With ``abr`` moved by a step (M, 3)."""
        return Points(self.R, self.center, self.abr + step)

    def only(self, which: BoolArray) -> Points:
        """Those whose entry in which (M,) is true."""
        return Points(self.R[which], self.center[which], self.abr[which])


class Views:
    """Sightings of a window, whitened in pixels.

    Parameters
    ----------
    pixel_noise_px
        1 sigma.
    """

    def __init__(
        self,
        sightings: WindowSightings,
        camera: Camera,
        T_imu_cam: FloatArray,
        pixel_noise_px: float,
    ) -> None:
        self.sightings = sightings
        self._camera, self._pixel_noise_px = camera, pixel_noise_px
        self._T_imu_cam = T_imu_cam
        self._white = camera.distort_jacobian(sightings.normalized) / pixel_noise_px

    def only(self, tracks: BoolArray) -> Views:
        """With the tracks (M,) that are true."""
        sightings = self.sightings.only(tracks)
        return Views(sightings, self._camera, self._T_imu_cam, self._pixel_noise_px)

    def noisier(self, factor: float) -> Views:
        """With pixels so many times as noisy."""
        noise_px = factor * self._pixel_noise_px
        return Views(self.sightings, self._camera, self._T_imu_cam, noise_px)

    def turned(self, turn: FloatArray) -> Views:
        """Seen by a camera that is turned in the body by (3, 3) on the right."""
        other = copy(self)
        other._T_imu_cam = self._T_imu_cam.copy()
        other._T_imu_cam[:3, :3] = self._T_imu_cam[:3, :3] @ turn
        return other

    def residuals(self, R: FloatArray, p: FloatArray, points: Points) -> FloatArray:
        """(N, 2) in standard deviations; infinite behind the camera."""
        return self._evaluate(R, p, points)[0]

    def cost(self, R: FloatArray, p: FloatArray, points: Points, *, robust: bool) -> float:
        """Sum of squares, of Huber's where ``robust``; infinite with a point behind a camera."""
        return float(self._costs(R, p, points, robust=robust).sum())

    def jacobians(
        self, R: FloatArray, p: FloatArray, points: Points
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Residuals (N, 2) and derivatives by (δθ, δp), (a, b, ρ) and the camera's turn.

        (N, 2, 6), (N, 2, 3) and (N, 2, 3); the last is the turn that :meth:`turned` takes.
        """
        r, in_imu, seen, R_cam, offset = self._evaluate(R, p, points)
        k, m = self.sightings.image, self.sightings.track
        inverse = 1.0 / seen[:, 2]
        plane = seen[:, :2] * inverse[:, None]
        by_seen = np.zeros((len(seen), 2, 3))
        by_seen[:, 0, 0] = by_seen[:, 1, 1] = inverse
        by_seen[:, :, 2] = -plane * inverse[:, None]
        by_seen = self._white @ by_seen
        R_ic = self._T_imu_cam[:3, :3]
        Rt_cam = np.swapaxes(R_cam[k], -1, -2)
        rho = points.abr[m, 2]
        J_x = np.empty((len(seen), 2, 6))
        J_x[:, :, 0:3] = by_seen @ R_ic.T @ so3.hat(in_imu)
        J_x[:, :, 3:6] = -(by_seen @ Rt_cam) * rho[:, None, None]
        J_l = np.empty((len(seen), 2, 3))
        J_l[:, :, 0:2] = by_seen @ Rt_cam @ points.R[m][:, :, :2]
        J_l[:, :, 2] = (by_seen @ Rt_cam @ offset[..., None])[..., 0]
        return r, J_x, J_l, by_seen @ so3.hat(seen)

    def settled(self, R: FloatArray, p: FloatArray, points: Points, *, robust: bool) -> Points:
        """The points moved to where their sightings agree best, the poses held.

        A point of little parallax is far from linear in ρ; left to the common step, a few such
        points would decide how small the steps of all unknowns must be.
        """
        starts = self.sightings.starts
        damping = np.full(self.sightings.tracks, _FIRST_DAMPING)
        cost = np.add.reduceat(self._costs(R, p, points, robust=robust), starts)
        index = np.arange(3)
        for _ in range(_POINT_STEPS):
            r, _, J, _ = self.jacobians(R, p, points)
            r[~np.isfinite(r)] = 0.0  # behind a camera: nothing to follow, and no cost to beat
            if robust:
                root = _root_weights(r)
                r, J = r * root[:, None], J * root[:, None, None]
            Jt = np.swapaxes(J, -1, -2)
            V = np.add.reduceat(Jt @ J, starts)
            V[:, index, index] *= 1.0 + damping[:, None]
            V[:, index, index] += 1e-9
            V[:, 2, 2] += _WEAK + _HELD * damping
            b = np.add.reduceat((Jt @ r[..., None])[..., 0], starts)
            moved = points.moved(-np.linalg.solve(V, b[..., None])[..., 0])
            new_cost = np.add.reduceat(self._costs(R, p, moved, robust=robust), starts)
            better = new_cost <= cost
            points = Points(
                points.R, points.center, np.where(better[:, None], moved.abr, points.abr)
            )
            cost = np.where(better, new_cost, cost)
            damping = np.where(better, 0.1 * damping, 10.0 * damping)
        return points

    def depth_ratio(self, R: FloatArray, p: FloatArray, points: Points) -> FloatArray:
        """Inverse depth of the points over its standard deviation (M,), the poses held."""
        _, _, J, _ = self.jacobians(R, p, points)
        V = np.add.reduceat(np.swapaxes(J, -1, -2) @ J, self.sightings.starts)
        V += 1e-9 * np.eye(3)
        return np.asarray(points.abr[:, 2] / np.sqrt(np.linalg.inv(V)[:, 2, 2]))

    def _costs(self, R: FloatArray, p: FloatArray, points: Points, *, robust: bool) -> FloatArray:
        """(N,) of the sightings; infinite behind a camera."""
        square = np.sum(self.residuals(R, p, points) ** 2, axis=1)
        if robust:
            far = 2.0 * _HUBER * np.sqrt(square) - _HUBER**2
            square = np.where(square > _HUBER**2, far, square)
        return np.asarray(square)

    def reduced(
        self, R: FloatArray, p: FloatArray, points: Points, *, robust: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """H and g of the poses and the camera's turn (6 K + 3), and how the points follow.

        The points' step (M, 3) is ``shift - gain @ δ`` with gain (M, 3, 6 K + 3), shift (M, 3).
        """
        r, J_x, J_l, J_c = self.jacobians(R, p, points)
        if robust:
            root = _root_weights(r)
            r = r * root[:, None]
            J_x, J_l, J_c = (J * root[:, None, None] for J in (J_x, J_l, J_c))
        k, m, starts = self.sightings.image, self.sightings.track, self.sightings.starts
        images, tracks = len(R), self.sightings.tracks
        J_xt, J_lt, J_ct = (np.swapaxes(J, -1, -2) for J in (J_x, J_l, J_c))
        V = np.add.reduceat(J_lt @ J_l, starts)
        V[:, 2, 2] += _WEAK
        b = -np.add.reduceat((J_lt @ r[..., None])[..., 0], starts)
        by_image = np.zeros((tracks, images, 3, 6))
        by_image[m, k] = J_lt @ J_x
        W = np.empty((tracks, 3, size := 6 * images + 3))
        W[:, :, :-3] = by_image.transpose(0, 2, 1, 3).reshape(tracks, 3, -1)
        W[:, :, -3:] = np.add.reduceat(J_lt @ J_c, starts)
        V_inverse = np.linalg.inv(V)
        gain = V_inverse @ W
        shift = (V_inverse @ b[..., None])[..., 0]
        H = -(W.reshape(-1, size).T @ gain.reshape(-1, size))
        g = -(gain.reshape(-1, size).T @ b.ravel())
        H[-3:, -3:] += np.sum(J_ct @ J_c, axis=0)
        g[-3:] -= np.sum(J_ct @ r[..., None], axis=0)[:, 0]
        order = np.argsort(k, kind="stable")
        at, first = np.unique(k[order], return_index=True)
        blocks = np.add.reduceat((J_xt @ J_x)[order], first)
        steps = np.add.reduceat((J_xt @ r[..., None])[order, :, 0], first)
        turns = np.add.reduceat((J_xt @ J_c)[order], first)
        for image, block, step, turn in zip(at.tolist(), blocks, steps, turns, strict=True):
            own = slice(6 * image, 6 * image + 6)
            H[own, own] += block
            g[own] -= step
            H[own, -3:] += turn
            H[-3:, own] += turn.T
        return 0.5 * (H + H.T), g, gain, shift

    def _evaluate(
        self, R: FloatArray, p: FloatArray, points: Points
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        k, m = self.sightings.image, self.sightings.track
        R_ic, p_ic = self._T_imu_cam[:3, :3], self._T_imu_cam[:3, 3]
        R_cam = R @ R_ic
        direction = (
            points.R
            @ np.concatenate([points.abr[:, :2], np.ones((len(points.abr), 1))], axis=1)[..., None]
        )
        rho = points.abr[m, 2, None]
        world = direction[m, :, 0] + rho * (points.center[m] - p[k])
        in_imu = (np.swapaxes(R[k], -1, -2) @ world[..., None])[..., 0]
        seen = (in_imu - rho * p_ic) @ R_ic
        offset = points.center[m] - (p + R @ p_ic)[k]
        ahead = seen[:, 2] > _LEAST_DEPTH
        z = np.where(ahead, seen[:, 2], 1.0)[:, None]
        miss = seen[:, :2] / z - self.sightings.normalized
        r = (self._white @ miss[..., None])[..., 0]
        r[~ahead] = np.inf
        return r, in_imu, seen, R_cam, offset


def _root_weights(r: FloatArray) -> FloatArray:
    """Square roots (N,) of Huber's weights of residuals (N, 2)."""
    return np.asarray(np.sqrt(_HUBER / np.maximum(np.linalg.norm(r, axis=1), _HUBER)))
