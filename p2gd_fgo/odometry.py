"""The online visual-inertial odometry: one method takes an image and gives an estimate."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict

import numpy as np

from p2gd_fgo.backends.base import Backend, check_sane, recent_poses
from p2gd_fgo.backends.factory import imu_noise, make_backend
from p2gd_fgo.backends.held_position import HeldPosition
from p2gd_fgo.config import Config, resolve
from p2gd_fgo.datasets.base import Calibration
from p2gd_fgo.distribution import Decision, DistributionContext, Sensors, make_distribution
from p2gd_fgo.frontend import Frontend, TrackSummary
from p2gd_fgo.imu_intake import ImuIntake
from p2gd_fgo.initialization import imu_history_s, imu_is_quiet, make_initializer, stillness
from p2gd_fgo.priors import PriorIntake, PriorSource, make_prior_source
from p2gd_fgo.timing import StageTimer
from p2gd_fgo.troubles import Trouble, TroubleWatch
from p2gd_fgo.types import (
    NANOSECONDS,
    Estimate,
    FloatArray,
    Image,
    ImuBatch,
    NavState,
    Observations,
    PriorPoses,
    Trajectory,
    Truth,
    Waiting,
)


class Odometry:
    """Front end, feature distribution and back end, joined as in the paper's Fig. 2.

    Parameters
    ----------
    calibration
        Camera, extrinsic, IMU noise.
    config
        Fields that depend on the image are filled here.
    truth
        For a start from truth; otherwise not looked at.
    mask
        In every image features only where this one, of the camera's size, is not 0.
    priors
        Asked for prior poses where none are handed in with an image; by default what
        ``config.priors`` names and needs no recording.
    timer
        Every stage of an image is timed in it.

    Raises
    ------
    ConfigError
        No IMU noise in the calibration or the configuration.
    DataError
        A start from truth without truth.
    """

    def __init__(
        self,
        calibration: Calibration,
        config: Config,
        *,
        truth: Truth | None = None,
        mask: Image | None = None,
        priors: PriorSource | None = None,
        timer: StageTimer | None = None,
    ) -> None:
        camera = calibration.camera
        self.config = config = resolve(config, camera.width)
        self.timer = timer or StageTimer()
        self._calibration = calibration
        offset_s = config.dataset.time_offset_s
        self.offset_ns = round(
            (calibration.time_offset_s if offset_s is None else offset_s) * NANOSECONDS
        )
        self._frontend = Frontend(camera, config.frontend, config.runtime.seed, mask)
        f = config.frontend
        p2gd = config.distribution.p2gd
        assert f.max_features is not None and p2gd.horizon is not None
        noise = imu_noise(config, calibration)
        self._distribution = make_distribution(
            config.distribution,
            self._frontend.grid,
            f.max_features,
            Sensors(noise, config.imu.gravity, config.backend.pixel_noise_px),
            config.runtime.seed,
        )
        self._before_tracking = p2gd.when == "before_tracking"
        self._needs_priors = config.distribution.kind == "p2gd"
        source = priors or make_prior_source(
            config.priors, p2gd.horizon, truth=None, image_stamps_ns=None, seed=config.runtime.seed
        )
        self._priors = PriorIntake(source, p2gd.horizon, config.priors)
        self._backend: Backend = make_backend(config, calibration, self.timer)
        self._initializer = make_initializer(config, calibration, noise, truth)
        history_s = max(config.stationary.window_s, imu_history_s(config)) + 0.5
        self._imu = ImuIntake(config.imu, history_s)
        self._held = HeldPosition(config.stationary.hold_after_s)
        self._watch = TroubleWatch()
        self.troubles: list[Trouble] = []
        self._last_handed: PriorPoses | None = None
        self._estimate: Estimate | None = None
        self.decision: Decision | None = None
        self.tracked = TrackSummary()
        self.extracted = 0
        self.start_note: str | None = None

    def add_imu(self, imu: ImuBatch) -> None:
        """Hand in samples, in order; those up to an image must be in before it.

        Raises
        ------
        DataError
            Not finite or not increasing in time.
        """
        self._imu.add(imu)

    def add_image(
        self,
        stamp_ns: int,
        image: Image,
        priors: PriorPoses | None = None,
        mask: Image | None = None,
    ) -> Estimate | Waiting:
        """Track, distribute, extract, estimate.

        Parameters
        ----------
        stamp_ns
            On the camera's clock.
        image
            (height, width) grey.
        priors
            Where the planner will drive, relative to the body at this image.
        mask
            Of the image's size; in this image features only where it is not 0, beside what the
            mask of all images says.

        Raises
        ------
        DataError
            The image's or mask's size, the image's stamp, or IMU samples that don't reach it.
        InitializationError
            The start is refused.
        EstimatorError
            The back end diverged.
        """
        stamp_ns += self.offset_ns
        state = None if self._estimate is None else self._estimate.state
        with self.timer.stage("frame"):
            imu, unknown = self._imu.interval(stamp_ns, state)
            with self.timer.stage("track"):
                health = self._frontend.look(image)
            # Before the start nothing is lost by tracking an image that shows nothing new.
            used = health.usable or state is None
            if used and self._before_tracking:
                self.decision = self._decide(None, self._last_handed)
            with self.timer.stage("track"):
                turn = self._imu.turn_since_tracked(stamp_ns, imu, state)
                self.tracked = self._track(stamp_ns, image, turn, mask, used=used)
                still = self._is_still(stamp_ns, used)
            with self.timer.stage("propagate"):
                predicted = None
                if state and imu:
                    predicted = self._held.moved(self._backend.propagate(imu, unknown))
            if used and not self._before_tracking:
                self.decision = self._decide(predicted, priors)
            with self.timer.stage("extract"):
                assert self.decision is not None
                self.extracted = self._frontend.extract(self.decision.selection) if used else 0
                observations = self._frontend.observations()
            self.troubles = self._watch.look(stamp_ns, health, self.tracked, unknown, used=used)
            self._last_handed = priors
            self._imu.passed(stamp_ns)
            if state is None:
                return self._try_to_start(observations)
            return self._update(observations, still)

    def finish(self) -> Trajectory:
        """The lag-smoothed poses; call once, after the last image.

        Raises
        ------
        InitializationError
            The estimator never started.
        """
        if self._estimate is None:
            raise self._initializer.refusal()
        return self._backend.finish()

    @property
    def counts(self) -> dict[str, int]:
        """The back end's account of observations; nothing before the start."""
        return {} if self._estimate is None else self._backend.counts

    @property
    def features(self) -> int:
        """Features seen in the newest image."""
        return len(self._frontend.observations())

    @property
    def observations(self) -> Observations:
        """The features of the newest image."""
        return self._frontend.observations()

    def count_into(self, counts: Counter[str]) -> None:
        """Add what the front end did with the newest image."""
        counts["images"] += 1
        counts["features"] += self.features
        counts["features_new"] += self.extracted
        for fate, number in asdict(self.tracked).items():
            counts[f"features_{fate}"] += number

    def _try_to_start(self, observations: Observations) -> Estimate | Waiting:
        start = self._initializer.attempt(
            observations.stamp_ns, self._imu.samples(), self._frontend.buffer
        )
        if isinstance(start, Waiting):
            return start
        self.start_note = start.note
        self._backend.start(start.state, start.covariance)
        return self._update(observations, still=False)

    def _update(self, observations: Observations, still: bool) -> Estimate:
        with self.timer.stage("update"):
            estimate = self._held.hold(self._backend.update(observations, still))
        check_sane(estimate)
        self._estimate = estimate
        return estimate

    def _track(
        self,
        stamp_ns: int,
        image: Image,
        turn: FloatArray | None,
        mask: Image | None,
        *,
        used: bool,
    ) -> TrackSummary:
        """Follow the features into an image; ``turn`` (3, 3) is that of the IMU, if known."""
        if not used:
            self._frontend.skip(stamp_ns)
            return TrackSummary()
        if turn is not None:
            R_imu_cam = self._calibration.T_imu_cam[:3, :3]
            turn = np.asarray(R_imu_cam.T @ turn.T @ R_imu_cam)
        self._imu.tracked(stamp_ns)
        return self._frontend.track(stamp_ns, image, turn, mask)

    def _is_still(self, stamp_ns: int, used: bool) -> bool:
        config = self.config.stationary
        if not config.enabled:
            return False
        was_still = self._estimate is not None and self._estimate.stationary
        if not used:  # what stands goes on standing as long as the IMU notices nothing
            return was_still and imu_is_quiet(stamp_ns, self._imu.samples(), config)
        return stillness(
            stamp_ns,
            self._imu.samples(),
            self._frontend.buffer,
            config.window_s,
            config,
            was_still=was_still,
        ).still

    def _decide(self, predicted: NavState | None, handed: PriorPoses | None) -> Decision:
        """What to extract, seen from the predicted pose, or else from the last estimate."""
        with self.timer.stage("distribute"):
            recent = recent_poses(self._estimate, predicted)
            frontend, priors = self._frontend, None
            if self._needs_priors and len(recent):
                priors = self._priors.take(int(recent.stamps_ns[-1]), handed, recent)
            return self._distribution.decide(
                DistributionContext(
                    self._calibration.camera,
                    self._calibration.T_imu_cam,
                    frontend.buffer,
                    recent,
                    priors,
                    frontend.capacity,
                    frontend.corner_counts,
                    frontend.allowed,
                )
            )
