"""The motion over a window of images and IMU samples, from nothing: solve, refine, judge."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import LinAlgError

from p2gd_fgo.config import DynamicStartConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.geometry.triangulation import triangulate
from p2gd_fgo.initialization.bundle import Beliefs, Bundle, WindowStates
from p2gd_fgo.initialization.gyro_alignment import align_gyro
from p2gd_fgo.initialization.inertial import inertial_residuals
from p2gd_fgo.initialization.linear import LinearStart, solve_linear
from p2gd_fgo.initialization.preintegration import Intervals, intervals, preintegrate
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.initialization.static import heading_frame
from p2gd_fgo.initialization.visual import Points, Views
from p2gd_fgo.types import ERROR_DIM, BoolArray, FloatArray, ImuBatch, NavState

_ROUNDS, _ROBUST_STEPS, _FINAL_STEPS = 2, 20, 12
_GATE, _LEAST_GATE = 4.0, 0.5  # standard deviations of a sighting
_GATE_MEDIANS = 5.0  # tracks that err by more than so many medians are left out
_NUDGE = 1e-4  # rad
# Inverse depth over its standard deviation. Points without parallax take any depth that fits their
# noise, and a few hundred of them make a wrong scale look certain.
_LEAST_DEPTH_RATIO = 5.0
# What a track errs by stays for its life, and what all tracks have in common doesn't average out.
# Residuals show neither: so many times as large is what the pixels count as, between two bounds in
# the back ends' pixel noise.
_CAUTION, _LEAST_NOISE, _MOST_NOISE = 5.0, 0.5, 2.0
_FAR = 0.02  # 1/m, for tracks that can't be triangulated
_NEAR = 2.0  # 1/m


@dataclass(frozen=True, slots=True, eq=False)
class WindowMotion:
    """What came out, at the window's newest image.

    Attributes
    ----------
    state, covariance
        Of the newest image, in the frame that is pinned there; (15, 15).
    images, tracks
        That went in.
    inliers
        Share of the sightings that agree.
    pixel_rms, imu_rms
        RMS residual in standard deviations.
    converged
        The refinement came to rest.
    """

    state: NavState
    covariance: FloatArray
    images: int
    tracks: int
    inliers: float
    pixel_rms: float
    imu_rms: float
    converged: bool

    @property
    def speed(self) -> float:
        """m/s."""
        return float(np.linalg.norm(self.state.velocity))

    @property
    def speed_sigma(self) -> float:
        """m/s, 1 sigma in the direction of motion, or in the worst direction at rest."""
        P = self.covariance[6:9, 6:9]
        if self.speed < 1e-3:
            return float(np.sqrt(np.linalg.eigvalsh(P)[-1]))
        ahead = self.state.velocity / self.speed
        return float(np.sqrt(ahead @ P @ ahead))

    @property
    def tilt_sigma_deg(self) -> float:
        """1 sigma of the worst direction of roll and pitch."""
        R = self.state.T_world_imu[:3, :3]
        P = (R @ self.covariance[:3, :3] @ R.T)[:2, :2]
        return float(np.degrees(np.sqrt(np.linalg.eigvalsh(P)[-1])))


class WindowSolver:
    """Finds the motion over windows of one recording.

    Parameters
    ----------
    calibration
        Camera and extrinsic.
    noise
        IMU densities.
    gravity
        m/s².
    pixel_noise_px
        1 sigma.
    """

    def __init__(
        self,
        calibration: Calibration,
        noise: ImuNoise,
        gravity: float,
        pixel_noise_px: float,
        config: DynamicStartConfig,
    ) -> None:
        self._camera, self._T_imu_cam = calibration.camera, calibration.T_imu_cam
        gyro_noise = max(noise.gyro_noise_density, config.min_gyro_noise)
        self._noise = replace(noise, gyro_noise_density=gyro_noise)
        self._gravity, self._config = gravity, config
        self._pixel_noise_px = _MOST_NOISE * pixel_noise_px
        self._sigma_ray = pixel_noise_px / np.sqrt(self._camera.fx * self._camera.fy)
        self._beliefs = Beliefs(
            config.sigma_gyro_bias,
            config.sigma_accel_bias,
            np.radians(config.sigma_yaw_deg),
            config.sigma_position,
        )

    def solve(
        self, sightings: WindowSightings, imu: ImuBatch, guess: NavState | None = None
    ) -> WindowMotion | None:
        """Rotation and gyro bias, then velocity, gravity and scale, then all of it refined.

        Parameters
        ----------
        guess
            The state somewhere in the window; None: from the linear solution, which is for
            windows of a few seconds, in which the gyro doesn't drift.

        Returns
        -------
        WindowMotion | None
            None where too few tracks are left, or the system is singular.
        """
        c = self._config
        if sightings.tracks < c.min_tracks:
            return None
        pieces = intervals(imu, sightings.stamps_ns)
        try:
            if guess is None:
                states = self._from_nothing(sightings, pieces)
            else:
                states = _carried(guess, sightings, pieces, self._noise, self._gravity)
            if states is None:
                return None
            with np.errstate(all="ignore"):  # a step gone wrong costs nan or inf, and is undone
                return self._refined(sightings, pieces, states)
        except LinAlgError:
            return None

    def _from_nothing(self, sightings: WindowSightings, pieces: Intervals) -> WindowStates | None:
        c = self._config
        gyro_bias = align_gyro(
            sightings, pieces, self._T_imu_cam[:3, :3], self._noise,
            c.sigma_gyro_bias, self._sigma_ray,
        )  # fmt: skip
        if gyro_bias is None:
            return None
        motion = preintegrate(pieces, gyro_bias, np.zeros(3), self._noise)
        linear = solve_linear(
            sightings, motion, self._T_imu_cam, self._gravity, c.sigma_accel_bias, self._sigma_ray
        )
        return _in_world(linear, gyro_bias)

    def _refined(
        self, sightings: WindowSightings, pieces: Intervals, states: WindowStates
    ) -> WindowMotion | None:
        c = self._config
        every = Views(sightings, self._camera, self._T_imu_cam, self._pixel_noise_px)
        for _ in range(_ROUNDS):
            # Anew each time: a point that was placed by a poor motion keeps its poor place.
            points = _first_points(sightings, states, self._T_imu_cam)
            ahead = np.isfinite(every.residuals(states.R, states.p, points)).all(axis=1)
            ahead = np.logical_and.reduceat(ahead, sightings.starts)
            if ahead.sum() < c.min_tracks:
                return None
            views, points = every.only(ahead), points.only(ahead)
            bundle = Bundle(pieces, views, self._noise, self._gravity, self._beliefs)
            states, points, _, _ = bundle.minimize(states, points, _ROBUST_STEPS, robust=True)
        kept, inliers, converged, factor = views, 1.0, False, 1.0
        for last in (False, True):
            size = np.linalg.norm(kept.residuals(states.R, states.p, points), axis=1)
            worst = np.maximum.reduceat(size, kept.sightings.starts)
            good = worst < min(_GATE, max(_GATE_MEDIANS * float(np.median(size)), _LEAST_GATE))
            inliers = min(inliers, float(good[kept.sightings.track].mean()))
            good &= kept.depth_ratio(states.R, states.p, points) > _LEAST_DEPTH_RATIO
            good &= points.abr[:, 2] < _NEAR
            if good.sum() < c.min_tracks:
                return None
            kept, points = kept.only(good), points.only(good)
            if last:
                least = _LEAST_NOISE / _MOST_NOISE
                factor = float(np.clip(_CAUTION * _rms(kept, states, points), least, 1.0))
                kept = kept.only(np.ones(len(points.abr), dtype=bool), factor)
            bundle = Bundle(pieces, kept, self._noise, self._gravity, self._beliefs)
            states, points, _, converged = bundle.minimize(
                states, points, _FINAL_STEPS, robust=True
            )
        covariance = self._with_extrinsic(bundle, states, points)
        r, _, C = inertial_residuals(states, pieces, self._noise, self._gravity)
        white = np.linalg.solve(np.linalg.cholesky(C), r[..., None])
        return WindowMotion(
            NavState(
                int(sightings.stamps_ns[-1]),
                from_rotation_translation(states.R[-1], states.p[-1]),
                states.v[-1],
                states.gyro_bias[-1],
                states.accel_bias[-1],
            ),
            covariance,
            len(states),
            kept.sightings.tracks,
            inliers,
            factor * _rms(kept, states, points),
            float(np.sqrt(np.sum(white[:, :9] ** 2) / (9 * len(r)))),
            converged,
        )

    def _with_extrinsic(self, bundle: Bundle, states: WindowStates, points: Points) -> FloatArray:
        """The newest state's covariance with what the extrinsic rotation may err by.

        It isn't estimated but considered (Schmidt): on a straight road nothing shows it, and it
        turns the velocity in the body.
        """
        by_turn = np.empty((len(states) * ERROR_DIM, 3))
        for axis in range(3):
            turn = so3.exp(_NUDGE * np.eye(3)[axis])
            g = [
                replace(bundle, views=bundle.views.turned(R)).linearize(
                    states, points, robust=True
                )[1]
                for R in (turn, turn.T)
            ]
            by_turn[:, axis] = (g[0] - g[1]) / (2.0 * _NUDGE)
        P, gain = bundle.newest_covariance(states, points, by_turn)
        sigma = np.radians(self._config.sigma_extrinsic_deg)
        return np.asarray(P + sigma**2 * gain @ gain.T)


def _rms(views: Views, states: WindowStates, points: Points) -> float:
    """RMS reprojection error in standard deviations; a point takes three of its equations."""
    square = float(np.sum(views.residuals(states.R, states.p, points) ** 2))
    return float(np.sqrt(square / max(2 * len(views.sightings) - 3 * views.sightings.tracks, 1)))


def _carried(
    guess: NavState, s: WindowSightings, pieces: Intervals, noise: ImuNoise, gravity: float
) -> WindowStates:
    """The IMU's path through the window from the image next to the guess, both ways."""
    m = preintegrate(pieces, guess.gyro_bias, guess.accel_bias, noise)
    count = len(s.stamps_ns)
    R, v, p = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    at = int(np.argmin(np.abs(s.stamps_ns - guess.stamp_ns)))
    R[at], v[at], p[at] = guess.T_world_imu[:3, :3], guess.velocity, guess.T_world_imu[:3, 3]
    fall = np.array([0.0, 0.0, -gravity])
    for n in range(at, count - 1):
        dt = m.duration_s[n]
        R[n + 1] = R[n] @ m.R[n]
        v[n + 1] = v[n] + fall * dt + R[n] @ m.v[n]
        p[n + 1] = p[n] + v[n] * dt + 0.5 * fall * dt**2 + R[n] @ m.p[n]
    for n in range(at - 1, -1, -1):
        dt = m.duration_s[n]
        R[n] = R[n + 1] @ m.R[n].T
        v[n] = v[n + 1] - fall * dt - R[n] @ m.v[n]
        p[n] = p[n + 1] - v[n] * dt - 0.5 * fall * dt**2 - R[n] @ m.p[n]
    return _pinned(
        WindowStates(R, p, v, np.tile(guess.gyro_bias, (count, 1)),
                     np.tile(guess.accel_bias, (count, 1)))
    )  # fmt: skip


def _pinned(states: WindowStates) -> WindowStates:
    """Moved and turned about the vertical to the frame that is pinned at the newest image."""
    turn = heading_frame(states.R[-1, 2]) @ states.R[-1].T
    R = so3.from_quaternion(so3.to_quaternion(turn @ states.R))
    return WindowStates(
        R, (states.p - states.p[-1]) @ turn.T, states.v @ turn.T,
        states.gyro_bias, states.accel_bias,
    )  # fmt: skip


def _in_world(linear: LinearStart, gyro_bias: FloatArray) -> WindowStates:
    """With z up."""
    R = heading_frame(-linear.gravity / np.linalg.norm(linear.gravity))
    count = len(linear.R)
    return _pinned(
        WindowStates(
            R @ linear.R, linear.p @ R.T, linear.v @ R.T,
            np.tile(gyro_bias, (count, 1)), np.tile(linear.accel_bias, (count, 1)),
        )
    )  # fmt: skip


def _first_points(s: WindowSightings, states: WindowStates, T_imu_cam: FloatArray) -> Points:
    """Triangulated, each in the frame of the first camera that saw it."""
    T = from_rotation_translation(states.R, states.p) @ T_imu_cam
    seen = np.full((s.tracks, len(T), 2), np.nan)
    seen[s.track, s.image] = s.normalized
    triangulated = triangulate(seen, T)
    first = s.image[s.starts]
    R, center = T[first, :3, :3], T[first, :3, 3]
    local = (np.swapaxes(R, -1, -2) @ (triangulated.points - center)[..., None])[..., 0]
    abr = np.column_stack([s.normalized[s.starts], np.full(s.tracks, _FAR)])
    good: BoolArray = np.isfinite(local).all(axis=1) & (triangulated.depth > 1.0 / _NEAR)
    abr[good, 2] = 1.0 / local[good, 2]
    return Points(R, center, abr)
