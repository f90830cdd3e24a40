"""From folders to the runs of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from p2gd_fgo.errors import DataError
from p2gd_fgo.report.pages.run_folders import read_folder, records_of
from p2gd_fgo.run_directory import STATUS, read_status
from p2gd_fgo.run_record import RESULTS, RunRecord, read_plan, read_records


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
    entries: list[Entry] = []
    remarks: list[str] = []
    files: dict[Path, None] = {}
    for place in places:
        found = [path.resolve() for path in _walk(place)]
        if not found:
            raise DataError(
                f"{place}: neither a run directory nor a folder with any below it, nor a study's "
                f"{RESULTS}; give the --out of a run, a comparison or a study"
            )
        files |= dict.fromkeys(found)
    for path in files:
        if path.is_file():
            entries += _of_study(path, remarks)
    entries += _of_folders([path for path in files if path.is_dir()], remarks)
    return Found(tuple(_once(entries, remarks)), tuple(remarks))


def _once(entries: Sequence[Entry], remarks: list[str]) -> list[Entry]:
    """Without the runs that a study took over from another one of the same axes."""
    kept: dict[tuple[object, ...], Entry] = {}
    for entry in entries:
        record = entry.record
        kept.setdefault((record.key, *_axes(record)), entry)
    if len(kept) < len(entries):
        remarks.append(
            f"{len(entries) - len(kept)} runs stand in more than one of the studies; each counts "
            "once"
        )
    return list(kept.values())


def _of_study(path: Path, remarks: list[str]) -> Iterator[Entry]:
    """Of lines with the same labels the last counts: the study went on with other code or data."""
    last: dict[tuple[object, ...], RunRecord] = {}
    found = read_records(path)
    planned = read_plan(path.parent) if path.name == RESULTS else None
    records = [record for record in found if planned is None or record.key in planned]
    if len(records) < len(found):
        remarks.append(
            f"{path}: {len(found) - len(records)} runs are none that the study names now: they are "
            "of other settings or recordings, and are not counted"
        )
    for record in records:
        last[_labels(record)] = record
    if len(last) < len(records):
        remarks.append(
            f"{path}: {len(records) - len(last)} runs stand in it again further on, made with "
            "other code, data or options that are no axis; the last of each counts"
        )
    for record in last.values():
        folder = path.parent / record.directory if record.directory else None
        yield Entry(record, folder if folder and folder.is_dir() else None)


def _of_folders(folders: Sequence[Path], remarks: list[str]) -> Iterator[Entry]:
    read = [read_folder(path) for path in folders]
    remarks += [
        f"{folder.path}: says that it is running, or was killed; it is not counted"
        for folder in read
        if folder.state == "running"
    ]
    ended = [folder for folder in read if folder.state != "running"]
    alike: dict[tuple[object, ...], Path] = {}
    for folder, record in zip(ended, records_of(ended), strict=True):
        first = alike.setdefault(_labels(record), folder.path)
        if first == folder.path:
            yield Entry(record, folder.path)
        else:
            remarks.append(
                f"{folder.path}: has configuration, recording and seed of {first}; it is not "
                "counted"
            )


def _labels(record: RunRecord) -> tuple[object, ...]:
    return (record.study, record.group, record.route, record.seed, *_axes(record))


def _axes(record: RunRecord) -> list[tuple[str, str]]:
    return sorted((axis, str(label)) for axis, label in record.axes.items())


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
