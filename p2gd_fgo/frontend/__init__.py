"""Feature extraction and tracking: images in, observations of tracks out."""

from __future__ import annotations

from p2gd_fgo.frontend.cells import CellGrid
from p2gd_fgo.frontend.features import FeatureBuffer
from p2gd_fgo.frontend.frontend import Frontend
from p2gd_fgo.frontend.health import ImageHealth
from p2gd_fgo.frontend.selection import CellQuotas, Corners, Selection
from p2gd_fgo.frontend.track_summary import TrackSummary

__all__ = [
    "CellGrid",
    "CellQuotas",
    "Corners",
    "FeatureBuffer",
    "Frontend",
    "ImageHealth",
    "Selection",
    "TrackSummary",
]
