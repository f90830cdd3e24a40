"""The progress bar of a run."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.types import Estimate, Image, Waiting

_STATE_WIDTH = 34


class ProgressBar:
    """Observer of a run: image, rate, features, state of the estimator; a context manager.

    Parameters
    ----------
    console
        Where it is drawn.
    label
        What stands before the bar; by default the recording's name.
    """

    def __init__(self, console: Console, label: str | None = None) -> None:
        self._label = label
        self._progress = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("{task.fields[state]}"),
            TimeRemainingColumn(compact=True),
            console=console,
            transient=True,
        )

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def begin(self, sequence: Sequence, config: Config) -> None:
        """Set up the bar."""
        self._began = time.monotonic()
        self._task = self._progress.add_task(
            self._label or sequence.name, total=len(sequence.image_stamps_ns), state="starting"
        )

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        """Move the bar."""
        if isinstance(outcome, Waiting):
            state = outcome.reason
        else:
            state = "standing still" if outcome.stationary else f"{odometry.features} features"
        rate = (index + 1) / max(time.monotonic() - self._began, 1e-3)
        self._progress.update(
            self._task, completed=index + 1, state=f"{rate:5.1f} Hz · {state:<{_STATE_WIDTH}}"
        )
