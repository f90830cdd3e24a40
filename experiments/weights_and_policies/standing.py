"""Every row against the mean of all rows, where one baseline's luck is in no number.

``standing.py [RESULTS]``: a table in markdown. Of each route and seed that all rows have, the log
of a row's error is compared with its mean over the rows; seeds of a route are averaged, and the
interval is Student's over routes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy import stats

from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.evaluation.measures import Measure, measure
from p2gd_fgo.run_record import RunRecord, read_records
from p2gd_fgo.types import FloatArray

AXIS = "policy"
MEASURES = ("ate", "ate_origin", "are", "are_origin", "rte_10", "rte_50", "features")
LEVEL = 0.95


def standing(records: Sequence[RunRecord], chosen: Measure) -> dict[str, tuple[float, float, int]]:
    """By row: mean of the log ratio over routes, half its interval, and the routes."""
    rows = list(dict.fromkeys(str(r.axes[AXIS]) for r in records))
    found: dict[tuple[str, int], dict[str, float]] = {}
    for r in records:
        found.setdefault((r.route, r.seed), {})[str(r.axes[AXIS])] = chosen.of(r)
    logs: dict[str, list[FloatArray]] = {}
    for (route, _), values in found.items():
        each = np.log([values.get(row, np.nan) for row in rows])
        if np.isfinite(each).all():
            logs.setdefault(route, []).append(each - each.mean())
    if len(logs) < 3:
        raise ConfigError(f"{chosen.name}: {len(logs)} routes have every row: 3 are needed")
    routes = np.array([np.mean(seeds, axis=0) for seeds in logs.values()])
    error = routes.std(axis=0, ddof=1) / np.sqrt(len(routes))
    half = stats.t.ppf(0.5 + 0.5 * LEVEL, len(routes) - 1) * error
    return {
        row: (float(mean), float(h), len(routes))
        for row, mean, h in zip(rows, routes.mean(axis=0), half, strict=True)
    }


def percent(mean: float, half: float) -> str:
    """The change with its interval, in bold where that excludes zero."""
    low, high = (100.0 * np.expm1(v) for v in (mean - half, mean + half))
    bold = "**" if low * high > 0.0 else ""
    whole, first, last = (
        f"{round(v):+d}".replace("-", "−") if round(v) else "0"
        for v in (100.0 * np.expm1(mean), low, high)
    )
    return f"{bold}{whole} [{first}, {last}]{bold}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    here = Path(__file__).parent / "results.jsonl"
    parser.add_argument("results", type=Path, nargs="?", default=here)
    parser.add_argument("--measures", nargs="+", default=list(MEASURES))
    options = parser.parse_args()
    records = read_records(options.results)
    chosen = [measure(name) for name in options.measures]
    for backend in sorted({str(r.axes["backend"]) for r in records}, reverse=True):
        held = [r for r in records if r.axes["backend"] == backend]
        columns = [standing(held, m) for m in chosen]
        routes = min(n for column in columns for _, _, n in column.values())
        sys.stdout.write(
            f"\n{backend}: change in % against the mean of all rows, {100 * LEVEL:.0f} % intervals "
            f"over {routes} routes\n\n"
            f"| row | {' | '.join(f'{m.label} {m.unit}'.strip() for m in chosen)} |\n"
            f"|---{'|---' * len(chosen)}|\n"
        )
        for row in columns[0]:
            cells = " | ".join(percent(*column[row][:2]) for column in columns)
            sys.stdout.write(f"| {row} | {cells} |\n")


if __name__ == "__main__":
    run_refusing(main)
