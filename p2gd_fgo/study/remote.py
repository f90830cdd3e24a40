"""The same runs on other machines, by ``dask.distributed`` (the package's extra ``dask``).

A dask worker keeps one worker process of ours for each of its threads, so that threads are pinned,
late runs are killed and crashes recorded exactly as on this machine. What a run leaves in its
directory comes back with its record.
"""

from __future__ import annotations

import queue
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from p2gd_fgo.errors import ConfigError, P2gdError
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.data import images_key
from p2gd_fgo.study.keys import code_hash
from p2gd_fgo.study.process import Message, WorkerProcess
from p2gd_fgo.study.progress import StudyObserver
from p2gd_fgo.study.runs import Recorded, Rendered, Run
from p2gd_fgo.study.work import Keep, unfinished

LOCAL = "local"
"""Address that stands for a cluster of its own on this machine."""

_CONNECT_S = 20.0

Outcome = tuple[Run, RunRecord]


@dataclass(frozen=True, slots=True)
class Parcel:
    """A record, and the files of the run's directory by name."""

    record: RunRecord
    files: dict[str, bytes]
    code: str


class DaskPool:
    """Does runs on the workers of a dask cluster.

    A dask worker that dies takes nothing with it but the time: its runs are done by another one.

    Parameters
    ----------
    address
        Of a scheduler (``tcp://host:8786``), or ``local``.
    jobs
        Workers of a local cluster.
    folder_of
        Where a run's files are put on this machine.

    Raises
    ------
    ConfigError
        ``distributed`` isn't installed, or no scheduler answers.
    """

    def __init__(
        self,
        address: str,
        jobs: int,
        keep: Keep,
        folder_of: Callable[[Run], Path],
        observer: StudyObserver,
    ) -> None:
        self._keep, self._folder_of, self._observer = keep, folder_of, observer
        self._distributed = _distributed()
        self._cluster: Any = None
        if address == LOCAL:
            self._cluster = self._distributed.LocalCluster(
                n_workers=jobs, threads_per_worker=1, dashboard_address=None
            )
        target = address if self._cluster is None else self._cluster
        try:
            self._client = self._distributed.Client(target, timeout=_CONNECT_S)
            self._client.wait_for_workers(1, timeout=_CONNECT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise ConfigError(
                f"--dask {address}: no scheduler with a worker answers ({error}): start 'dask "
                "scheduler' and 'dask worker ADDRESS --nthreads 1', or give --dask local"
            ) from None

    def outcomes(self, runs: Sequence[Run]) -> Iterator[Outcome]:
        """Every run with its record, in the order in which they finish.

        Raises
        ------
        P2gdError
            A worker runs other code, or can't do runs at all.
        """
        try:
            rendered: dict[str, Any] = {}
            asked: dict[Any, Run] = {}
            for priority, run in enumerate(runs):
                before = None
                if isinstance(run.source, Rendered):
                    key = images_key(run.source)
                    if key not in rendered:
                        rendered[key] = self._client.submit(
                            render, run.source, pure=False, priority=-priority
                        )
                    before = rendered[key]
                future = self._client.submit(
                    work, run, self._keep, before, pure=False, priority=-priority
                )
                asked[future] = run
            for future in self._distributed.as_completed(list(asked)):
                yield self._outcome(asked.pop(future), future)
                future.release()
        finally:
            self._client.close()
            if self._cluster is not None:
                self._cluster.close()

    def _outcome(self, run: Run, future: Any) -> Outcome:
        if future.status != "finished":
            error = future.exception()
            if isinstance(error, self._distributed.KilledWorker):
                reason = "every dask worker that tried it died"
                return run, unfinished(run, "crashed", reason, 0.0)
            raise P2gdError(f"the dask workers can't do this study: {error}")
        parcel: Parcel = future.result()
        if parcel.code != code_hash():
            raise ConfigError(
                f"a dask worker runs other code ({parcel.code}) than this study ({code_hash()}): "
                "install the same package and libraries there"
            )
        if parcel.files:
            folder = self._folder_of(run)
            folder.mkdir(parents=True, exist_ok=True)
            for name, content in parcel.files.items():
                path = folder / name
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(content)
        return run, parcel.record


def render(source: Rendered | Recorded) -> str | None:
    """Provide a recording on a dask worker; the sentence of an error, or None."""
    return _provided(_process(), source)


def work(run: Run, keep: Keep, rendered: str | None) -> Parcel:
    """Do a run on a dask worker; ``rendered`` only puts it after its recording."""
    with tempfile.TemporaryDirectory(prefix="p2gd-fgo-") as top:
        folder = Path(top, run.key)
        record = _run(run, folder, keep)
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
    return Parcel(record, files, code_hash())


def _run(run: Run, folder: Path, keep: Keep) -> RunRecord:
    ours = _process()
    fault = _provided(ours, run.source)  # rendered on another machine, it may not be on this one
    if fault is not None:
        return unfinished(run, "crashed", fault, 0.0)
    began = time.monotonic()
    ours.worker.run(run, folder, keep)
    while True:
        try:
            kind, *rest = ours.next(began + run.timeout_s - time.monotonic())
        except queue.Empty:
            ours.worker.close()
            reason = f"not finished after {run.timeout_s:g} s (timeout_s)"
            return unfinished(run, "timeout", reason, time.monotonic() - began)
        if kind == "record":
            record: RunRecord = rest[0]
            return record
        if kind == "gone":
            return unfinished(run, "crashed", rest[0], time.monotonic() - began)


def _provided(ours: _Own, source: Rendered | Recorded) -> str | None:
    ours.worker.render([source])
    while True:
        kind, *rest = ours.next(None)
        if kind in ("rendered", "gone"):
            return str(rest[0]) if rest[0] is not None else None


class _Own:
    """A worker process of this thread, and what it says."""

    def __init__(self) -> None:
        self.inbox: queue.Queue[tuple[WorkerProcess, Message]] = queue.Queue()
        self.worker = WorkerProcess(self.inbox)
        self.gone = False
        kind, *rest = self.next(None)
        if kind == "gone":
            raise P2gdError(f"a worker could not be started: {rest[0]}")

    def next(self, timeout_s: float | None) -> Message:
        """Next message.

        Raises
        ------
        queue.Empty
            None came in time: the process is to be closed.
        """
        try:
            _, message = self.inbox.get(timeout=None if timeout_s is None else max(0.0, timeout_s))
        except queue.Empty:
            self.gone = True
            raise
        if message[0] == "gone":
            self.gone = True
            self.worker.close()
        return message


_threads = threading.local()


def _process() -> _Own:
    own: _Own | None = getattr(_threads, "own", None)
    if own is None or own.gone:
        own = _threads.own = _Own()
    return own


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise ConfigError(
            "--dask needs dask.distributed, which isn't installed: pip install 'p2gd-fgo[dask]'"
        ) from None
    return distributed
