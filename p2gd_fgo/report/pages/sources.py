"""From folders to the runs of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from p2gd_fgo.errors import DataError
from p2gd_fgo.report.pages.run_folders import read_folder, records_of
from p2gd_fgo.run_directory import STATUS, read_status
from p2gd_fgo.run_record import RESULTS, RunRecord, read_records


@dataclass(frozen=True, slots=True)
class Entry:
    """A run, and its folder where it was kept."""

    record: RunRecord
    folder: Path | None


@dataclass(frozen=True, slots=True)
class Found:
    """What lies in the folders.

    Attributes
    ----------
    entries
        Every ended run.
    remarks
        What a reader must know of runs that are not among them, one sentence each.
    """

    entries: tuple[Entry, ...]
    remarks: tuple[str, ...]


def find_runs(places: Sequence[Path]) -> Found:
    """Read every run in the places.

    Parameters
    ----------
    places
        Run directories, folders of them at any depth, folders with a study's ``results.jsonl``,
        or such a file. Below a study's folder only the runs that its file names count.

    Raises
    ------
    DataError
        A place doesn't exist or holds no run, or a file in it can't be read.
    """
    entries: dict[str, Entry] = {}
    folders: dict[Path, None] = {}
    remarks = []
    for place in places:
        found = list(_walk(place))
        if not found:
            raise DataError(
                f"{place}: neither a run directory nor a folder with any below it, nor a study's "
                f"{RESULTS}; give the --out of a run, a comparison or a study"
            )
        for path in found:
            if path.is_dir():
                folders.setdefault(path.resolve())
                continue
            for record in read_records(path):
                entries[record.key] = Entry(record, _kept(path.parent, record))
    read = [read_folder(path) for path in folders]
    for folder in read:
        if folder.state == "running":
            remarks.append(
                f"{folder.path}: says that it is running, or was killed; it is not counted"
            )
    ended = [folder for folder in read if folder.state != "running"]
    alike: dict[tuple[object, ...], RunRecord] = {}
    for folder, record in zip(ended, records_of(ended), strict=True):
        what = (record.sequence, *sorted((k, str(v)) for k, v in record.axes.items()))
        if what in alike:
            remarks.append(
                f"{folder.path}: has configuration, recording and seed of {alike[what].directory}; "
                "it is not counted"
            )
            continue
        alike[what] = record
        entries[record.key] = Entry(record, folder.path)
    return Found(tuple(entries.values()), tuple(remarks))


def _kept(study: Path, record: RunRecord) -> Path | None:
    path = study / record.directory if record.directory else None
    return path if path and path.is_dir() else None


def _walk(place: Path) -> Iterator[Path]:
    """Run directories, and files of records; nothing below either."""
    if place.is_file():
        if place.name.endswith(".jsonl"):
            yield place
        return
    if not place.is_dir():
        raise DataError(f"{place}: no such folder")
    if (place / STATUS).exists() and read_status(place) is not None:
        yield place
    elif (place / RESULTS).exists():
        yield place / RESULTS
    else:
        for below in sorted(place.iterdir()):
            if below.is_dir() and not below.is_symlink():
                yield from _walk(below)
