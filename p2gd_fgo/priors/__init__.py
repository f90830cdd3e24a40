"""Prior poses: where the robot's planner will drive."""

from __future__ import annotations

from p2gd_fgo.priors.base import PriorProblem, PriorSource
from p2gd_fgo.priors.factory import make_prior_source
from p2gd_fgo.priors.image_times import ImageTimes
from p2gd_fgo.priors.intake import PriorIntake

__all__ = ["ImageTimes", "PriorIntake", "PriorProblem", "PriorSource", "make_prior_source"]
