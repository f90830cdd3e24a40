"""The Kalman update, in coordinates in which the prior error is white.

With P = L Lᵀ and error = L y, y is white before the update, a measurement r = H error + n with unit
noise says r = Z y + n with Z = H L, and the information about y afterwards is M = I + ZᵀZ. So

    P⁺ = L M⁻¹ Lᵀ = Xᵀ X,  C Cᵀ = M,  C X = Lᵀ;   error = L M⁻¹ Zᵀ r.

It is the standard update, but P⁺ is symmetric and positive by construction, as in Joseph's form;
M is never near singular; and ZᵀZ compresses the rows as a QR would.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from p2gd_fgo.backends.gate import track_gate
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.types import BoolArray, FloatArray

# A millionth of the standard deviation on each error: keeps the factor of neighbouring poses that
# an excellent IMU ties together from failing by rounding.
_JITTER = 1e-12


def root(P: FloatArray) -> FloatArray:
    """L (n, n) lower with L Lᵀ = P.

    Raises
    ------
    numpy.linalg.LinAlgError
        P is not positive definite.
    """
    out = P.copy()
    diagonal = np.einsum("ii->i", out)
    diagonal *= 1.0 + _JITTER
    return np.asarray(cholesky(out, lower=True, overwrite_a=True, check_finite=False))


def updated(L: FloatArray, Z: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Error estimate (n,) and covariance (n, n) after rows Z (k, n), r (k,) of unit noise."""
    M = Z.T @ Z
    diagonal = np.einsum("ii->i", M)
    diagonal += 1.0
    C = cholesky(M, lower=True, overwrite_a=True, check_finite=False)
    X = solve_triangular(C, L.T, lower=True, check_finite=False)
    error = L @ cho_solve((C, True), Z.T @ r, check_finite=False)
    return error, X.T @ X


def most_likely(L: FloatArray, A: FloatArray, b: FloatArray) -> FloatArray:
    """Error estimate (n,) after information A (m, m) and b (m,) about the first m errors."""
    seen = L[: len(A)]
    M = seen.T @ (A @ seen)
    diagonal = np.einsum("ii->i", M)
    diagonal += 1.0
    C = cholesky(M, lower=True, overwrite_a=True, check_finite=False)
    return np.asarray(L @ cho_solve((C, True), seen.T @ b, check_finite=False))


def gate(Z: FloatArray, r: FloatArray, sightings: Sightings, probability: float) -> BoolArray:
    """(M,) tracks whose squared Mahalanobis distance a consistent filter would exceed rarely.

    Parameters
    ----------
    Z, r
        (O, 2, n), (O, 2) without the point: of a track with k sightings, 2 k − 3 degrees of
        freedom.
    probability
        Share of good tracks that pass.
    """
    passed = np.zeros(len(sightings), dtype=bool)
    for length in np.unique(sightings.lengths).tolist():
        tracks = np.flatnonzero(sightings.lengths == length)
        rows = sightings.starts[tracks][:, None] + np.arange(length)
        Zs = Z[rows].reshape(len(tracks), 2 * length, -1)
        rs = r[rows].reshape(len(tracks), 2 * length, 1)
        S = Zs @ np.swapaxes(Zs, -1, -2) + np.eye(2 * length)
        distance = np.sum(rs * np.linalg.solve(S, rs), axis=(1, 2))
        passed[tracks] = distance < track_gate(probability, length)
    return passed
