"""Random windows and matrices for the tests of the smoother's parts."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.backends.smoother.window import WindowStates
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.pose import from_rotation_translation
from p2gd_fgo.types import FloatArray, NavState


def random_window(rng: np.random.Generator, n: int) -> WindowStates:
    states = WindowStates.empty()
    for k in range(n):
        T = from_rotation_translation(so3.exp(rng.normal(size=3)), rng.normal(size=3) * 5.0)
        nav = NavState(k * 100, T, rng.normal(size=3), 0.1 * rng.normal(size=3), rng.normal(size=3))
        states = states.append(k, nav)
    return states


def random_information(rng: np.random.Generator, size: int) -> FloatArray:
    A = rng.normal(size=(size, size))
    return np.asarray(A @ A.T + size * np.eye(size))
