"""Who wants to know how a study goes on, and who doesn't."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.runs import Run


class StudyObserver(Protocol):
    """Told about a study as it goes on; every call comes from one thread."""

    def begin(self, runs: Sequence[Run], known: int) -> None:
        """``runs`` are to be done, ``known`` are finished already."""
        ...

    def rendering(self, name: str, done: int, total: int) -> None:
        """Images of a recording that is being rendered."""
        ...

    def running(self, run: Run, done: int, total: int) -> None:
        """Images of a run."""
        ...

    def finished(self, run: Run, record: RunRecord) -> None:
        """A run has its record, which is on disk."""
        ...


class NoStudyObserver:
    """Looks on and does nothing."""

    def begin(self, runs: Sequence[Run], known: int) -> None:
        """Nothing."""

    def rendering(self, name: str, done: int, total: int) -> None:
        """Nothing."""

    def running(self, run: Run, done: int, total: int) -> None:
        """Nothing."""

    def finished(self, run: Run, record: RunRecord) -> None:
        """Nothing."""
