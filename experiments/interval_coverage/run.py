"""How often does the interval of a paired comparison cover the effect? Prints a table in markdown.

One row for each model of the errors and number of pairs and routes, one column for each kind of
effect: share of draws covered in percent, and the median width of the interval in percent of the
baseline. The percentile interval of the same hierarchical bootstrap stands beside it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np

from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.evaluation.bootstrap import EffectKind, by_route, effect, resampled
from p2gd_fgo.evaluation.synthetic_pairs import PairModel, draw_pairs, spread_over

MODELS = {
    "as measured": PairModel(),
    "no route effect": PairModel(route_effect=0.0),
    "route effect 0.5": PairModel(route_effect=0.5),
    "noisy runs 0.6": PairModel(run=0.6),
    "route difficulty 1.0": PairModel(difficulty=1.0),
    "t, 4 degrees": PairModel(tail="t4"),
    "skewed": PairModel(tail="skewed"),
}
DESIGNS = ((30, 12), (12, 12), (36, 12), (120, 12), (48, 24), (15, 5), (9, 3))
KINDS: tuple[EffectKind, ...] = ("geometric", "mean", "rms")


def job(item: tuple[tuple[int, int], str], cases: int, change: float, draws: int) -> list[str]:
    (pairs, routes), name = item
    route, rng = spread_over(pairs, routes), np.random.default_rng([pairs, routes])
    true = np.log1p(change)
    covered = {(kind, way): 0 for kind in KINDS for way in ("t", "percentile")}
    widths: dict[EffectKind, list[float]] = {kind: [] for kind in KINDS}
    for case in range(cases):
        sample = by_route(*draw_pairs(MODELS[name], route, change, rng), route)
        for kind in KINDS:
            found = effect(sample, kind, draws=draws, seed=case)
            assert found is not None
            covered[kind, "t"] += found.low <= change <= found.high
            widths[kind].append(found.high - found.low)
            low, high = np.quantile(resampled(sample, kind, draws=draws, seed=case), [0.025, 0.975])
            covered[kind, "percentile"] += bool(low <= true <= high)
    cells = [
        f"{100 * covered[kind, 't'] / cases:.1f} | {100 * np.median(widths[kind]):.0f} | "
        f"{100 * covered[kind, 'percentile'] / cases:.1f}"
        for kind in KINDS
    ]
    return [f"{pairs} / {routes}", name, *cells]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000, help="draws of a whole study a row")
    parser.add_argument("--draws", type=int, default=999, help="of the bootstrap")
    parser.add_argument("--change", type=float, default=-0.2, help="true effect")
    parser.add_argument("--quick", action="store_true", help="the first two designs, 200 cases")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    designs = DESIGNS[:2] if options.quick else DESIGNS
    cases = 200 if options.quick else options.cases
    write = sys.stdout.write
    heads = [f"{kind} % | width | percentile %" for kind in KINDS]
    write(f"| pairs / routes | errors | {' | '.join(heads)} |\n|{'---|' * 11}\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        items = list(product(designs, MODELS))
        futures = [pool.submit(job, item, cases, options.change, options.draws) for item in items]
        for future in futures:
            write(f"| {' | '.join(future.result())} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
