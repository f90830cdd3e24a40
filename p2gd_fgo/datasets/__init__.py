"""Recordings: what they look like to the pipeline, and the formats that can be read."""

from __future__ import annotations

from p2gd_fgo.datasets.base import Calibration, ImuNoise, Sequence
from p2gd_fgo.datasets.images import load_mask
from p2gd_fgo.datasets.opening import open_sequence

__all__ = ["Calibration", "ImuNoise", "Sequence", "load_mask", "open_sequence"]
