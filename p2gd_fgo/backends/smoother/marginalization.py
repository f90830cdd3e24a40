"""What is left of states that have gone: a quadratic prior on the states that stay.

The prior's energy is ½ dᵀ H d − bᵀ d, d being the chart difference between the states and those
at which the prior was made. Its linearisation stays there; as the states move it is re-centred,
which is exact up to the chart's second order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from p2gd_fgo.backends.smoother.window import WindowStates
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import ERROR_DIM, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """H (15 n, 15 n) and b (15 n,) about ``states``, which are the window's first n states."""

    states: WindowStates
    H: FloatArray
    b: FloatArray

    def add_to(self, H: FloatArray, b: FloatArray, states: WindowStates) -> None:
        """Add the prior, re-centred at ``states``, to the window's dense system in place."""
        n = len(self.states)
        now = states.part(slice(0, n))
        size = n * ERROR_DIM
        if self.states.equals(now):
            H[:size, :size] += self.H
            b[:size] += self.b
            return
        d = self.states.local(now)
        # The chart's Jacobian is the identity but for rotation and position.
        J = np.zeros((n, 6, 6))
        J[:, 0:3, 0:3] = so3.right_jacobian_inverse(d[:, 0:3])
        J[:, 3:6, 3:6] = np.swapaxes(self.states.R, -1, -2) @ now.R
        Jt = np.swapaxes(J, -1, -2)
        centred = self.H.copy()
        for _ in range(2):  # Jᵀ H J as Jᵀ (Jᵀ H)ᵀ: rows are contiguous, columns are not
            rows = centred.reshape(n, ERROR_DIM, size)
            rows[:, 0:6] = Jt @ rows[:, 0:6]
            centred = np.ascontiguousarray(centred.T)
        gradient = (self.b - self.H @ d.ravel()).reshape(n, ERROR_DIM)
        gradient[:, 0:6] = (Jt @ gradient[:, 0:6, None])[..., 0]
        H[:size, :size] += centred
        b[:size] += gradient.ravel()


def marginalize_oldest(H: FloatArray, b: FloatArray, states: WindowStates) -> Prior:
    """Schur complement of the oldest state.

    Parameters
    ----------
    H, b
        (15 n, 15 n), (15 n,): only what touches the oldest state, and the old prior, all
        linearised at ``states`` (n of them).

    Raises
    ------
    numpy.linalg.LinAlgError
        The oldest state is not determined.
    """
    k = ERROR_DIM
    solved = cho_solve(
        cho_factor(H[:k, :k], lower=True, check_finite=False),
        np.column_stack([H[:k, k:], b[:k]]),
        check_finite=False,
    )
    H_rest = H[k:, k:] - H[k:, :k] @ solved[:, :-1]
    b_rest = b[k:] - H[k:, :k] @ solved[:, -1]
    return Prior(states.part(slice(1, None)), 0.5 * (H_rest + H_rest.T), b_rest)
