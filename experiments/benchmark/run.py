"""Process CPU per stage and frame, one thread: ``python experiments/benchmark/run.py [FOLDER]``.

Without a folder the rendered demo is run. A start from truth is used where the recording has one,
so that every image counts.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import numpy as np  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.config import load_config, override  # noqa: E402
from p2gd_fgo.experiment import run_experiment  # noqa: E402
from p2gd_fgo.simulation.demo import demo_sequence  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, help="recording; default: the demo")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    folder = arguments.folder or demo_sequence()
    config = override(load_config(), {"dataset.path": str(folder), "initialization.kind": "given"})
    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        for repeat in range(arguments.repeats):
            runs.append(run_experiment(config, out=Path(scratch, str(repeat))))
    table = Table(title=f"{runs[0].name}: CPU ms per frame, median (range over {len(runs)} runs)")
    for column in ("stage", "median", "p95", "frames"):
        table.add_column(column, justify="left" if column == "stage" else "right")
    for stage, time in runs[0].timing.items():
        medians = [run.timing[stage].median_cpu_ms for run in runs]
        p95 = float(np.median([run.timing[stage].p95_cpu_ms for run in runs]))
        spread = f"({min(medians):.2f}-{max(medians):.2f})"
        table.add_row(stage, f"{np.median(medians):.2f} {spread}", f"{p95:.2f}", str(time.frames))
    Console().print(table)


if __name__ == "__main__":
    run_refusing(main)
