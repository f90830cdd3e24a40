"""Quotas that make the motion over the horizon best known (docs/d_optimal.md)."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.types import FloatArray, IntArray


def d_optimal(
    information: FloatArray, prior: FloatArray, capacity: IntArray, total: int
) -> IntArray:
    """Quotas that greedily maximise log det(prior + Σ n_c Λ_c).

    Each feature goes where it raises the determinant most; of equal cells, to the one with the
    lowest index. The objective is monotone and submodular over the features' places, so that the
    gain is at least 1 − 1/e of the best one (Nemhauser, Wolsey and Fisher, "An analysis of
    approximations for maximizing submodular set functions", 1978).

    Parameters
    ----------
    information
        (C, 6, 6) Λ_c, what one feature of the cell brings.
    prior
        (6, 6) positive definite, what is known without any feature.
    capacity
        (C,) features that a cell can hold.
    total
        Features to be spread.

    Returns
    -------
    IntArray
        (C,) quotas; they sum to less than ``total`` where the cells with information can't hold
        it. Cells without information get nothing.

    Raises
    ------
    numpy.linalg.LinAlgError
        The prior is not positive definite.
    """
    quotas = np.zeros(len(capacity), dtype=np.int64)
    left = np.array(capacity)
    # In units of the prior's standard deviations, so that no determinant under- or overflows.
    whitening = np.linalg.inv(np.linalg.cholesky(prior))
    whitened = whitening @ information @ whitening.T
    cells = np.flatnonzero((left > 0) & (np.trace(whitened, axis1=1, axis2=2) > 0.0))
    candidates = whitened[cells]
    known = np.eye(len(prior))
    for _ in range(min(total, int(left[cells].sum()))):
        best = int(np.argmax(np.linalg.det(known + candidates)))
        known = known + candidates[best]
        cell = cells[best]
        quotas[cell] += 1
        left[cell] -= 1
        if left[cell] == 0:
            cells = np.delete(cells, best)
            candidates = np.delete(candidates, best, axis=0)
    return quotas


def first_gains(information: FloatArray, prior: FloatArray) -> FloatArray:
    """Gain in log det (C,) of a cell's first feature, for pictures; ``prior`` (6, 6)."""
    more = np.eye(len(prior)) + np.linalg.solve(prior, information)
    return np.asarray(np.linalg.slogdet(more)[1])
