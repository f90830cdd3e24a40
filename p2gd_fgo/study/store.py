"""What a study leaves on disk: ``results.jsonl``, a line per finished run, and run directories."""

from __future__ import annotations

import fcntl
import filecmp
import os
import shutil
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.run_record import RESULTS, RunRecord, read_records, write_plan
from p2gd_fgo.study.external import External
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.work import CRASH

RUNS = "runs"
_PART = ".part"


class Store:
    """The one writer of a study's results; a context manager that holds the file's lock.

    Attributes
    ----------
    records
        Of all finished runs in the file, by key; lines of other plans among them.

    Raises
    ------
    ConfigError
        Another process writes there, or the folder can't be written.
    DataError
        A line that is no record.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.path = out / RESULTS
        self.records: dict[str, RunRecord] = {}
        self._truths: dict[str, Path] = {}

    def __enter__(self) -> Store:
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            self._lock = self.path.open("a")
        except OSError as error:
            raise ConfigError(
                f"--out {self.out}: can't be written: {error.strerror}; name another folder"
            ) from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise ConfigError(
                f"--out {self.out}: another study is writing its results there: wait for it, or "
                "give another --out"
            ) from None
        self._drop_torn_line()
        self.records = records_in(self.out)
        for path in (self.out / RUNS).glob(f".*{_PART}"):
            shutil.rmtree(path)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._lock.close()

    def name_runs(self, keys: Iterable[str]) -> None:
        """Say which lines are of the plan, for whoever has the folder alone.

        Raises
        ------
        DataError
            The disk is full.
        """
        try:
            write_plan(self.out, keys)
        except OSError as error:
            raise self._unwritable(error) from None

    def scratch(self, run: Run) -> Path:
        """Where a run may leave its files until it is finished."""
        return self.out / RUNS / f".{run.key}{_PART}"

    def add(self, run: Run, record: RunRecord) -> RunRecord:
        """Put the run's directory in its place and append its line, both on disk on return.

        Returns
        -------
        RunRecord
            With its directory.

        Raises
        ------
        DataError
            The disk is full, or the folder is gone.
        """
        try:
            if self._place(run, record):
                record = replace(record, directory=f"{RUNS}/{run.key}")
        except OSError as error:
            raise self._unwritable(error) from None
        self.append(record)
        return record

    def append(self, record: RunRecord) -> None:
        """Append a line as it is.

        Raises
        ------
        DataError
            As :meth:`add`.
        """
        try:
            with self.path.open("a", encoding="utf-8", newline="\n") as file:
                file.write(f"{record.to_json()}\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise self._unwritable(error) from None
        self.records[record.key] = record

    def _unwritable(self, error: OSError) -> DataError:
        return DataError(
            f"{self.out}: the results can't be written ({error.strerror}): free some space and "
            "start the study again, which goes on from here"
        )

    def _place(self, run: Run, record: RunRecord) -> bool:
        """Move what a run left to its place; False where it left nothing that is whole."""
        scratch, place = self.scratch(run), self.out / RUNS / run.key
        shutil.rmtree(place, ignore_errors=True)
        ended = record.status in ("done", "failed") or (scratch / CRASH).is_file()
        if not scratch.is_dir() or not ended:
            shutil.rmtree(scratch, ignore_errors=True)
            return False
        self._share_truth(run, scratch / "truth.tum", place / "truth.tum")
        scratch.rename(place)
        return True

    def _share_truth(self, run: Run, truth: Path, place: Path) -> None:
        """Link the truth to another run's on the same recording where the two are the same."""
        other = self._truths.setdefault(run.sequence, place)
        if other == place or not (truth.is_file() and other.is_file()):
            return
        if filecmp.cmp(truth, other, shallow=False):
            linked = truth.with_name(f".{truth.name}.link")
            with suppress(OSError):  # a file system without hard links: the copy stays
                linked.hardlink_to(other)
                linked.replace(truth)

    def _drop_torn_line(self) -> None:
        """Cut off a line that was being written when the process was killed."""
        if not self.path.is_file():
            return
        with self.path.open("r+b") as file:
            data = file.read()
            whole = data.rfind(b"\n") + 1
            if whole < len(data):
                file.truncate(whole)


def records_in(out: Path) -> dict[str, RunRecord]:
    """Records of a study's folder by key; none where there is no file yet.

    Raises
    ------
    DataError
        A line that is no record.
    """
    path = out / RESULTS
    return {r.key: r for r in read_records(path)} if path.is_file() else {}


def is_finished(
    record: RunRecord | None, code: str, *, keep_older_code: bool = False, retry: bool = False
) -> bool:
    """Whether a record stands for its run.

    Parameters
    ----------
    code
        Hash of the code as it is now.
    keep_older_code
        Records of other code count, too.
    retry
        Crashed and timed-out runs don't count.
    """
    if record is None or (retry and record.status in ("crashed", "timeout")):
        return False
    return keep_older_code or record.code == code


def lacks_segments(run: Run, record: RunRecord | None) -> bool:
    """Whether the run wants the errors of each piece of the way, and the record never had them."""
    if record is None or record.status != "done":
        return False
    return run.segments and record.segments is None


def of_plan(records: dict[str, RunRecord], rows: Iterable[Run | External]) -> list[RunRecord]:
    """The records of these rows, in their order."""
    return [records[row.key] for row in rows if row.key in records]
