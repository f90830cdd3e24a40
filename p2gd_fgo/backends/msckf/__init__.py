"""The multi-state constraint Kalman filter: the paper's own estimator (its III-C1)."""

from __future__ import annotations

from p2gd_fgo.backends.msckf.msckf import Msckf

__all__ = ["Msckf"]
