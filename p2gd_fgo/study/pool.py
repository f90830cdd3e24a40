"""A bounded number of worker processes on this machine."""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from p2gd_fgo.errors import P2gdError
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.data import images_key
from p2gd_fgo.study.process import Message, WorkerProcess, check_code
from p2gd_fgo.study.progress import StudyObserver
from p2gd_fgo.study.runs import Recorded, Rendered, Run
from p2gd_fgo.study.work import Keep, unfinished

_RENDER_ATTEMPTS = 2

Outcome = tuple[Run, RunRecord]


@dataclass(slots=True, eq=False)
class _Route:
    """Recordings with the same images, and the runs that wait for them."""

    name: str
    sources: list[Rendered | Recorded] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    attempts: int = 0


class LocalPool:
    """Does runs in worker processes, each of which does one thing at a time.

    A process that dies takes only its own run with it, and is replaced.

    Parameters
    ----------
    jobs
        Processes.
    folder_of
        Where a run leaves its files.
    """

    def __init__(
        self, jobs: int, keep: Keep, folder_of: Callable[[Run], Path], observer: StudyObserver
    ) -> None:
        self._jobs, self._keep, self._folder_of = jobs, keep, folder_of
        self._observer = observer
        self._inbox: queue.Queue[tuple[WorkerProcess, Message]] = queue.Queue()
        self._idle: list[WorkerProcess] = []
        self._starting: set[WorkerProcess] = set()
        self._busy: dict[WorkerProcess, Run | _Route] = {}
        self._since: dict[WorkerProcess, float] = {}
        self._late: set[WorkerProcess] = set()
        self._ready: deque[Run] = deque()
        self._unrendered: deque[_Route] = deque()

    def outcomes(self, runs: Sequence[Run]) -> Iterator[Outcome]:
        """Every run with its record, in the order in which they finish.

        Raises
        ------
        P2gdError
            The code was changed in between, or no worker can be started.
        """
        self._queue(runs)
        try:
            while self._ready or self._unrendered or self._busy:
                self._hand_out()
                try:
                    worker, message = self._inbox.get(timeout=self._patience())
                except queue.Empty:
                    self._kill_the_late()
                    continue
                yield from self._answer(worker, message)
        finally:
            for worker in {*self._idle, *self._starting, *self._busy}:
                worker.close()

    def _queue(self, runs: Sequence[Run]) -> None:
        routes: dict[str, _Route] = {}
        for run in runs:
            if isinstance(run.source, Recorded):
                self._ready.append(run)
                continue
            route = routes.setdefault(images_key(run.source), _Route(run.sequence))
            route.runs.append(run)
            if run.source not in route.sources:
                route.sources.append(run.source)
        self._unrendered.extend(routes.values())

    def _hand_out(self) -> None:
        """Runs come before further rendering: results early, and images of few routes at a time."""
        while self._idle and (self._ready or self._unrendered):
            worker = self._idle.pop()
            if self._ready:
                run = self._ready.popleft()
                worker.run(run, self._folder_of(run), self._keep)
                self._busy[worker] = run
                self._observer.running(run, 0, run.source.images)
            else:
                route = self._unrendered.popleft()
                route.attempts += 1
                worker.render(route.sources)
                self._busy[worker] = route
            self._since[worker] = time.monotonic()
        wanted = len(self._ready) + len(self._unrendered) - len(self._starting)
        alive = len(self._idle) + len(self._starting) + len(self._busy)
        for _ in range(min(wanted, self._jobs - alive)):
            self._starting.add(WorkerProcess(self._inbox))

    def _answer(self, worker: WorkerProcess, message: Message) -> Iterator[Outcome]:
        kind, *rest = message
        task = self._busy.get(worker)
        if kind == "progress" and task is not None:
            if isinstance(task, _Route):
                self._observer.rendering(task.name, *rest)
            else:
                self._observer.running(task, *rest)
            return
        if kind == "gone":
            yield from self._bury(worker, rest[0])
            return
        if kind == "ready":
            check_code(rest[0])
        elif isinstance(task, _Route):
            if rest[0] is None:
                self._ready.extend(task.runs)
            else:
                yield from ((run, unfinished(run, "crashed", rest[0], 0.0)) for run in task.runs)
        elif task is not None:
            yield task, rest[0]
        self._busy.pop(worker, None)
        self._starting.discard(worker)
        if worker in self._late:  # killed as its record came: it says "gone" next
            self._late.discard(worker)
            worker.close()
        else:
            self._idle.append(worker)

    def _bury(self, worker: WorkerProcess, reason: str) -> Iterator[Outcome]:
        worker.close()
        if worker in self._starting:
            self._starting.discard(worker)
            raise P2gdError(f"a worker could not be started: {reason}")
        if worker in self._idle:
            self._idle.remove(worker)
        task = self._busy.pop(worker, None)
        seconds = time.monotonic() - self._since.pop(worker, time.monotonic())
        if isinstance(task, Run) and worker in self._late:
            self._late.discard(worker)
            reason = f"not finished after {task.timeout_s:g} s (timeout_s)"
            yield task, unfinished(task, "timeout", reason, seconds)
        elif isinstance(task, Run):
            yield task, unfinished(task, "crashed", reason, seconds)
        elif task is not None and task.attempts < _RENDER_ATTEMPTS:
            self._unrendered.appendleft(task)
        elif task is not None:
            told = f"its recording was not rendered: {reason}"
            yield from ((run, unfinished(run, "crashed", told, 0.0)) for run in task.runs)

    def _patience(self) -> float | None:
        """Seconds to the first run's time-out."""
        due = [
            self._since[worker] + task.timeout_s
            for worker, task in self._busy.items()
            if isinstance(task, Run) and worker not in self._late
        ]
        return max(0.0, min(due) - time.monotonic()) if due else None

    def _kill_the_late(self) -> None:
        now = time.monotonic()
        for worker, task in self._busy.items():
            if isinstance(task, Run) and now >= self._since[worker] + task.timeout_s:
                self._late.add(worker)
                worker.kill()
