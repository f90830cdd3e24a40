"""Trajectories of other programs as rows of a study: found beside the recordings, then judged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.datasets.base import stamps_on_imu_clock
from p2gd_fgo.errors import ConfigError, DataError, P2gdError
from p2gd_fgo.evaluation.external import external_path, external_record
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.data import provide
from p2gd_fgo.study.keys import code_hash, data_hash, versions
from p2gd_fgo.study.runs import Run
from p2gd_fgo.study.spec import StudySpec

_KEY_DIGITS = 16


@dataclass(frozen=True, slots=True)
class External:
    """A trajectory to be judged.

    Attributes
    ----------
    key
        Hash of the trajectory's file, of the recording and of how it is judged.
    name
        Of the estimator: its label on ``axis``, the study's pairing axis. It has no label on any
        other axis, so it stands beside the runs of every one.
    file
        TUM or EuRoC csv.
    run
        A run of the study on the same recording.
    """

    key: str
    name: str
    axis: str
    file: Path
    run: Run

    @property
    def group(self) -> str:
        """As its recording's."""
        return self.run.group


@dataclass(frozen=True, slots=True)
class FoundExternals:
    """Trajectories that are there, files that aren't, and templates that need ``--data``."""

    there: tuple[External, ...] = ()
    absent: tuple[Path, ...] = ()
    left_out: tuple[str, ...] = ()


def find_externals(
    spec: StudySpec, runs: Sequence[Run], folder: Path, data: Path | None
) -> FoundExternals:
    """Look for the files of every estimator that a study names, recording by recording.

    Parameters
    ----------
    folder
        Where the study's file lies.
    data
        Root of the recordings.

    Raises
    ------
    ConfigError
        A template that can't be filled in, or an estimator without any file.
    DataError
        A file that can't be read.
    """
    there: list[External] = []
    absent: list[Path] = []
    left_out: list[str] = []
    first = {run.sequence: run for run in reversed(runs)}
    for name, template in spec.external.items():
        assert spec.pairing is not None
        missing: list[Path] = []
        before = len(there)
        for sequence, run in sorted(first.items()):
            file = _place(external_path(template, sequence=sequence, group=run.group), folder, data)
            if file.is_file():
                key = _key(name, file, run)
                there.append(External(key, name, spec.pairing.axis, file, run))
            else:
                missing.append(file)
        if len(there) > before:
            absent += missing
        elif data is None and not Path(template).expanduser().is_absolute():
            left_out.append(template)
        else:
            raise ConfigError(
                f"{spec.name}: external.{name}: there is no file for any recording; the first one "
                f"looked for was {missing[0]}"
            )
    return FoundExternals(tuple(there), tuple(absent), tuple(left_out))


def judge(external: External) -> RunRecord:
    """Judge a trajectory against the truth of its recording.

    Whatever is wrong with the file or the truth is in the record: nothing is raised.
    """
    run = external.run
    try:
        recording = provide(run.source)
        dataset = run.config.dataset.model_copy(update={"path": str(recording)})
        sequence = open_sequence(dataset, max_gap_s=run.config.imu.max_gap_s)
        truth = sequence.truth
        if truth is None:
            raise DataError(f"{recording}: has no truth to judge {external.file} by")
        record = external_record(
            external.name, external.file, truth.trajectory, sequence=run.sequence,
            image_stamps_ns=stamps_on_imu_clock(sequence, dataset.time_offset_s),
            config=run.config.evaluation, study=run.study,
            axes={external.axis: external.name}, route=run.route, group=run.group,
        )  # fmt: skip
    except P2gdError as error:
        record = RunRecord(
            external.key, run.study, {external.axis: external.name}, run.sequence, run.route,
            run.group, 0, "crashed", str(error),
        )  # fmt: skip
    return replace(record, key=external.key, code=code_hash(), versions=versions())


def _place(path: Path, folder: Path, data: Path | None) -> Path:
    """Under the recordings' root, or else in the study's folder."""
    if path.is_absolute() or data is None:
        return folder / path
    under = data.expanduser() / path
    near = folder / path
    return near if near.is_file() and not under.is_file() else under


def _key(name: str, file: Path, run: Run) -> str:
    try:
        content = hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"{file}: can't be read: {error.strerror}") from None
    config = run.config
    dataset = config.dataset.model_dump(mode="json", exclude_defaults=True, exclude={"path"})
    judged = [dataset, config.evaluation.model_dump(mode="json", exclude_defaults=True)]
    text = json.dumps([name, content, data_hash(run.source), judged], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:_KEY_DIGITS]
