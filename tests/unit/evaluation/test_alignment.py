"""Alignments against evo's own and against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from evo.core import metrics
from evo.core.trajectory import PosePath3D
from scipy.optimize import minimize

from p2gd_fgo.evaluation.alignment import ALIGNMENTS, align, align_yaw_pos
from p2gd_fgo.evaluation.trajectory_errors import absolute
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import FloatArray


def wandering(seed: int, count: int = 60) -> tuple[FloatArray, FloatArray]:
    """A drifting estimate (N, 4, 4) and its reference, in different frames."""
    rng = np.random.default_rng(seed)
    rotations = so3.exp(np.cumsum(rng.normal(scale=0.1, size=(count, 3)), axis=0))
    positions = np.cumsum(rng.normal(size=(count, 3)), axis=0)
    reference = from_rotation_translation(rotations, positions)
    noise = so3.exp(np.cumsum(rng.normal(scale=0.01, size=(count, 3)), axis=0))
    drift = np.cumsum(rng.normal(scale=0.05, size=(count, 3)), axis=0)
    estimate = from_rotation_translation(rotations @ noise, 1.05 * positions + drift)
    frame = from_rotation_translation(so3.exp(rng.normal(size=3)), 10.0 * rng.normal(size=3))
    return frame @ estimate, reference


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["se3", "sim3", "origin"])
def test_errors_equal_those_of_evo(kind: str, seed: int) -> None:
    estimate, reference = wandering(seed)
    transform = align(kind, estimate, reference)
    assert transform is not None
    position_m, rotation_deg = absolute(transform.apply(estimate), reference)

    theirs, truth = PosePath3D(poses_se3=list(estimate)), PosePath3D(poses_se3=list(reference))
    if kind == "origin":
        theirs.align_origin(truth)
    else:
        _, _, scale = theirs.align(truth, correct_scale=kind == "sim3")
        assert transform.scale == pytest.approx(scale, abs=1e-12)
    for relation, ours in (
        (metrics.PoseRelation.translation_part, position_m),
        (metrics.PoseRelation.rotation_angle_deg, rotation_deg),
    ):
        ape = metrics.APE(relation)
        ape.process_data((truth, theirs))
        np.testing.assert_allclose(ours, ape.error, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_yaw_pos_is_the_minimum_over_yaw_and_position(seed: int) -> None:
    estimate, reference = wandering(seed)
    p, q = estimate[:, :3, 3], reference[:, :3, 3]

    def cost(parameters: FloatArray) -> float:
        R = so3.exp(np.array([0.0, 0.0, parameters[0]]))
        return float(np.mean(np.sum((p @ R.T + parameters[1:] - q) ** 2, axis=1)))

    starts = [np.array([yaw, 0.0, 0.0, 0.0]) for yaw in (-2.0, 0.0, 2.0)]
    best = min((minimize(cost, start, tol=1e-12) for start in starts), key=lambda r: float(r.fun))
    transform = align_yaw_pos(estimate, reference)
    found = transform.apply(estimate)[:, :3, 3]
    assert np.mean(np.sum((found - q) ** 2, axis=1)) == pytest.approx(float(best.fun), rel=1e-9)
    expected = so3.exp(np.array([0.0, 0.0, best.x[0]]))
    np.testing.assert_allclose(transform.T[:3, :3], expected, atol=1e-4)


@pytest.mark.parametrize("kind", ALIGNMENTS)
def test_the_frame_is_found_back(kind: str) -> None:
    _, reference = wandering(1)
    frame = from_rotation_translation(so3.exp(np.array([0.0, 0.0, 2.0])), np.array([5.0, -3, 1]))
    estimate = frame @ reference
    if kind == "sim3":
        estimate[:, :3, 3] *= 0.5
    transform = align(kind, estimate, reference)
    assert transform is not None
    np.testing.assert_allclose(transform.apply(estimate), reference, atol=1e-9)
    assert transform.scale == pytest.approx(2.0 if kind == "sim3" else 1.0)


def test_mirrored_points_give_a_rotation() -> None:
    _, reference = wandering(2)
    estimate = reference.copy()
    estimate[:, 0, 3] *= -1.0
    transform = align("se3", estimate, reference)
    assert transform is not None
    assert np.linalg.det(transform.T[:3, :3]) == pytest.approx(1.0)


def test_straight_line_determines_no_full_rotation() -> None:
    reference = np.tile(np.eye(4), (20, 1, 1))
    reference[:, 0, 3] = np.arange(20.0)
    assert align("se3", reference, reference) is None
    assert align("sim3", reference, reference) is None
    for kind in ("yaw_pos", "origin"):
        transform = align(kind, reference, reference)
        assert transform is not None
        np.testing.assert_allclose(transform.T, np.eye(4), atol=1e-12)


def test_standing_still_takes_yaw_from_orientation() -> None:
    rng = np.random.default_rng(0)
    reference = np.tile(np.eye(4), (30, 1, 1))
    estimate = from_rotation_translation(
        so3.exp(np.array([0.0, 0.0, 1.0])), 1e-4 * rng.normal(size=(30, 3))
    )
    transform = align_yaw_pos(estimate, reference)
    position_m, rotation_deg = absolute(transform.apply(estimate), reference)
    assert rotation_deg.max() < 1e-6
    assert position_m.max() < 1e-3


def test_unknown_name_is_refused() -> None:
    with pytest.raises(ValueError, match="yaw_pos"):
        align("procrustes", np.eye(4)[None], np.eye(4)[None])
