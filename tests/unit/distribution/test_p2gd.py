"""P2GD as a whole, on hand-made scenes: a camera that drives through known points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from p2gd_fgo.config import DistributionConfig, P2gdConfig
from p2gd_fgo.datasets.base import ImuNoise
from p2gd_fgo.distribution import Decision, DistributionContext, Sensors, make_distribution
from p2gd_fgo.frontend import CellGrid, CellQuotas, FeatureBuffer
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import RadTanCamera
from p2gd_fgo.geometry.pose import from_rotation_translation, inverse, transform
from p2gd_fgo.priors import PriorProblem
from p2gd_fgo.types import FloatArray, IntArray, PriorPoses, Trajectory

CAMERA = RadTanCamera(640, 480, 400.0, 400.0, 319.5, 239.5, -0.1, 0.01, 0.0, 0.0)
GRID = CellGrid(8, 6, 640, 480)
FEATURES = 96
HISTORY, HORIZON = 20, 20
STEP_NS = 100_000_000
SENSORS = Sensors(ImuNoise(1e-3, 1e-5, 1e-2, 1e-4), 9.81, 1.0)
# Body x forward, y left, z up; camera z forward, x right, y down.
T_IMU_CAM = from_rotation_translation(
    np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.1, 0.0, 0.2])
)


def _drive(past: int, speed: float, turn: float, turned: float = 0.0) -> Trajectory:
    """Poses at 10 Hz, ``past`` before now and HORIZON after; rad per image after and before now."""
    yaw = np.concatenate([turned * np.arange(1 - past, 1), turn * np.arange(1, HORIZON + 1)])
    heading = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))])
    start = np.array([[0.0, 0.0, 1.5]])
    p = np.concatenate([start, start + np.cumsum(speed * heading, axis=0)])
    angles = np.column_stack(
        [np.zeros((past + HORIZON + 1, 2)), np.concatenate([[-turned * past], yaw])]
    )
    stamps = STEP_NS * np.arange(len(p), dtype=np.int64)
    return Trajectory(stamps, from_rotation_translation(so3.exp(angles), p))


def _street(rng: np.random.Generator) -> FloatArray:
    """Walls left and right, the road, and a facade at the far end; nothing above them: sky."""
    x = rng.uniform(3, 55, 1500)
    side = np.where(np.arange(1500) % 2, 12.0, -12.0)
    walls = np.column_stack([x, side, rng.uniform(0.0, 6.0, 1500)])
    road = np.column_stack([rng.uniform(3, 40, 700), rng.uniform(-9, 9, 700), np.zeros(700)])
    end = np.column_stack([np.full(300, 55.0), rng.uniform(-12, 12, 300), rng.uniform(0, 6, 300)])
    return np.concatenate([walls, road, end])


def _seen(buffer: FeatureBuffer, points: FloatArray, path: Trajectory, upto: int) -> FeatureBuffer:
    """Let the buffer see the points from the path's poses 0 to upto; those seen now stay."""
    poses = [T @ T_IMU_CAM for T in path.T_world_imu[: upto + 1]]
    here = transform(inverse(poses[-1]), points)
    points = points[CAMERA.visible(here)]
    lengths = np.zeros(len(points), np.int64)
    buffer.add(np.zeros((len(points), 2)), np.zeros((len(points), 2)))
    buffer.pixel_history[:] = buffer.normalized_history[:] = np.nan
    for stamp, T in zip(path.stamps_ns[: upto + 1].tolist(), poses, strict=True):
        local = transform(inverse(T), points)
        visible = CAMERA.visible(local)
        lengths = np.where(visible, lengths + 1, 0)
        plane = np.where(visible[:, None], local[:, :2] / local[:, 2:], np.nan)
        buffer.advance(stamp, CAMERA.distort(plane), plane)
    buffer.lengths = np.minimum(lengths, buffer.history)
    return buffer


def _context(
    speed: float = 0.8,
    turn: float = 0.0,
    *,
    turned: float = 0.0,
    past: int = 8,
    points: FloatArray | None = None,
    priors: PriorPoses | PriorProblem | None = None,
) -> DistributionContext:
    path = _drive(past, speed, turn, turned)
    if points is None:
        points = _street(np.random.default_rng(0))
    now = path.T_world_imu[past]
    ahead = inverse(now) @ path.T_world_imu[past + 1 :]
    return DistributionContext(
        CAMERA,
        T_IMU_CAM,
        _seen(FeatureBuffer(HISTORY), points, path, past),
        Trajectory(path.stamps_ns[: past + 1], path.T_world_imu[: past + 1]),
        priors or PriorPoses(path.stamps_ns[past + 1 :], ahead),
        GRID.capacities(30.0),
        np.ones(GRID.shape, np.int64),
    )


def _decide(context: DistributionContext, **options: object) -> Decision:
    config = DistributionConfig(kind="p2gd", p2gd=P2gdConfig.model_validate(options))
    return make_distribution(config, GRID, FEATURES, SENSORS).decide(context)


def _quotas(decision: Decision) -> IntArray:
    assert isinstance(decision.selection, CellQuotas)
    return decision.selection.quotas


def _weights(decision: Decision) -> FloatArray:
    assert decision.explanation is not None
    return decision.explanation.weights


def test_a_right_turn_starves_the_left_edge() -> None:
    straight, right = _decide(_context()), _decide(_context(turn=np.radians(-4.0)))
    left_column, right_column = np.s_[2:5, 0], np.s_[2:5, 6:]
    assert _weights(right)[left_column].sum() < 0.4 * _weights(straight)[left_column].sum()
    assert _weights(right)[left_column].sum() < 0.4 * _weights(right)[right_column].mean(1).sum()
    assert _quotas(right)[left_column].sum() < _quotas(straight)[left_column].sum()


def test_a_cell_without_3d_points_gets_nothing() -> None:
    decision = _decide(_context())
    assert (_weights(decision)[0, 2:6] == 0).all()  # sky
    assert (_quotas(decision)[0, 2:6] == 0).all()


def test_straight_ahead_gets_less_than_the_sides() -> None:
    weights, quotas = _weights(_decide(_context())), _quotas(_decide(_context()))
    ahead = np.s_[2:3, 3:5]
    assert weights[ahead].mean() < 0.4 * weights[2:4, [1, 2, 5, 6]].mean()
    assert quotas[ahead].mean() < quotas[2:4, [1, 2, 5, 6]].mean()


def test_the_quotas_sum_to_the_total() -> None:
    for turn in (0.0, 0.05, -0.05):
        assert _quotas(_decide(_context(turn=turn))).sum() == FEATURES


def test_predictions_agree_with_what_then_happens() -> None:
    context = _context(turn=0.02)
    explained = _decide(context).explanation
    assert explained is not None
    path = _drive(8, 0.8, 0.02)
    for i in range(HORIZON + 1):
        local = transform(inverse(path.T_world_imu[8 + i] @ T_IMU_CAM), explained.points)
        np.testing.assert_array_equal(
            np.isfinite(explained.pixels[:, i, 0]) & ~CAMERA.visible(local), False
        )
        seen = np.isfinite(explained.pixels[:, i, 0])
        np.testing.assert_allclose(
            explained.pixels[seen, i], CAMERA.project(local[seen]), atol=1e-4
        )
    assert len(explained.points) > 100
    assert 3 < explained.lengths.mean() < HORIZON


@pytest.mark.parametrize(
    "context",
    [
        replace(_context(), recent=Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))),
        _context(past=1),  # two images: nothing is triangulated yet
        _context(points=np.array([[500.0, 0.0, 1.0]])),  # too far
        _context(priors=PriorProblem("priors_missing", "no prior poses")),
    ],
    ids=["before the start", "first images", "nothing near", "no priors"],
)
def test_without_knowledge_it_is_the_grid(context: DistributionContext) -> None:
    decision = _decide(context)
    grid = make_distribution(DistributionConfig(), GRID, FEATURES, SENSORS).decide(context)
    np.testing.assert_array_equal(_quotas(decision), _quotas(grid))
    wanted_priors = isinstance(context.priors, PriorProblem)
    assert (decision.problem is context.priors) == wanted_priors


def test_standing_still_can_fall_back_to_the_grid() -> None:
    context = _context()
    rng = np.random.default_rng(1)
    shaken = from_rotation_translation(np.eye(3), rng.normal(0, 1e-4, (HORIZON, 3)))
    assert isinstance(context.priors, PriorPoses)
    still = replace(context, priors=PriorPoses(context.priors.stamps_ns, shaken))
    assert _quotas(_decide(still)).std() > 1  # the paper's behaviour: noise decides
    even = _quotas(_decide(still, still_parallax_px=0.2))
    np.testing.assert_array_equal(even, np.full(GRID.shape, 2))
    moving = _decide(context, still_parallax_px=0.2)
    np.testing.assert_array_equal(_quotas(moving), _quotas(_decide(context)))


def test_a_floor_keeps_textured_cells_alive_within_the_total() -> None:
    context = _context()
    corners = np.ones(GRID.shape, np.int64)
    corners[0, :4] = 0
    quotas = _quotas(_decide(replace(context, corners=corners), floor=0.5))
    assert (quotas[corners > 0] >= 1).all()
    assert (quotas[corners == 0] == 0).all()
    assert quotas.sum() == FEATURES


def test_cells_that_a_turn_brings_into_view_can_get_a_share() -> None:
    context = _context(turned=np.radians(5.0))  # to the left, 15° in three images
    without = _quotas(_decide(context))
    given = _quotas(_decide(context, share_new_cells=True))
    assert (without[:, :2] < 2).sum() > 4
    assert (given[:, :2] >= 2).all()
    assert given.sum() == FEATURES
    ahead = _context()
    np.testing.assert_array_equal(
        _quotas(_decide(ahead, share_new_cells=True)), _quotas(_decide(ahead))
    )


def test_d_optimal_gives_everything_away_and_keeps_far_cells_in_play() -> None:
    far = np.random.default_rng(2).uniform([150, -20, -10], [200, 20, 20], (400, 3))
    context = _context(points=np.concatenate([_street(np.random.default_rng(0)), far]))
    gates = {"max_depth": 1000.0, "max_condition": 1e8}
    parallax = _quotas(_decide(context, scene=gates))
    optimal = _decide(context, scene=gates, allocate="d_optimal")
    assert _quotas(optimal).sum() == FEATURES
    assert (_quotas(optimal) <= context.capacity).all()
    ahead = np.s_[2, 3:5]
    assert _quotas(optimal)[ahead].sum() > parallax[ahead].sum()
    floor = _quotas(_decide(context, scene=gates, allocate="d_optimal", floor=0.5))
    assert (floor >= 1).all()
    assert floor.sum() == FEATURES


def test_masked_cells_and_points_are_out() -> None:
    context = _context()
    allowed = np.ones((480, 640), np.bool_)
    allowed[:, :200] = False  # two columns of cells and half of the third
    masked = replace(context, allowed=allowed, capacity=GRID.capacities(30.0, allowed))
    decision = _decide(masked)
    assert (_quotas(decision)[:, :2] == 0).all()
    assert decision.explanation is not None
    assert (decision.explanation.pixels[:, 0, 0] >= 199.5).all()
    assert _quotas(decision).sum() == FEATURES


def test_points_seen_often_are_kept_and_complete_tracks_stay() -> None:
    config = DistributionConfig(kind="p2gd")
    distribution = make_distribution(config, GRID, FEATURES, SENSORS)
    first = _context(past=HISTORY - 1, speed=0.1)
    explained = distribution.decide(first).explanation
    assert explained is not None
    assert not explained.kept.any()
    complete = first.buffer.lengths >= HISTORY
    first.buffer.keep(~complete)  # consumed
    again = distribution.decide(first).explanation
    assert again is not None
    assert again.kept.sum() > 100  # they stay in the scene

    lost = make_distribution(config, GRID, FEATURES, SENSORS)
    context = _context(past=12, speed=0.1)  # seen 13 times: firm, but not complete
    lost.decide(context)
    held = lost.decide(context).explanation
    assert held is not None
    assert held.kept.sum() > 100
    context.buffer.keep(np.zeros(len(context.buffer), np.bool_))
    after = lost.decide(context).explanation
    assert after is not None
    assert len(after.points) == 0


def test_points_that_the_first_predicted_camera_does_not_see_are_forgotten() -> None:
    distribution = make_distribution(DistributionConfig(kind="p2gd"), GRID, FEATURES, SENSORS)
    context = _context(past=12, speed=0.3)
    assert isinstance(context.priors, PriorPoses)
    away = context.priors.T_imu0_imu @ from_rotation_translation(
        so3.exp(np.array([0.0, 0.0, np.pi])), np.zeros(3)
    )
    distribution.decide(replace(context, priors=PriorPoses(context.priors.stamps_ns, away)))
    explained = distribution.decide(context).explanation
    assert explained is not None
    assert len(explained.points) > 100
    assert not explained.kept.any()


def test_points_out_of_view_are_forgotten_without_priors_too() -> None:
    distribution = make_distribution(DistributionConfig(kind="p2gd"), GRID, FEATURES, SENSORS)
    context = _context(past=HISTORY - 1, speed=0.1)
    distribution.decide(context)
    context.buffer.keep(np.zeros(len(context.buffer), np.bool_))  # consumed: the scene has them
    recent = context.recent
    turn = from_rotation_translation(so3.exp(np.array([0.0, 0.0, np.pi])), np.zeros(3))
    back = Trajectory(recent.stamps_ns, recent.T_world_imu @ turn)
    distribution.decide(replace(context, recent=back, priors=None))
    explained = distribution.decide(context).explanation
    assert explained is not None and len(explained.points) == 0


def test_the_same_context_gives_the_same_quotas() -> None:
    np.testing.assert_array_equal(_quotas(_decide(_context())), _quotas(_decide(_context())))
