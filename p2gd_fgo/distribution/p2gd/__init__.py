"""Prior-pose-guided feature distribution: the paper's method, a file for each of its steps."""

from __future__ import annotations

from p2gd_fgo.distribution.p2gd.information import Sensors
from p2gd_fgo.distribution.p2gd.p2gd import P2gd

__all__ = ["P2gd", "Sensors"]
