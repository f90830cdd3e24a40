"""The motion over a window of images and IMU samples, from nothing: solve, refine, judge."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import LinAlgError

from p2gd_fgo.config import DynamicStartConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.initialization.beginnings import NEAR, carried, first_points, in_world
from p2gd_fgo.initialization.bundle import Beliefs, Bundle, WindowStates
from p2gd_fgo.initialization.gyro_alignment import align_gyro
from p2gd_fgo.initialization.inertial import inertial_residuals
from p2gd_fgo.initialization.linear import solve_linear
from p2gd_fgo.initialization.preintegration import Intervals, intervals, preintegrate
from p2gd_fgo.initialization.sightings import WindowSightings
from p2gd_fgo.initialization.visual import Points, Views
from p2gd_fgo.types import FloatArray, ImuBatch, NavState

_ROUNDS, _ROBUST_STEPS, _FINAL_STEPS = 2, 20, 12
_GATE, _LEAST_GATE = 4.0, 0.5  # standard deviations of a sighting
_GATE_MEDIANS = 5.0  # tracks that err by more than so many medians are left out
# Inverse depth over its standard deviation. Points without parallax take any depth that fits their
# noise, and a few hundred of them make a wrong scale look certain.
_LEAST_DEPTH_RATIO = 5.0
# What a track errs by stays for its life, and what all tracks have in common doesn't average out.
# Residuals show neither: so many times as large is what the pixels count as, between two bounds in
# the back ends' pixel noise.
_CAUTION, _LEAST_NOISE, _MOST_NOISE = 5.0, 0.5, 2.0
# The state itself is found with pixels that count for more. Against pixels made too noisy it is the
# accelerometer that the path follows, noise included, and noise passes for acceleration: the
# images' motion looks too small, and the scale comes out too large.
_SOLVED_SHARE = 0.4
# Sigmas of the accelerometer's bias, three axes: 5 % of honest ones are beyond.
_BIAS_TENSION = 2.8


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
            np.radians(config.sigma_extrinsic_deg),
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
                states = carried(guess, sightings, pieces, self._noise, self._gravity)
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
        return in_world(linear, gyro_bias)

    def _refined(
        self, sightings: WindowSightings, pieces: Intervals, states: WindowStates
    ) -> WindowMotion | None:
        c = self._config
        every = Views(sightings, self._camera, self._T_imu_cam, self._pixel_noise_px)
        for _ in range(_ROUNDS):
            # Anew each time: a point that was placed by a poor motion keeps its poor place.
            points = first_points(sightings, states, self._T_imu_cam)
            seen = every.turned(states.camera_turn).residuals(states.R, states.p, points)
            ahead = np.isfinite(seen).all(axis=1)
            ahead = np.logical_and.reduceat(ahead, sightings.starts)
            if ahead.sum() < c.min_tracks:
                return None
            views, points = every.only(ahead), points.only(ahead)
            bundle = self._bundle(pieces, views)
            states, points, _, _ = bundle.minimize(states, points, _ROBUST_STEPS, robust=True)
        kept, inliers = views, 1.0
        for last in (False, True):
            turned = kept.turned(states.camera_turn)
            size = np.linalg.norm(turned.residuals(states.R, states.p, points), axis=1)
            worst = np.maximum.reduceat(size, kept.sightings.starts)
            good = worst < min(_GATE, max(_GATE_MEDIANS * float(np.median(size)), _LEAST_GATE))
            inliers = min(inliers, float(good[kept.sightings.track].mean()))
            good &= turned.depth_ratio(states.R, states.p, points) > _LEAST_DEPTH_RATIO
            good &= points.abr[:, 2] < NEAR
            if good.sum() < c.min_tracks:
                return None
            kept, points = kept.only(good), points.only(good)
            if not last:
                bundle = self._bundle(pieces, kept)
                states, points, _, _ = bundle.minimize(states, points, _FINAL_STEPS, robust=True)
        factor = float(
            np.clip(_CAUTION * _rms(kept, states, points), _LEAST_NOISE / _MOST_NOISE, 1.0)
        )
        for share in (_SOLVED_SHARE, 1.0):
            bundle = self._bundle(pieces, kept.noisier(share * factor))
            states, points, _, converged = bundle.minimize(
                states, points, _FINAL_STEPS, robust=True
            )
            bias = float(np.linalg.norm(states.accel_bias[-1])) / c.sigma_accel_bias
            if bias < _BIAS_TENSION:
                break
        bundle = self._bundle(pieces, kept.noisier(factor))
        # A bias that its prior can't explain was bent by what the model doesn't know, and so was
        # the rest.
        covariance = bundle.newest_covariance(states, points) * max(1.0, bias**2 / 3.0)
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
            _rms(kept, states, points),
            float(np.sqrt(np.sum(white[:, :9] ** 2) / (9 * len(r)))),
            converged,
        )

    def _bundle(self, pieces: Intervals, views: Views) -> Bundle:
        return Bundle(pieces, views, self._noise, self._gravity, self._beliefs)


def _rms(views: Views, states: WindowStates, points: Points) -> float:
    """RMS reprojection error in standard deviations; a point takes three of its equations."""
    views = views.turned(states.camera_turn)
    square = float(np.sum(views.residuals(states.R, states.p, points) ** 2))
    return float(np.sqrt(square / max(2 * len(views.sightings) - 3 * views.sightings.tracks, 1)))
