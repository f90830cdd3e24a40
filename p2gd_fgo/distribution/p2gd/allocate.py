"""From the cells' weights to their quotas (paper III-B4, Algorithm 1)."""

from __future__ import annotations

import math

import numpy as np

from p2gd_fgo.types import BoolArray, FloatArray, IntArray

_ROUNDING = 1e-9  # so that ceil(3.0000000001) is 3


def proportional(weights: FloatArray, capacity: IntArray, total: int) -> IntArray:
    """Quotas in proportion to the weights, then evenly what is left (Algorithm 1).

    The cells are visited by descending weight; each gets the share of what is left that its
    weight has in the weight that is left, rounded up, within its capacity. What the weighted cells
    can't take goes evenly to the others.

    Parameters
    ----------
    weights
        (cells,) not negative.
    capacity
        (cells,) features that a cell can hold.
    total
        Features to give away.

    Returns
    -------
    IntArray
        (cells,) their sum is ``total``, or the sum of the capacities if that is less.
    """
    order = np.argsort(-weights, kind="stable")
    falling = weights[order]
    weight_left = np.cumsum(falling[::-1])[::-1]
    shares = (falling / np.maximum(weight_left, np.finfo(float).tiny)).tolist()
    caps = capacity[order].tolist()
    quotas, left = [0] * len(caps), total
    for k in range(int(np.count_nonzero(falling))):
        quotas[k] = min(math.ceil(shares[k] * left - _ROUNDING), caps[k], left)
        left -= quotas[k]
        if left == 0:
            break
    out = np.zeros(len(caps), np.int64)
    out[order] = quotas
    return evenly(out, capacity, left, first=out == 0) if left else out


def evenly(quotas: IntArray, capacity: IntArray, left: int, first: BoolArray) -> IntArray:
    """Quotas raised by ``left`` in all, within the capacity.

    Parameters
    ----------
    quotas, capacity
        (cells,)
    left
        Features to give away.
    first
        (cells,) true for the cells that are served before the others.
    """
    out = quotas.copy()
    for group in (first, np.ones(len(out), np.bool_)):
        while left > 0:
            room = np.flatnonzero(group & (out < capacity))
            if len(room) == 0:
                break
            share = math.ceil(left / len(room))
            give = np.minimum(share, capacity[room] - out[room])
            before = np.concatenate([[0], np.cumsum(give)[:-1]])
            give = np.clip(left - before, 0, give)
            out[room] += give
            left -= int(give.sum())
    return out
