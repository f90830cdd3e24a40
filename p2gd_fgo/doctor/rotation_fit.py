"""Fit of the gyro to rotations that something else measured: offset in time, axes, scale, bias.

The rotation vectors φ_k of intervals (from image to image, or between poses of the truth) are
compared with the gyro's integral θ_k over the same :mod:`intervals <p2gd_fgo.doctor.intervals>`,
moved by τ::

    φ_k = e^s Exp(δ) M θ_k(τ) + c dt_k

M is a hypothesis of how the axes of the two belong together, δ and s a small rotation and scale
that it may be wrong by, c the gyro's bias.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from p2gd_fgo.doctor.intervals import GyroIntegral, Intervals
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray

MAX_SHIFT_S = 2.0
"""Offsets in time are looked for this far on both sides."""

SIGMA_TILT = np.radians(3.0)
"""A priori error of a hypothesis' axes: of a camera mounted by hand, 1 sigma, rad."""

SIGMA_SCALE = 0.03
"""A priori error of a gyro's scale and of a focal length, 1 sigma."""

_COARSE_S = 0.005
_TAIL = 9.0  # squared sigmas at which an interval's weight halves
_STEPS = 12
_PARAMETERS = 8  # τ, δ (3), s, c (3)
_MIN_SHARE = 0.5  # of the intervals that must lie inside the IMU after a shift
_MIN_INTERVALS = 20
_SIGMA_FLOOR = 2e-5  # rad; below it rotations are rounding


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The best parameters around one hypothesis.

    Attributes
    ----------
    shift_s
        τ: the gyro is read at the interval's time plus this.
    matrix
        (3, 3) Exp(δ) M without e^s.
    delta
        (3,) rotation vector of δ, rad, in the measuring sensor's axes.
    scale
        e^s times the scale of the hypothesis: size of φ over size of θ.
    bias
        (3,) the gyro's, in its own axes and units.
    cost
        Robust sum of squared sigmas, the prior's included.
    covariance
        (8, 8) of τ, δ, s, c: the larger of what the noise says and what the scatter between
        stretches says.
    inflation
        Factor of that second covariance on the first, median over the parameters, at least 1.
    residual
        (N, 3) rad.
    explained
        Share of the variance of φ that the fit explains.
    """

    shift_s: float
    matrix: FloatArray
    delta: FloatArray
    scale: float
    bias: FloatArray
    cost: float
    covariance: FloatArray
    inflation: float
    residual: FloatArray
    explained: float

    @property
    def sigma_shift_s(self) -> float:
        """1 sigma of the shift."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def sigma_delta(self) -> FloatArray:
        """(3,) 1 sigma of δ, rad."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[1:4]))

    @property
    def sigma_scale(self) -> float:
        """1 sigma of the scale, relative."""
        return float(np.sqrt(self.covariance[4, 4]))


class RotationFit:
    """Fits hypotheses to the same intervals, with the same noise.

    Parameters
    ----------
    gyro
        Of the recording.
    intervals
        Those whose gyro has a gap, or isn't there, are left out.
    shift_s
        Where τ is expected.
    """

    def __init__(self, gyro: GyroIntegral, intervals: Intervals, shift_s: float) -> None:
        covered = gyro.covered(intervals.begin_s + shift_s, intervals.end_s + shift_s)
        self.intervals = intervals.subset(covered)
        self._gyro, self._expected = gyro, shift_s
        self._dt = self.intervals.end_s - self.intervals.begin_s
        self._sigma = np.full(3, 1.0)

    @property
    def enough(self) -> bool:
        """Whether there is anything to fit."""
        return len(self.intervals) >= _MIN_INTERVALS

    @cached_property
    def start(self) -> tuple[float, FloatArray, float]:
        """τ, M (3, 3) and scale of the best of all rotations and reflections, on a grid of τ.

        The noise for everything that follows is taken from it.
        """
        weight = np.ones(len(self.intervals))
        best = (-1.0, self._expected, np.eye(3), 1.0)
        for _ in range(3):
            best = max(self._coarse(weight), key=lambda item: item[0])
            residual = self._residual(best[1], best[3] * best[2])
            sigma = _spread(residual)
            weight = 1.0 / (1.0 + ((residual / sigma) ** 2).sum(axis=1) / _TAIL)
        self._sigma = sigma
        for _ in range(2):
            fit = self._descend(best[1], best[2], best[3], free=True)
            self._sigma = _spread(fit.residual)
        return fit.shift_s, fit.matrix, fit.scale

    def fit(self, matrix: FloatArray, scale: float, *, quick: bool = False) -> Fit:
        """The best fit near M (3, 3) and a scale.

        τ may be anywhere; ``quick``: near that of :attr:`start`.
        """
        begins = [self.start[0]]
        if not quick:
            begins += [self._expected, self._best_shift(matrix)]
        fits = [self._descend(begin, matrix, scale, free=False) for begin in begins]
        return min(fits, key=lambda fit: fit.cost)

    def _shifts(self) -> FloatArray:
        count = round(MAX_SHIFT_S / _COARSE_S)
        return np.asarray(self._expected + _COARSE_S * np.arange(-count, count + 1), np.float64)

    def _moments(self, shift: float, weight: FloatArray) -> tuple[FloatArray, float, float] | None:
        """Cross moment (3, 3) of φ and θ and both traces, centred; None where too few are left."""
        begin, end = self.intervals.begin_s + shift, self.intervals.end_s + shift
        w = weight * self._gyro.covered(begin, end)
        if (w > 0).mean() < _MIN_SHARE:
            return None
        theta = self._gyro.rotation(begin, end)
        rate = (w @ theta / (w @ self._dt), w @ self.intervals.phi / (w @ self._dt))
        theta = theta - self._dt[:, None] * rate[0]
        phi = self.intervals.phi - self._dt[:, None] * rate[1]
        cross = (phi * w[:, None]).T @ theta
        return cross, float(w @ (phi**2).sum(axis=1)), float(w @ (theta**2).sum(axis=1))

    def _coarse(self, weight: FloatArray) -> list[tuple[float, float, FloatArray, float]]:
        """Correlation, τ, best orthogonal matrix and scale at every τ of the grid."""
        out = [(-1.0, self._expected, np.eye(3), 1.0)]
        for shift in self._shifts():
            moments = self._moments(shift, weight)
            if moments is None or min(moments[1:]) <= 0.0:
                continue
            U, s, Vt = np.linalg.svd(moments[0])
            correlation = s.sum() / np.sqrt(moments[1] * moments[2])
            out.append((correlation, float(shift), U @ Vt, s.sum() / moments[2]))
        return out

    def _best_shift(self, matrix: FloatArray) -> float:
        best, where = -np.inf, self._expected
        weight = np.ones(len(self.intervals))
        for shift in self._shifts():
            moments = self._moments(shift, weight)
            if moments is None or min(moments[1:]) <= 0.0:
                continue
            correlation = np.trace(matrix.T @ moments[0]) / np.sqrt(moments[1] * moments[2])
            if correlation > best:
                best, where = correlation, float(shift)
        return where

    def _residual(self, shift: float, matrix: FloatArray) -> FloatArray:
        """(N, 3), the median rate taken out."""
        begin, end = self.intervals.begin_s + shift, self.intervals.end_s + shift
        r = self.intervals.phi - self._gyro.rotation(begin, end) @ matrix.T
        return np.asarray(r - self._dt[:, None] * np.median(r / self._dt[:, None], axis=0))

    def _descend(self, shift: float, matrix: FloatArray, scale: float, *, free: bool) -> Fit:
        """Gauss-Newton from a start; ``free``: without the prior on δ and s."""
        phi, dt = self.intervals.phi, self._dt[:, None]
        prior = np.zeros(_PARAMETERS)
        if not free:
            prior[1:4], prior[4] = SIGMA_TILT**-2, SIGMA_SCALE**-2
        x = np.zeros(_PARAMETERS)
        x[0] = shift
        x[5:] = np.median(self._rates(shift, scale * matrix), axis=0)
        cost, damping = np.inf, 1e-3
        accepted = None
        for _ in range(_STEPS):
            r, J, w = self._linearize(x, matrix, scale)
            new = float(_TAIL * np.log1p((r**2).sum(axis=1) / _TAIL).sum() + prior @ x**2)
            if new <= cost:
                done = cost - new < 1e-6 * max(new, 1.0)
                cost, damping, accepted = new, damping * 0.3, (x, r, J, w)
                if done:
                    break
            else:
                damping *= 10.0
            x0, r0, J0, w0 = accepted if accepted is not None else (x, r, J, w)
            A = J0 * w0[:, None, None]
            H = np.einsum("nij,nik->jk", A, J0) + np.diag(prior)
            g = np.einsum("nij,ni->j", A, r0) + prior * x0
            x = x0 - np.linalg.solve(H + damping * np.diag(np.diag(H) + 1e-12), g)
            x[0] = np.clip(x[0], self._expected - MAX_SHIFT_S, self._expected + MAX_SHIFT_S)
        assert accepted is not None
        x, r, J, w = accepted
        residual = r * self._sigma
        turned = so3.exp(x[1:4]) @ matrix
        gain = scale * float(np.exp(x[4]))
        spread = phi - dt * (w @ phi / (w @ self._dt))
        explained = 1.0 - float(w @ (residual**2).sum(axis=1)) / float(
            w @ (spread**2).sum(axis=1) + 1e-30
        )
        covariance, inflation = self._covariance(r, J, w, prior)
        return Fit(
            shift_s=float(x[0]),
            matrix=turned,
            delta=x[1:4].copy(),
            scale=gain,
            bias=np.asarray(-np.linalg.solve(gain * turned, x[5:]), dtype=np.float64),
            cost=cost,
            covariance=covariance,
            inflation=inflation,
            residual=residual,
            explained=explained,
        )

    def _rates(self, shift: float, matrix: FloatArray) -> FloatArray:
        begin, end = self.intervals.begin_s + shift, self.intervals.end_s + shift
        r = self.intervals.phi - self._gyro.rotation(begin, end) @ matrix.T
        return np.asarray(r / self._dt[:, None])

    def _linearize(
        self, x: FloatArray, matrix: FloatArray, scale: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residuals (N, 3) and Jacobian (N, 3, 8) in sigmas, weights (N,)."""
        begin, end = self.intervals.begin_s + x[0], self.intervals.end_s + x[0]
        gain = scale * np.exp(x[4]) * (so3.exp(x[1:4]) @ matrix)
        predicted = self._gyro.rotation(begin, end) @ gain.T
        r = self.intervals.phi - predicted - self._dt[:, None] * x[5:]
        J = np.empty((len(r), 3, _PARAMETERS))
        J[:, :, 0] = -self._gyro.rate_change(begin, end) @ gain.T
        J[:, :, 1:4] = so3.hat(predicted)
        J[:, :, 4] = -predicted
        J[:, :, 5:] = -self._dt[:, None, None] * np.eye(3)
        r, J = r / self._sigma, J / self._sigma[:, None]
        w = self._gyro.covered(begin, end) / (1.0 + (r**2).sum(axis=1) / _TAIL)
        return r, J, w

    def _covariance(
        self, r: FloatArray, J: FloatArray, w: FloatArray, prior: FloatArray
    ) -> tuple[FloatArray, float]:
        A = J * w[:, None, None]
        information = np.einsum("nij,nik->jk", A, J) + np.diag(prior + 1e-12)
        inverse = np.linalg.inv(information)
        scores = np.einsum("nij,ni->nj", A, r)
        stretches = np.unique(self.intervals.stretch)
        sums = np.stack([scores[self.intervals.stretch == k].sum(axis=0) for k in stretches])
        count = len(stretches)
        scattered = inverse @ (sums.T @ sums) @ inverse * count / max(count - 1, 1)
        factor = np.maximum(np.diag(scattered) / np.diag(inverse), 1.0)
        root = np.sqrt(factor)
        return np.asarray(inverse * np.outer(root, root)), float(np.median(factor))


def _spread(residual: FloatArray) -> FloatArray:
    """(3,) robust standard deviation, rad."""
    return np.asarray(np.maximum(1.4826 * np.median(np.abs(residual), axis=0), _SIGMA_FLOOR))
