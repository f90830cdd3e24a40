"""The ways in which a sensor's axes get mixed up, and their names."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from p2gd_fgo.types import FloatArray

_NAMES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """A signed permutation: true axes = ``matrix`` (3, 3) times the recorded ones.

    ``changes`` counts what was done to them: signs flipped, and two for each swap.
    """

    matrix: FloatArray
    changes: int

    @property
    def mirrored(self) -> bool:
        """Whether handedness changes, which no way of mounting a sensor does."""
        return bool(np.linalg.det(self.matrix) < 0)

    def describe(self) -> str:
        """In words."""
        order = np.abs(self.matrix).argmax(axis=1)
        signs = self.matrix[np.arange(3), order]
        if (order == np.arange(3)).all():
            flipped = [_NAMES[k] for k in range(3) if signs[k] < 0]
            if not flipped:
                return "as recorded"
            return f"the sign of {' and '.join(flipped)} is wrong"
        moved = [k for k in range(3) if order[k] != k]
        if len(moved) == 2 and (signs > 0).all():
            return f"{_NAMES[moved[0]]} and {_NAMES[moved[1]]} are swapped"
        read = ", ".join(f"{'−' if signs[k] < 0 else ''}{_NAMES[order[k]]}" for k in range(3))
        return f"x, y, z should be read as {read}"


def all_axes() -> tuple[Axes, ...]:
    """All 48 signed permutations, the fewest changes first; the first is the identity."""
    made = []
    for order in permutations(range(3)):
        moved = sum(order[k] != k for k in range(3))
        swaps = max(moved - 1, 0)
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[np.arange(3), order] = signs
            made.append(Axes(matrix, 2 * swaps + sum(s < 0 for s in signs)))
    return tuple(sorted(made, key=lambda axes: axes.changes))
