"""What cells can't serve goes to the others, whoever set the quotas."""

from __future__ import annotations

from dataclasses import replace

from p2gd_fgo.distribution.base import Decision, Distribution, DistributionContext
from p2gd_fgo.frontend import CellQuotas


class Refilled:
    """Another distribution's quotas, refilled up to each cell's capacity.

    Parameters
    ----------
    inner
        Sets the quotas; a selection of another kind stays as it is.
    """

    def __init__(self, inner: Distribution) -> None:
        self._inner = inner

    def decide(self, context: DistributionContext) -> Decision:
        """Decide for one image."""
        decision = self._inner.decide(context)
        if not isinstance(decision.selection, CellQuotas):
            return decision
        selection = replace(decision.selection, refill=True, capacity=context.capacity)
        return replace(decision, selection=selection)
