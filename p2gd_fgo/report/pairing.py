"""How a trajectory made elsewhere, which has no seed, is paired with our runs, which have."""

from __future__ import annotations

from collections.abc import Sequence

from p2gd_fgo.evaluation.record_pairs import Choice, select
from p2gd_fgo.run_record import RunRecord

_SEED = "seed"


def across_seeds(records: Sequence[RunRecord], a: Choice, b: Choice) -> tuple[str, ...]:
    """``across`` of a comparison: the seed's axis where one side alone is without it."""
    has = [any(_SEED in record.axes for record in select(records, side)) for side in (a, b)]
    return (_SEED,) if has[0] != has[1] else ()
