"""Runs that another study has finished, taken over instead of being done again."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from p2gd_fgo.errors import ConfigError
from p2gd_fgo.run_record import RESULTS, RunRecord, read_records
from p2gd_fgo.study.keys import code_hash
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.store import is_finished, lacks_segments


def reusable_records(
    runs: Iterable[Run], places: Sequence[Path], out: Path, *, keep_older_code: bool = False
) -> list[RunRecord]:
    """Records of these runs in other studies, with the labels that this study gives them.

    Crashed and timed-out runs are not taken, nor those without the segments that a run wants. A
    record keeps its run directory where it is, named by the way there from ``out``.

    Parameters
    ----------
    places
        Folders with a study's ``results.jsonl``, or such files; the first that has a run counts.
    out
        Folder of this study's results.

    Raises
    ------
    ConfigError
        A place without such a file.
    DataError
        A line that is no record.
    """
    found: dict[str, tuple[RunRecord, Path]] = {}
    code = code_hash()
    for place in places:
        path = place / RESULTS if place.is_dir() else place
        if not path.is_file():
            raise ConfigError(f"--from {place}: there is no {RESULTS}: give another study's --out")
        for record in read_records(path):
            if is_finished(record, code, keep_older_code=keep_older_code, retry=True):
                found.setdefault(record.key, (record, path.parent))
    taken = []
    for run in runs:
        if run.key not in found:
            continue
        record, folder = found[run.key]
        if not lacks_segments(run, record):
            taken.append(_relabelled(record, run, folder, out))
    return taken


def _relabelled(record: RunRecord, run: Run, folder: Path, out: Path) -> RunRecord:
    directory = None
    if record.directory is not None and (folder / record.directory).is_dir():
        directory = Path(os.path.relpath(folder / record.directory, out)).as_posix()
    return replace(
        record, study=run.study, axes=dict(run.axes), sequence=run.sequence, route=run.route,
        group=run.group, seed=run.seed, directory=directory,
        metrics={**record.metrics, "name": run.sequence} if record.metrics else {},
        segments=record.segments if run.segments else None,
    )  # fmt: skip
