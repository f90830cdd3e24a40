"""How good a trajectory is: alignment, absolute and relative errors, consistency."""

from __future__ import annotations
