"""The filter: one class whose ``update`` reads like the algorithm."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import solve_triangular

from p2gd_fgo.backends.msckf.look_ahead import pose_information
from p2gd_fgo.backends.msckf.measurement import (
    Sensor,
    carried,
    jacobians,
    least_depth,
    orthonormal_columns,
    residuals,
    times_root,
    without_point,
)
from p2gd_fgo.backends.msckf.propagation import propagate
from p2gd_fgo.backends.msckf.standstill import equal_poses
from p2gd_fgo.backends.msckf.state import FilterState, Poses, largest_turn
from p2gd_fgo.backends.msckf.tracks import Sightings, TrackTable
from p2gd_fgo.backends.msckf.triangulation import LEAST_DEPTH_M, camera_poses, triangulate
from p2gd_fgo.backends.msckf.update import gate, most_likely, root, updated
from p2gd_fgo.config import BackendConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import EstimatorError
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.imu import UnknownMotion
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import (
    NANOSECONDS,
    BoolArray,
    Estimate,
    FloatArray,
    ImuBatch,
    NavState,
    Observations,
    Trajectory,
)

_MOST_ROUNDS = 6
_SMALL_TURN = 1e-3  # rad; the next round would see the points where this one does
# After so long without an image the tracks that bridge the gap are used at once: they are few, and
# a wrong match across it goes on to drift until it is lost, and would be due only then.
_BLIND_NS = NANOSECONDS


class Msckf:
    """Back end of the multi-state constraint Kalman filter: poses of the last ``window`` images.

    Parameters
    ----------
    calibration
        Camera and extrinsic.
    noise
        IMU densities, inflation already in.
    gravity
        m/s².
    config
        Window length, pixel noise and the filter's own settings.
    timer
        Stages ``look_ahead``, ``triangulate``, ``linearize``, ``gate``, ``solve`` are timed in it.
    """

    def __init__(
        self,
        calibration: Calibration,
        noise: ImuNoise,
        gravity: float,
        config: BackendConfig,
        timer: StageTimer | None = None,
    ) -> None:
        self._size = config.window
        self._config = config.msckf
        self._noise = noise
        self._gravity = gravity
        self._timer = timer or StageTimer()
        self._sensor = Sensor(calibration.camera, calibration.T_imu_cam, config.pixel_noise_px)
        self._tracks = TrackTable(config.window)
        self._started = False
        self._hole_ns: int | None = None  # the last image before an interval with a hole
        self._left: list[tuple[int, FloatArray]] = []
        self._counts: Counter[str] = Counter()

    def start(self, state: NavState, covariance: FloatArray) -> None:
        """Begin at ``state``."""
        self._state = FilterState.begin(state, covariance)
        self._started = True

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        """Predict the next image's state; the last image's pose stays behind as a clone."""
        if unknown is not None:
            self._hole_ns = self._state.stamps_ns[-1]
        self._state = propagate(
            self._state, imu, self._noise, self._gravity, fej=self._config.fej, unknown=unknown
        )
        return self._state.newest()

    def update(self, observations: Observations, stationary: bool) -> Estimate:
        """Use the tracks that are due, and let the oldest image go."""
        self._counts["observations"] += len(observations)
        full = len(self._state) >= self._size
        try:
            if stationary:
                self._counts["muted_standing_still"] += len(observations)
                self._correct(self._tracks.take_all(len(self._state) - 1), still=True)
            else:
                due = self._tracks.add(observations, len(self._state) - 1)
                if self._state.newest_interval_ns > _BLIND_NS:
                    due = due.with_others(self._tracks.take_older(len(self._state)))
                if full:
                    due = due.with_others(self._tracks.take_seen_by_oldest(len(self._state)))
                self._correct(due, still=False)
        except LinAlgError:
            raise EstimatorError(
                observations.stamp_ns, "the covariance is not positive definite: diverged"
            ) from None
        estimate = Estimate(
            self._state.newest(),
            self._state.newest_covariance(),
            self._state.trajectory(),
            stationary,
        )
        if full:
            self._drop_oldest()
        return estimate

    def finish(self) -> Trajectory:
        """All poses as they left the window, then those still in it."""
        rest = self._state.trajectory()
        left_stamps = np.array([t for t, _ in self._left], dtype=np.int64)
        left_poses = np.array([T for _, T in self._left]).reshape(-1, 4, 4)
        return Trajectory(
            np.concatenate([left_stamps, rest.stamps_ns]),
            np.concatenate([left_poses, rest.T_world_imu]),
        )

    @property
    def counts(self) -> dict[str, int]:
        """Observations by fate: all of them add up to ``observations``."""
        held = self._tracks.observations(len(self._state)) if self._started else 0
        return dict(self._counts) | {"in_window": held}

    def _correct(self, due: Sightings, *, still: bool) -> None:
        """One Kalman update with the points of all tracks that are due.

        It is linearised where all tracks, those that are not due yet too, say that the images were
        taken. As long as a hole in the IMU lies in the window, the prediction may be turned by
        tens of degrees, and one step doesn't lead there.
        """
        if len(due) == 0 and not still:
            return
        prior = self._state
        L = root(prior.covariance)
        hole = self._hole_ns is not None and self._hole_ns >= prior.stamps_ns[0]
        once = self._config.look_ahead and not self._config.fej
        if rounds := _MOST_ROUNDS if hole else int(once):
            seen = due.with_others(self._tracks.held(len(prior)))
            self._look_ahead(prior, L, seen, rounds=rounds)
        self._step(prior, L, due, still=still)

    def _look_ahead(
        self, prior: FilterState, L: FloatArray, tracks: Sightings, *, rounds: int
    ) -> None:
        """Move to the iterated update by these tracks, of which nothing else remains.

        With ``fej`` the first estimates begin anew there.
        """
        counts = self._counts.copy()
        with self._timer.stage("look_ahead"):
            for k in range(rounds):
                far_off = k == 0 and rounds > 1  # too far to tell an outlier by its pixels
                turn = self._nearer(prior, L, tracks, far_off=far_off)
                if self._config.fej:
                    self._state = self._state.begun_anew()
                if turn < _SMALL_TURN:
                    break
        self._counts = counts

    def _nearer(
        self, prior: FilterState, L: FloatArray, tracks: Sightings, *, far_off: bool
    ) -> float:
        """One step towards where ``tracks`` put the images; returns its largest turn, rad."""
        tracks, points = self._triangulated(tracks, far_off=far_off)
        if len(tracks) == 0:
            return 0.0
        moved, L_here = prior.moved_to(self._state, L)
        A, b = pose_information(tracks, points, self._state.poses, self._sensor)
        step = most_likely(L_here, A, b + A @ moved[: len(A)]) - moved
        self._state = self._state.corrected(step, prior.covariance)
        return largest_turn(step)

    def _step(self, prior: FilterState, L: FloatArray, due: Sightings, *, still: bool) -> None:
        """``prior`` updated with what is linearised at the state of now, which it replaces.

        Parameters
        ----------
        L
            Root of the prior's covariance.
        """
        moved, L_here = prior.moved_to(self._state, L)
        already = solve_triangular(L, moved, lower=True, check_finite=False)
        Z, r = self._rows(due, L_here, already)
        if still and len(self._state) >= 3:
            Z_still, r_still = equal_poses(self._state, self._linearization(), L_here, self._config)
            Z, r = np.concatenate([Z, Z_still]), np.concatenate([r, r_still + Z_still @ already])
        if len(r) == 0:
            self._state = prior
            return
        with self._timer.stage("solve"):
            error, covariance = self._posterior(L_here, Z, r)
            self._state = self._state.corrected(error - moved, covariance)

    def _rows(
        self, due: Sightings, L: FloatArray, already: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Z (k, n) and r (k,) of the tracks that pass, r against the prior.

        The state of now lies L times ``already`` (n,) from the prior.
        """
        with self._timer.stage("triangulate"):
            due, points = self._triangulated(due)
        if len(due) == 0:
            return np.zeros((0, len(L))), np.zeros(0)
        with self._timer.stage("linearize"):
            poses, at = self._state.poses, self._linearization()
            points_at = carried(points, due, poses, at)
            H_x, H_f = jacobians(due, points_at, at, self._sensor)
            Q = orthonormal_columns(H_f, due)
            rows = without_point(times_root(H_x, due, L), Q, due)
            r = residuals(due, points, poses, self._sensor)
            r = without_point(r[..., None], Q, due)[..., 0]
            r += rows @ already
        with self._timer.stage("gate"):
            passed = gate(rows, r, due, self._config.gate_probability)
            self._count(due, ~passed, "rejected_chi_square")
            self._count(due, passed, "used")
            used = passed[due.track]
        return rows[used].reshape(-1, len(L)), r[used].ravel()

    def _posterior(
        self, L: FloatArray, Z: FloatArray, r: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        return updated(L, Z, r)

    def _triangulated(
        self, due: Sightings, *, far_off: bool = False
    ) -> tuple[Sightings, FloatArray]:
        """The tracks that may be used, and their points (M, 3); the others are counted."""
        c = self._config
        single = due.lengths < 2
        self._count(due, single, "single_view")
        short = ~single & (due.lengths < c.min_track_length)
        self._count(due, short, "rejected_short")
        due = due.select(due.lengths >= c.min_track_length)
        if len(due) == 0:
            return due, np.zeros((0, 3))
        cameras = camera_poses(self._state.poses, self._sensor.T_imu_cam)
        points = triangulate(due, cameras, c.refinement_steps)
        good = np.ones(len(due), dtype=bool)
        for passed, reason in (
            (points.condition < c.max_condition, "rejected_degenerate"),
            (points.in_front, "rejected_behind_camera"),
            (points.distance < c.landmark_distance, "rejected_far"),
        ):
            self._count(due, good & ~passed, reason)
            good &= passed
        due, position = due.select(good), points.position[good]
        if len(due) == 0:
            return due, position
        if c.fej:  # first estimates may have a near point behind a camera that saw it
            at = self._linearization()
            there = carried(position, due, self._state.poses, at)
            ahead = least_depth(due, there, at, self._sensor) > LEAST_DEPTH_M
            self._count(due, ~ahead, "rejected_behind_camera")
            due, position = due.select(ahead), position[ahead]
            if len(due) == 0:
                return due, position
        off = np.linalg.norm(residuals(due, position, self._state.poses, self._sensor), axis=1)
        worst_px = np.maximum.reduceat(off, due.starts) * self._sensor.pixel_noise_px
        close = far_off | (worst_px < c.outlier_px)
        self._count(due, ~close, "rejected_outlier")
        return due.select(close), position[close]

    def _linearization(self) -> Poses:
        return self._state.linearization_poses(self._config.fej)

    def _count(self, sightings: Sightings, tracks: BoolArray, fate: str) -> None:
        if number := int(sightings.lengths[tracks].sum()):
            self._counts[fate] += number

    def _drop_oldest(self) -> None:
        pose = from_rotation_translation(self._state.poses.R[0], self._state.poses.p[0])
        self._left.append((self._state.stamps_ns[0], pose))
        self._state = self._state.without_oldest()
        self._tracks.drop_oldest()
