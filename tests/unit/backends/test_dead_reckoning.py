"""The IMU alone: exact without noise, consistent with it."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.base import check_sane
from p2gd_fgo.backends.dead_reckoning import DeadReckoning
from p2gd_fgo.evaluation.consistency import nees, pose_error
from p2gd_fgo.evaluation.feature_runs import START_COVARIANCE
from p2gd_fgo.imu import between
from p2gd_fgo.initialization.given import disturbed
from p2gd_fgo.simulation.imu import MEMS_NOISE, SimulatedImu, synthesize_imu
from p2gd_fgo.simulation.routes import CAR, ROBOT, VehicleModel, make_route
from p2gd_fgo.simulation.trajectory import KinematicState, SplineTrajectory
from p2gd_fgo.types import Estimate, NavState, Observations

BEGIN_NS = 1_000_000_000
STEP_NS = 10_000_000


def reckon(
    route: SplineTrajectory, imu: SimulatedImu, end_ns: int, rng: np.random.Generator | None
) -> tuple[Estimate, KinematicState]:
    truth = route.sample(np.array([BEGIN_NS, end_ns]))
    first = int(np.searchsorted(imu.batch.stamps_ns, BEGIN_NS))
    state = NavState(
        BEGIN_NS, truth.T_world_imu[0], truth.velocity[0],
        imu.gyro_bias[first], imu.accel_bias[first],
    )  # fmt: skip
    backend = DeadReckoning(MEMS_NOISE, 9.81)
    if rng is not None:
        state = disturbed(state, START_COVARIANCE, rng)
    backend.start(state, START_COVARIANCE)
    backend.propagate(between(imu.batch, BEGIN_NS, end_ns))
    nothing = Observations(end_ns, np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)))
    estimate = backend.update(nothing, stationary=False)
    check_sane(estimate)
    assert len(backend.finish()) == 1
    return estimate, truth


def samples(route: SplineTrajectory) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    first, last = route.span_ns
    return np.arange(first + STEP_NS, last - STEP_NS, STEP_NS)


def exact_position_error(model: VehicleModel, duration_s: int) -> float:
    rng = np.random.default_rng(0)
    route = make_route(model, duration_s, rng)
    imu = synthesize_imu(route, samples(route), None, rng)
    end_ns = BEGIN_NS + duration_s * 1_000_000_000
    estimate, truth = reckon(route, imu, end_ns, None)
    return float(np.linalg.norm(estimate.state.T_world_imu[:3, 3] - truth.T_world_imu[1, :3, 3]))


def test_noiseless_samples_give_the_route_back() -> None:
    assert exact_position_error(CAR, 60) < 5e-3
    assert exact_position_error(ROBOT, 60) < 5e-3


def test_covariance_says_how_large_the_errors_are() -> None:
    """Mean NEES of 15 degrees of freedom over 80 starts and noises, within 4 sigma."""
    rng = np.random.default_rng(1)
    route = make_route(CAR, 3, rng)
    stamps = samples(route)
    end_ns = BEGIN_NS + 3_000_000_000
    errors, covariances = [], []
    for _ in range(80):
        imu = synthesize_imu(
            route, stamps, MEMS_NOISE, rng, gyro_bias=np.full(3, 0.01), accel_bias=np.full(3, 0.1)
        )
        estimate, truth = reckon(route, imu, end_ns, rng)
        s, last = estimate.state, int(np.searchsorted(stamps, end_ns))
        pose = pose_error(s.T_world_imu[None], truth.T_world_imu[1:])[0]
        errors.append(
            np.concatenate(
                [
                    pose,
                    truth.velocity[1] - s.velocity,
                    imu.gyro_bias[last] - s.gyro_bias,
                    imu.accel_bias[last] - s.accel_bias,
                ]
            )
        )
        covariances.append(estimate.covariance)
    mean = nees(np.array(errors), np.array(covariances)).mean()
    assert abs(mean - 15.0) < 4.0 * np.sqrt(2.0 * 15.0 / 80.0)
