"""Motion with a constant twist: what lies between two poses, and beyond them."""

from __future__ import annotations

from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation, interpolation_weights, inverse
from p2gd_fgo.types import FloatArray, IntArray, Trajectory


def along_screw(T: FloatArray, share: FloatArray) -> FloatArray:
    """Poses (N, 4, 4) after ``share`` (N,) of the screw motion that takes the identity to T.

    T (4, 4) or (N, 4, 4); shares above 1 go on beyond it. Rotation and translation along one
    screw, as a vehicle drives its arc (exponential coordinates of SE(3)).
    """
    turn = so3.log(T[..., :3, :3])
    # The left Jacobian at φ is the right one at −φ.
    way = so3.right_jacobian_inverse(-turn) @ T[..., :3, 3:]
    turns = share[:, None] * turn
    p = so3.right_jacobian(-turns) @ (share[:, None, None] * way)
    return from_rotation_translation(so3.exp(turns), p[..., 0])


def interpolate_screws(trajectory: Trajectory, query_ns: IntArray) -> FloatArray:
    """Poses (M, 4, 4) at ``query_ns`` (M,), along the screw between the neighbours.

    A planner's poses can lie a second apart, where a car's arc is 0.4 m off the straight line.
    Queries outside the trajectory take the nearest end: the caller decides what is covered.
    """
    i, j, share = interpolation_weights(trajectory.stamps_ns, query_ns)
    before = trajectory.T_world_imu[i]
    return before @ along_screw(inverse(before) @ trajectory.T_world_imu[j], share)
