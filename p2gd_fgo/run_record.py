"""One finished run of a study as a line of JSON: what tables, statistics and reports are made from.

``results.jsonl`` holds one such line for each finished run, in the order in which they finished.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from p2gd_fgo.atomic_files import write_text
from p2gd_fgo.errors import DataError

RESULTS = "results.jsonl"
"""Name of the file in a study's folder."""

PLAN = "plan.json"
"""Beside it: the keys of the runs that the study named when it was last run."""

SCHEMA: Literal[1] = 1
Label = str | int | float | bool
RecordStatus = Literal["done", "failed", "crashed", "timeout"]


@dataclass(frozen=True, slots=True)
class RunRecord:
    """What is kept of one run.

    Attributes
    ----------
    key
        Hash of the resolved configuration and of the data; with ``code`` it names the run.
    study
        Name of the study.
    axes
        Label of this run on every axis of the study, the seed's included.
    sequence
        Short name of the recording.
    route
        What the seeds lie within: runs of one route are not independent of each other.
    group
        What routes belong together in a table: a preset, or a set of recordings.
    seed
        Of the front end and, on rendered routes, of the IMU's noise.
    status, reason
        ``done``; ``failed``: start refused or diverged, a result like any other; ``crashed``: the
        process died, or raised what it must not; ``timeout``. All but ``done`` have a reason.
    metrics
        Content of ``metrics.json`` but for ``tracking``, ``cpu_ms`` and paths; empty without one.
    tracking
        Length and parallax of the tracks, and measures per image.
    segments
        Errors and measures of every stretch of the way, or None where they weren't taken.
    events
        How many of each kind.
    seconds
        Wall time of the run.
    cpu_ms
        CPU of each stage, as in ``metrics.json``.
    directory
        Run directory, relative to the file that holds this line, or None where it wasn't kept.
    code
        Hash of the code that can change an estimate.
    versions
        Of the package and of the libraries that can change an estimate.
    """

    key: str
    study: str
    axes: Mapping[str, Label]
    sequence: str
    route: str
    group: str
    seed: int
    status: RecordStatus
    reason: str | None = None
    metrics: Mapping[str, Any] = field(default_factory=dict)
    tracking: Mapping[str, Any] = field(default_factory=dict)
    segments: list[dict[str, Any]] | None = None
    events: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    cpu_ms: Mapping[str, Any] = field(default_factory=dict)
    directory: str | None = None
    code: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    schema: Literal[1] = SCHEMA

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True)

    def to_json(self) -> str:
        """One line, keys sorted, without the line's end; ``segments`` only where they were taken.

        Raises
        ------
        ValueError
            A NaN or an infinity in it.
        """
        data = asdict(self)
        if self.segments is None:
            del data["segments"]
        return json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False)

    @classmethod
    def from_json(cls, line: str, where: str = "a record") -> RunRecord:
        """Read one line.

        Parameters
        ----------
        where
            File and line, for the error.

        Raises
        ------
        DataError
            No JSON, a field missing, unknown or of the wrong kind, or a schema of another version.
        """
        try:
            return _ADAPTER.validate_json(line)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            name = ".".join(str(part) for part in first["loc"])
            what = f"field '{name}': {first['msg']}" if name else first["msg"]
            raise DataError(
                f"{where} is no record of a run ({what}): delete that line, and the study runs it "
                "again"
            ) from None

    def without_timing(self) -> RunRecord:
        """A copy with what differs from one execution to the next set to nothing."""
        return replace(self, seconds=0.0, cpu_ms={})


_ADAPTER = TypeAdapter(RunRecord)


def read_records(path: Path) -> list[RunRecord]:
    """Read a file of records, in its order.

    A last line without its end was being written when the process was killed: it is left out, and
    so is a line whose key comes again further on.

    Raises
    ------
    DataError
        The file can't be read, or a line is no record.
    """
    try:
        whole, _, _torn = path.read_bytes().rpartition(b"\n")  # torn in a character, it may be
        text = whole.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: the records can't be read: {error}") from None
    found: dict[str, RunRecord] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            record = RunRecord.from_json(line, f"{path}, line {number},")
            found.pop(record.key, None)
            found[record.key] = record
    return list(found.values())


def write_plan(folder: Path, keys: Iterable[str]) -> None:
    """Say which lines of a folder's results are the study's; other ones are of earlier settings.

    Raises
    ------
    OSError
        It can't be written.
    """
    write_text(folder / PLAN, json.dumps({"runs": list(keys)}, indent=0) + "\n")


def read_plan(folder: Path) -> frozenset[str] | None:
    """The keys that :func:`write_plan` wrote; None without such a file.

    Raises
    ------
    DataError
        The file is damaged.
    """
    path = folder / PLAN
    if not path.is_file():
        return None
    try:
        return frozenset(map(str, json.loads(path.read_bytes())["runs"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"{path}: is no list of a study's runs ({error}): delete it, 'study run' writes it anew"
        ) from None


def canonical(records: Iterable[RunRecord], *, timing: bool = False) -> str:
    """The records as text that doesn't depend on the order in which the runs finished.

    Parameters
    ----------
    timing
        Whether times are kept; without them an interrupted study, one on other machines and one
        that ran through give the same bytes.
    """
    kept = records if timing else (record.without_timing() for record in records)
    lines = sorted(kept, key=lambda r: (r.group, r.route, r.seed, sorted(_texts(r.axes)), r.key))
    return "".join(f"{record.to_json()}\n" for record in lines)


def _texts(axes: Mapping[str, Label]) -> list[tuple[str, str]]:
    return [(name, str(label)) for name, label in axes.items()]
