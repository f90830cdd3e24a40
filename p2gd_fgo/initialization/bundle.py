"""Visual-inertial bundle adjustment over the start window.

The unknowns are pose, velocity and biases at each of the K images, the turn of the camera in the
body beside its calibration, and a point for each track; the points are eliminated. The frame is
pinned where the newest image stands: there lie the world's origin and its heading. So the newest
state's covariance is that of a start, and comes from the information of everything seen and felt.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_factor, cho_solve

from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.inertial import inertial_terms
from p2gd_fgo.initialization.preintegration import Intervals
from p2gd_fgo.initialization.visual import Points, Views
from p2gd_fgo.types import ERROR_DIM, FloatArray, IntArray

_LEAST_DAMPING, _FIRST_DAMPING, _SETTLED, _MOST_DAMPING = 1e-9, 1e-3, 1e-4, 1e8
# Damping holds steps of this size: rad, m, m/s, rad/s, m/s². Marquardt's, by the diagonal, would
# pin the scale: no single entry of H knows how little the whole window knows of it.
_STEPS = np.array([0.1, 1.0, 1.0, 0.01, 0.1])
_SMALL_GAIN = 0.05  # of the cost by moving the states; its unit is one squared standard deviation


@dataclass(frozen=True, slots=True, eq=False)
class WindowStates:
    """K states: ``R`` (K, 3, 3), ``p``, ``v``, ``gyro_bias``, ``accel_bias`` (K, 3).

    ``camera_turn`` (3, 3) comes on the right of the calibrated rotation of the camera in the body.
    """

    R: FloatArray
    p: FloatArray
    v: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    camera_turn: FloatArray = field(default_factory=lambda: np.eye(3))

    def __len__(self) -> int:
        return len(self.R)

    def retract(self, delta: FloatArray) -> WindowStates:
        """Moved by delta (K · 15 + 3,): errors as in :class:`Estimate`, and the camera's turn."""
        d = delta[:-3].reshape(-1, ERROR_DIM)
        return WindowStates(
            self.R @ so3.exp(d[:, 0:3]),
            self.p + d[:, 3:6],
            self.v + d[:, 6:9],
            self.gyro_bias + d[:, 9:12],
            self.accel_bias + d[:, 12:15],
            self.camera_turn @ so3.exp(delta[-3:]),
        )


@dataclass(frozen=True, slots=True)
class Beliefs:
    """What is known beforehand, 1 sigma: biases (rad/s, m/s²), the pinned frame (rad, m).

    ``camera`` is of the camera's rotation in the body, rad.
    """

    gyro_bias: float
    accel_bias: float
    yaw: float
    position: float
    camera: float


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """The least-squares problem of a window.

    Attributes
    ----------
    pieces
        K - 1 intervals between the images.
    views
        What the images saw.
    """

    pieces: Intervals
    views: Views
    noise: ImuNoise
    gravity: float
    beliefs: Beliefs

    def linearize(
        self, states: WindowStates, points: Points, *, robust: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The system H δ = g without the points: (15 K + 3, 15 K + 3) and (15 K + 3,).

        The last two recover the points' step: see :meth:`Views.reduced`.
        """
        size = len(states) * ERROR_DIM + 3
        H, g = np.zeros((size, size)), np.zeros(size)
        self._add_beliefs(states, H, g)
        inertial_terms(states, self.pieces, self.noise, self.gravity, H, g)
        views = self.views.turned(states.camera_turn)
        H_pose, g_pose, gain, shift = views.reduced(states.R, states.p, points, robust=robust)
        pose = _seen(states)
        H[np.ix_(pose, pose)] += H_pose
        g[pose] += g_pose
        return H, g, gain, shift

    def cost(self, states: WindowStates, points: Points, *, robust: bool) -> float:
        """Sum of the squared, whitened residuals."""
        total = self._add_beliefs(states, None, None)
        total += inertial_terms(states, self.pieces, self.noise, self.gravity, None, None)
        views = self.views.turned(states.camera_turn)
        return total + views.cost(states.R, states.p, points, robust=robust)

    def minimize(
        self, states: WindowStates, points: Points, iterations: int, *, robust: bool
    ) -> tuple[WindowStates, Points, float, bool]:
        """Levenberg-Marquardt: where it ends, the cost there, and whether it converged."""
        damping = _FIRST_DAMPING
        pose = _seen(states)
        trust = np.tile(np.repeat(_STEPS, 3) ** -2.0, len(states))
        trust = np.append(trust, np.full(3, _STEPS[0] ** -2.0))
        views = self.views.turned(states.camera_turn)
        points = views.settled(states.R, states.p, points, robust=robust)
        cost = self.cost(states, points, robust=robust)
        for _ in range(iterations):
            H, g, gain, shift = self.linearize(states, points, robust=robust)
            H[np.diag_indices_from(H)] += damping * trust
            try:
                delta = cho_solve(cho_factor(H, check_finite=False), g, check_finite=False)
            except LinAlgError:
                damping *= 100.0
                continue
            moved = states.retract(delta)
            moved_points = self._followed(moved, points, shift - gain @ delta[pose], robust=robust)
            new_cost = self.cost(moved, moved_points, robust=robust)
            if new_cost <= cost:
                states, points, cost = moved, moved_points, new_cost
                if delta @ g < _SMALL_GAIN and damping <= _SETTLED:
                    return states, points, new_cost, True
                damping = max(0.1 * damping, _LEAST_DAMPING)
            else:
                damping *= 10.0
                if damping > _MOST_DAMPING:
                    break
        return states, points, cost, False

    def _followed(
        self, states: WindowStates, points: Points, step: FloatArray, *, robust: bool
    ) -> Points:
        """The points after a step of the states: moved along with them, then settled."""
        moved = points.moved(step)
        views = self.views.turned(states.camera_turn)
        miss = views.residuals(states.R, states.p, moved)
        lost = ~np.isfinite(np.add.reduceat(np.abs(miss).sum(axis=1), views.sightings.starts))
        abr = np.where(lost[:, None], points.abr, moved.abr)
        return views.settled(
            states.R, states.p, Points(points.R, points.center, abr), robust=robust
        )

    def newest_covariance(self, states: WindowStates, points: Points) -> FloatArray:
        """(15, 15) of the newest state's error.

        Raises
        ------
        LinAlgError
            The information is singular.
        """
        H, _, _, _ = self.linearize(states, points, robust=True)
        newest = slice(-ERROR_DIM - 3, -3)
        P = cho_solve(cho_factor(H), np.eye(len(H))[:, newest])[newest]
        return np.asarray(0.5 * (P + P.T))

    def _add_beliefs(
        self, states: WindowStates, H: FloatArray | None, g: FloatArray | None
    ) -> float:
        """Biases of the first image, position and heading of the newest, the camera's turn."""
        b = self.beliefs
        information = np.repeat([b.gyro_bias**-2, b.accel_bias**-2], 3)
        biases = np.concatenate([states.gyro_bias[0], states.accel_bias[0]])
        cost = float(biases @ (information * biases))
        cost += float(states.p[-1] @ states.p[-1]) / b.position**2
        turn = so3.log(states.camera_turn)
        cost += float(turn @ turn) / b.camera**2
        R = states.R[-1]
        # Heading is not measured but chosen: the axis along which the pin holds a turn.
        if H is not None and g is not None:
            at = np.arange(9, 15)
            H[at, at] += information
            g[at] -= information * biases
            last = (len(states) - 1) * ERROR_DIM
            H[last : last + 3, last : last + 3] += np.outer(R[2], R[2]) / b.yaw**2
            at = np.arange(last + 3, last + 6)
            H[at, at] += 1.0 / b.position**2
            g[at] -= states.p[-1] / b.position**2
            H[range(-3, 0), range(-3, 0)] += 1.0 / b.camera**2
            g[-3:] -= turn / b.camera**2
        return cost


def _seen(states: WindowStates) -> IntArray:
    """Where the unknowns that the images depend on stand: the poses and the camera's turn."""
    pose = (np.arange(len(states))[:, None] * ERROR_DIM + np.arange(6)).ravel()
    return np.append(pose, len(states) * ERROR_DIM + np.arange(3))
