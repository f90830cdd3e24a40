"""The progress bar of a study, and its cost in words."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.cost import estimate_cost, run_seconds
from p2gd_fgo.study.runs import Run

_SHOWN_LABEL = 44


def cost_line(runs: Sequence[Run], jobs: int) -> str:
    """What runs cost, before they start."""
    cost = estimate_cost(runs)
    rendering = (
        f"rendering {cost.images} images {_span(cost.rendering_s)} of CPU and "
        f"{cost.disk_bytes / 1e9:.1f} GB in the cache, "
        if cost.images
        else ""
    )
    jobs = max(1, min(jobs, cost.runs))
    return (
        f"estimated cost: {rendering}{cost.runs} runs {_span(cost.running_s)} of CPU; about "
        f"{_span(cost.total_s / jobs)} on {jobs} core{'s' if jobs > 1 else ''}"
    )


class StudyProgress:
    """Observer of a study: one bar over all runs with the time left; a context manager.

    Where no terminal shows a bar, every finished run is a line.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._shares: dict[str, float] = {}
        self._total_s = 1.0
        self._finished = 0
        self._progress = Progress(
            TextColumn("[bold]{task.fields[count]}"),
            BarColumn(bar_width=None),
            TextColumn("{task.percentage:3.0f} %"),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.description}", markup=False),
            console=console,
            transient=True,
        )

    def __enter__(self) -> StudyProgress:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def begin(self, runs: Sequence[Run], known: int) -> None:
        """Set up the bar; the parts of the work count by their estimated cost."""
        self._runs = len(runs)
        cost = estimate_cost(runs)
        self._total_s = max(cost.total_s, 1.0)
        self._per_image_s = cost.rendering_s / max(cost.images, 1)
        self._began = time.monotonic()
        self._task = self._progress.add_task(
            "starting", total=self._total_s, count=f"0/{self._runs}", left=""
        )

    def rendering(self, name: str, done: int, total: int) -> None:
        """Count images that are rendered."""
        self._shares[f"rendering {name}"] = done * self._per_image_s
        self._show(f"rendering {name} {done}/{total}")

    def running(self, run: Run, done: int, total: int) -> None:
        """Count images that are run."""
        self._shares[run.key] = run_seconds(run) * done / max(total, 1)
        self._show(run.label)

    def finished(self, run: Run, record: RunRecord) -> None:
        """Count the run."""
        self._shares[run.key] = run_seconds(run)
        self._finished += 1
        words = run.label if record.status == "done" else f"{run.label}: {record.status}"
        if not self._console.is_terminal:
            self._console.print(
                f"{self._finished}/{self._runs}  {record.seconds:6.1f} s  {words}"
                + (f": {record.reason}" if record.reason else ""),
                soft_wrap=True, markup=False, highlight=False,
            )  # fmt: skip
        self._show(words)

    def _show(self, words: str) -> None:
        done_s = min(sum(self._shares.values()), self._total_s)
        elapsed = time.monotonic() - self._began
        left = ""
        if done_s > 0.01 * self._total_s:
            left = f"{_span(elapsed * (self._total_s / done_s - 1.0))} left"
        self._progress.update(
            self._task,
            completed=done_s,
            count=f"{self._finished}/{self._runs}",
            left=left,
            description=words[:_SHOWN_LABEL],
        )


def _span(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
