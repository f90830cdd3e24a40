"""The doctor: whether a recording is fit to run, and if not, which of its numbers is wrong.

:func:`examine` looks at stamps, units, lens, images, and at what two sensors say of the same
rotation; see docs/doctor.md for every check, its threshold and where that comes from.
"""

from __future__ import annotations

from p2gd_fgo.doctor.examine import Examination, examine
from p2gd_fgo.doctor.report import FIT, FIT_WITH_WARNINGS, NOT_FIT, TOO_LITTLE, Finding, Report

__all__ = [
    "FIT",
    "FIT_WITH_WARNINGS",
    "NOT_FIT",
    "TOO_LITTLE",
    "Examination",
    "Finding",
    "Report",
    "examine",
]
