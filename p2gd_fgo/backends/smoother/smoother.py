"""The fixed-lag smoother: one dense Gauss-Newton problem per image, exact marginalisation."""

from __future__ import annotations

from collections import Counter

import gtsam
import numpy as np
from gtsam.symbol_shorthand import V, X
from numpy.linalg import LinAlgError
from scipy.linalg import cho_solve, cholesky, solve_triangular

from p2gd_fgo.backends.base import with_decayed_bias, with_steady_bias
from p2gd_fgo.backends.smoother.marginalization import Prior, marginalize_oldest
from p2gd_fgo.backends.smoother.preintegration import Preintegrator
from p2gd_fgo.backends.smoother.tracks import Track, TrackFactors
from p2gd_fgo.backends.smoother.window import (
    WindowStates,
    error_covariance,
    window_covariance,
)
from p2gd_fgo.config import BackendConfig
from p2gd_fgo.datasets.base import Calibration, ImuNoise
from p2gd_fgo.errors import EstimatorError
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.imu import UnknownMotion, duration_s, integrate
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.types import (
    ERROR_DIM,
    Estimate,
    FloatArray,
    ImuBatch,
    NavState,
    Observations,
    Trajectory,
)

_ANCHOR_REACH_M = 5.0


class Smoother:
    """Back end of the factor graph: states of the last ``window`` images.

    Parameters
    ----------
    calibration
        Camera and extrinsic.
    noise
        IMU densities, inflation already in.
    gravity
        m/s².
    config
        Window length, pixel noise and the smoother's own settings.
    timer
        Stages ``linearize``, ``solve``, ``marginalize`` are timed in it.
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
        self._config = config.smoother
        self._noise, self._gravity = noise, gravity
        self._timer = timer or StageTimer()
        self._preintegrator = Preintegrator(noise, gravity)
        self._tracks = TrackFactors(
            calibration.camera, calibration.T_imu_cam, config.pixel_noise_px, config.smoother
        )
        self._states = WindowStates.empty()
        self._motion: dict[int, list[gtsam.NonlinearFactor]] = {}
        self._frame = 0
        self._anchor = np.zeros(3)
        self._next: tuple[ImuBatch, UnknownMotion | None, NavState] | None = None
        self._left: list[tuple[int, FloatArray]] = []
        self._counts: Counter[str] = Counter()

    def start(self, state: NavState, covariance: FloatArray) -> None:
        """Begin at ``state``; its covariance becomes the first prior."""
        self._states = self._states.append(self._frame, state)
        in_window = window_covariance(covariance, state.T_world_imu[:3, :3])
        information = np.asarray(np.linalg.inv(in_window), dtype=np.float64)
        self._prior = Prior(self._states, information, np.zeros(ERROR_DIM))

    def propagate(self, imu: ImuBatch, unknown: UnknownMotion | None = None) -> NavState:
        """Predict the next image's state and keep the samples for its factor."""
        newest = self._states.newest()
        imu = with_steady_bias(imu, newest, self._noise)
        predicted = with_decayed_bias(
            integrate(newest, imu, self._gravity), self._noise, duration_s(imu)
        )
        self._next = imu, unknown, predicted
        return predicted

    def update(self, observations: Observations, stationary: bool) -> Estimate:
        """Add the image's state and sightings, optimise, and let the oldest image go."""
        if self._next is not None:
            self._append_state(*self._next)
            self._next = None
        self._counts["observations"] += len(observations)
        self._move_anchor()
        if stationary:
            self._hold_still()
            self._counts["muted_standing_still"] += len(observations)
        else:
            self._tracks.add(observations, self._frame)
        try:
            covariance = self._optimize_letting_go(observations.stamp_ns)
            estimate = Estimate(
                self._states.newest(),
                error_covariance(covariance, self._states.R[-1]),
                self._states.trajectory(),
                stationary,
            )
            if len(self._states) >= self._size:
                with self._timer.stage("marginalize"):
                    self._marginalize(observations.stamp_ns)
        except RuntimeError as error:  # what GTSAM throws
            reason = f"GTSAM refused the window, {str(error).splitlines()[0]}: diverged"
            raise EstimatorError(observations.stamp_ns, reason) from error
        return estimate

    def finish(self) -> Trajectory:
        """All poses as they left the window, then those still in it."""
        rest = self._states.trajectory()
        left_stamps = np.array([t for t, _ in self._left], dtype=np.int64)
        left_poses = np.array([T for _, T in self._left]).reshape(-1, 4, 4)
        return Trajectory(
            np.concatenate([left_stamps, rest.stamps_ns]),
            np.concatenate([left_poses, rest.T_world_imu]),
        )

    @property
    def counts(self) -> dict[str, int]:
        """Observations by fate: all of them add up to ``observations``.

        Beside them ``iterations``, and ``gate_opened`` where that was.
        """
        live = {"in_window": self._tracks.live_observations()}
        opened = Counter(gate_opened=self._tracks.gate_opened)
        return dict(self._counts + self._tracks.counts + opened) | live

    def _append_state(
        self, imu: ImuBatch, unknown: UnknownMotion | None, predicted: NavState
    ) -> None:
        i, j = self._frame, self._frame + 1
        bias = self._states.bias[-1]
        self._motion[i] = self._preintegrator.factors(imu, bias, i, j, unknown)
        self._frame = j
        self._states = self._states.append(j, predicted)

    def _move_anchor(self) -> None:
        """Keep the origin of GTSAM's positions near.

        GTSAM triangulates linearly in homogeneous coordinates, whose result depends on where the
        origin is: seen from far away, points of little parallax come out biased and are rejected.
        Everything else in the window is relative, so the origin is free to move.
        """
        newest = self._states.p[-1]
        if np.linalg.norm(newest - self._anchor) > _ANCHOR_REACH_M:
            self._anchor = newest.copy()

    def _hold_still(self) -> None:
        """No velocity at the image before this one, and the pose of the image before that.

        What is asserted lies one image back: the detector looks at a window, and its newest image
        may already have begun to move by less than it can see.
        """
        if len(self._states) < 3:
            return
        c = self._config
        i, j = self._frame - 2, self._frame - 1
        sigmas = [np.radians(c.sigma_still_rotation_deg)] * 3 + [c.sigma_still_position] * 3
        self._motion[i] += [
            gtsam.PriorFactorVector(
                V(j), np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, c.sigma_still_velocity)
            ),
            gtsam.BetweenFactorPose3(
                X(i), X(j), gtsam.Pose3(), gtsam.noiseModel.Diagonal.Sigmas(np.array(sigmas))
            ),
        ]

    def _optimize_letting_go(self, stamp_ns: int) -> FloatArray:
        """Optimise; where GTSAM throws on tracks behind a camera, once more without them."""
        try:
            return self._optimize(stamp_ns)
        except RuntimeError:
            if not self._tracks.drop_those_behind(self._states.values(self._anchor)):
                raise
        return self._optimize(stamp_ns)

    def _optimize(self, stamp_ns: int) -> FloatArray:
        """Gauss-Newton on the window; the newest state's covariance (15, 15), GTSAM's order.

        Tracks that the newest image doesn't see hardly move: they are linearised once, and join
        the prior for the steps after the first.
        """
        with self._timer.stage("linearize"):
            values = self._states.values(self._anchor)
            graph, settled_tracks = self._tracks.usable(self._frame, values)
            settled = self._with_settled(settled_tracks, values)
        for factors in self._motion.values():
            for factor in factors:
                graph.push_back(factor)
        dim = ERROR_DIM * len(self._states)
        for iteration in range(self._config.iterations):
            with self._timer.stage("linearize"):
                if iteration > 0:
                    values = self._states.values(self._anchor)
                H, b = self._dense(graph, values)
            with self._timer.stage("solve"):
                settled.add_to(H, b, self._states)
                try:
                    L = cholesky(H.T, lower=True, overwrite_a=True, check_finite=False)
                except LinAlgError:
                    raise EstimatorError(
                        stamp_ns, "the window's system is singular: the estimator diverged"
                    ) from None
                delta = cho_solve((L, True), b, check_finite=False)
                self._states = self._states.retract(delta)
            self._counts["iterations"] += 1
            step = float(np.sqrt(max(float(delta @ b), 0.0) / dim))
            if not np.isfinite(step):
                raise EstimatorError(stamp_ns, "a Gauss-Newton step is not finite: diverged")
            if step < self._config.step_tolerance:
                break
        corner = solve_triangular(
            L[-ERROR_DIM:, -ERROR_DIM:], np.eye(ERROR_DIM), lower=True, check_finite=False
        )
        return np.asarray(corner.T @ corner)

    def _with_settled(self, tracks: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> Prior:
        """The prior and what the tracks without a sighting in the newest image say."""
        if tracks.size() == 0:
            return self._prior
        H, b = self._dense(tracks, values)
        self._prior.add_to(H, b, self._states)
        return Prior(self._states, H, b)

    def _dense(
        self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
    ) -> tuple[FloatArray, FloatArray]:
        """The graph linearised at the window's values: information, in the window's order."""
        dim = ERROR_DIM * len(self._states)
        if graph.size() == 0:
            return np.zeros((dim, dim)), np.zeros(dim)
        linear = graph.linearize(values)
        present = linear.keys()
        keys = self._states.keys()
        known = [present.count(key) > 0 for key in keys]
        ordering = gtsam.Ordering()
        for key, is_known in zip(keys, known, strict=True):
            if is_known:
                ordering.push_back(key)
        H, b = linear.hessian(ordering)
        H = H.T  # symmetric, but stored by columns: the prior is added by rows
        if all(known):
            return H, b.ravel()
        # Keys that no factor touches have no dimension in GTSAM's matrix: put it in its place.
        sizes = np.tile([6, 3, 6], len(self._states))
        index = np.flatnonzero(np.repeat(known, sizes))
        H_all, b_all = np.zeros((dim, dim)), np.zeros(dim)
        H_all[np.ix_(index, index)] = H
        b_all[index] = b.ravel()
        return H_all, b_all

    def _marginalize(self, stamp_ns: int) -> None:
        """Fold the oldest state, its motion factors and its tracks into the prior."""
        oldest = self._states.frames[0]
        values = self._states.values(self._anchor)
        graph = gtsam.NonlinearFactorGraph()
        for factor in self._motion.pop(oldest):
            graph.push_back(factor)
        for track in self._fold(self._tracks.take_starting_at(oldest), values):
            graph.push_back(track.factor)
        H, b = self._dense(graph, values)
        self._prior.add_to(H, b, self._states)
        try:
            self._prior = marginalize_oldest(H, b, self._states)
        except LinAlgError:
            raise EstimatorError(
                stamp_ns, "the oldest state can't be marginalised: the estimator diverged"
            ) from None
        pose = from_rotation_translation(self._states.R[0], self._states.p[0])
        self._left.append((self._states.stamps_ns[0], pose))
        self._states = self._states.part(slice(1, None))

    def _fold(self, tracks: list[Track], values: gtsam.Values) -> list[Track]:
        """The tracks that enter the prior."""
        return self._tracks.accept(tracks, values)
