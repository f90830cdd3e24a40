"""Visual-inertial odometry lab: P2GD feature distribution on a smoother and a filter.

Conventions, everywhere in the package
--------------------------------------
Frames
    ``T_a_b`` is the 4x4 matrix that takes points from b to a; ``p_a`` is a vector in a. The world
    has z up, gravity is (0, 0, -g). The body is the IMU. The camera looks along its z axis, x to
    the right, y down; ``T_imu_cam`` is the only extrinsic inside.
Time
    int64 nanoseconds. ``time_offset_s``: t_imu = t_cam + offset.
Units
    SI and radians; any other unit is in the name (``_deg``, ``_px``, ``_ns``, ``_ms``).
Rotations
    3x3 matrices inside; quaternions only in files (TUM: w last, EuRoC csv: w first).
Errors of states
    (δθ, δp, δv, δb_g, δb_a), R = R̂ Exp(δθ), the rest additive, δp and δv in the world.
"""

from __future__ import annotations

__version__ = "0.1.0"
