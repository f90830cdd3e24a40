"""Which hypothesis about axes and units explains the rotations best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from p2gd_fgo.doctor.axes import Axes
from p2gd_fgo.doctor.rotation_fit import SIGMA_TILT, Fit, RotationFit
from p2gd_fgo.types import FloatArray

Kind = Literal["expected", "inverse", "axes", "free"]

UNITS = {"rad/s": 1.0, "deg/s": np.pi / 180.0, "rad/s, divided by 57.3 once more": 180.0 / np.pi}
"""What a gyro's numbers may be, and the factor that makes rad/s of them."""

_GATE = 30.0
_OCCAM = 6.0  # per change: a likelihood ratio of 20
_UNIT_TOLERANCE = 0.3
_DETERMINED = 0.7  # of the prior's sigma: what is above has learnt nothing from the data
_POOR = 0.5
_SIGNAL = 3e-3  # rad a interval, ten times the noise of rotations from flow


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """M (3, 3) of :mod:`p2gd_fgo.doctor.rotation_fit`, and what it would mean."""

    kind: Kind
    matrix: FloatArray
    changes: int
    axes: Axes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """The simplest hypothesis that explains the rotations.

    Attributes
    ----------
    hypothesis
        What it is.
    fit
        The parameters around it.
    unit
        Key of :data:`UNITS`.
    scale
        What remains of the scale when the unit is taken out.
    excess
        By how much the expected hypothesis is worse, in squared sigmas; the gate is 30 of them,
        more where errors are correlated in time.
    gate
        That gate.
    """

    hypothesis: Hypothesis
    fit: Fit
    unit: str
    scale: float
    excess: float
    gate: float

    @property
    def explains(self) -> bool:
        """Whether the fit is one at all."""
        return self.fit.explained > _POOR

    @property
    def determined(self) -> tuple[bool, ...]:
        """About which axes of the measuring sensor δ is determined."""
        return tuple((self.fit.sigma_delta < _DETERMINED * SIGMA_TILT).tolist())


def match(fitter: RotationFit, expected: FloatArray, others: Sequence[Hypothesis]) -> Match:
    """Compare hypotheses; the expected one stays unless another is better beyond doubt.

    Parameters
    ----------
    fitter
        With enough intervals.
    expected
        (3, 3) M as it should be.
    others
        The alternatives; looked at only where the expected one explains less than the best of all
        rotations and reflections does.
    """
    _, free, scale = fitter.start
    unit = nearest_unit(scale)
    base = Hypothesis("expected", expected, 0)
    expected_fit = fitter.fit(expected, UNITS[unit])
    free_fit = fitter.fit(free, UNITS[unit])
    gate = _GATE * free_fit.inflation
    if expected_fit.cost - free_fit.cost < gate:
        return _made(base, expected_fit, unit, expected_fit.cost - free_fit.cost, gate)
    if np.linalg.det(free) > 0:
        others = [*others, Hypothesis("free", free, 6)]
    tried = [(base, expected_fit)]
    tried += [(other, fitter.fit(other.matrix, UNITS[unit], quick=True)) for other in others]
    price = _OCCAM * free_fit.inflation
    best, fit = min(tried, key=lambda item: item[1].cost + price * item[0].changes)
    if expected_fit.cost - fit.cost < gate:
        best, fit = base, expected_fit
    return _made(best, fit, unit, expected_fit.cost - fit.cost, gate)


def nearest_unit(scale: float) -> str:
    """The unit that explains a scale within 30 %, rad/s where none does."""
    for name, factor in UNITS.items():
        if abs(np.log(scale / factor)) < _UNIT_TOLERANCE:
            return name
    return "rad/s"


def _made(hypothesis: Hypothesis, fit: Fit, unit: str, excess: float, gate: float) -> Match:
    return Match(hypothesis, fit, unit, fit.scale / UNITS[unit], excess, gate)


def signal(phi: FloatArray) -> bool:
    """Whether rotations (N, 3) are large enough to say anything."""
    spread = phi - np.median(phi, axis=0)
    return bool(np.sqrt((spread**2).sum(axis=1).mean()) > _SIGNAL)
