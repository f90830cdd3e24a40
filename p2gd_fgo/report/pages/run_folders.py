"""Records of runs whose folders alone are known: what they differ in is read from their files."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from p2gd_fgo.errors import DataError
from p2gd_fgo.run_directory import CONFIG, EVENTS, METRICS, read_status
from p2gd_fgo.run_record import Label, RunRecord

_SHORT = {"backend.kind": "backend", "distribution.kind": "distribution"}
_NOT_OF_THE_METHOD = ("name", "runtime.seed", "dataset.path")
_KEPT_APART = ("tracking", "cpu_ms", "chosen")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """What a run directory says; ``metrics`` and ``config`` are empty where the file isn't there.

    ``config`` is flat: ``backend.kind`` and so on.
    """

    path: Path
    state: str
    reason: str | None
    version: str
    metrics: Mapping[str, Any]
    config: Mapping[str, Any]
    events: Mapping[str, int]

    @property
    def recording(self) -> tuple[object, ...]:
        """What tells recordings, and pieces of one, from each other."""
        names = ("dataset.path", "dataset.start_s", "dataset.duration_s")
        return tuple(self.config.get(name) for name in names)


def read_folder(path: Path) -> RunFolder:
    """Read a run directory.

    Raises
    ------
    DataError
        A file of it is no JSON or YAML.
    """
    status = read_status(path) or {}
    return RunFolder(
        path,
        str(status.get("state")),
        status.get("reason"),
        str(status.get("version")),
        _json(path / METRICS),
        dict(_flat(_yaml(path / CONFIG))),
        _events(path / EVENTS),
    )


def records_of(folders: Sequence[RunFolder]) -> list[RunRecord]:
    """One record for each folder, in their order; none of them may be running.

    Its axes are back end, distribution, and every option in which runs of one recording differ.
    """
    names = _sequence_names(folders)
    differing = _differing(folders)
    shown = _axis_names(differing)
    records = []
    for folder, name in zip(folders, names, strict=True):
        axes = {shown[key]: _label(folder.config.get(key)) for key in differing}
        metrics, seed = folder.metrics, folder.config.get("runtime.seed", 0)
        done = folder.state == "done"
        records.append(
            RunRecord(
                key=str(folder.path),
                study="",
                axes=axes | {"sequence": name, "seed": seed},
                sequence=name,
                route=name,
                group="",
                seed=int(seed),
                status="done" if done else "failed",
                reason=None if done else str(folder.reason),
                metrics={k: v for k, v in metrics.items() if k not in _KEPT_APART},
                tracking=metrics.get("tracking", {}),
                events=folder.events,
                cpu_ms=metrics.get("cpu_ms", {}),
                directory=str(folder.path),
                versions={"p2gd_fgo": folder.version},
            )
        )
    return records


def _sequence_names(folders: Sequence[RunFolder]) -> list[str]:
    """The recordings' names; two of one name get what else tells them apart."""
    names = {}
    for folder in folders:
        chosen = folder.metrics.get("chosen", {}).get("sequence")
        path = folder.config.get("dataset.path") or folder.path.name
        names[folder.recording] = str(chosen or "").partition(" · ")[0] or Path(str(path)).name
    taken = list(names.values())
    full = {
        recording: name if taken.count(name) == 1 else f"{name} ({_piece(recording)})"
        for recording, name in names.items()
    }
    return [full[folder.recording] for folder in folders]


def _piece(recording: tuple[object, ...]) -> str:
    path, start, duration = recording
    text = f"{path}"
    if start:
        text += f" from {start} s"
    return text if duration is None else f"{text} for {duration} s"


def _differing(folders: Sequence[RunFolder]) -> list[str]:
    """Keys of the method: back end and distribution always, others where runs differ in them."""
    found = dict.fromkeys(_SHORT)
    for recording in dict.fromkeys(folder.recording for folder in folders):
        configs = [f.config for f in folders if f.recording == recording and f.config]
        for key in dict.fromkeys(key for config in configs for key in config):
            if key not in _NOT_OF_THE_METHOD and any(
                c.get(key) != configs[0].get(key) for c in configs
            ):
                found.setdefault(key)
    return list(found)


def _axis_names(keys: Sequence[str]) -> dict[str, str]:
    """The last part of a key, where it says enough."""
    last = [key.rpartition(".")[2] for key in keys]
    return {
        key: _SHORT.get(key) or (short if last.count(short) == 1 else key)
        for key, short in zip(keys, last, strict=True)
    }


def _label(value: object) -> Label:
    return value if isinstance(value, str | int | float | bool) else str(value)


def _flat(value: object, prefix: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{prefix}.{key}" if prefix else str(key))
    elif prefix:
        yield prefix, tuple(value) if isinstance(value, list) else value


def _json(path: Path) -> Mapping[str, Any]:
    if not path.exists():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: can't be read as JSON ({error}); run it again") from None
    if not isinstance(found, dict):
        raise DataError(f"{path}: holds no metrics of a run; run it again")
    return found


def _yaml(path: Path) -> object:
    if not path.exists():
        return {}
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        what = " ".join(str(error).split())
        raise DataError(f"{path}: can't be read as YAML ({what}); run it again") from None


def _events(path: Path) -> dict[str, int]:
    kinds: dict[str, int] = {}
    if not path.exists():
        return kinds
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            kind = str(json.loads(line)["kind"])
        except (ValueError, KeyError, TypeError):
            raise DataError(f"{path}: a line is no event; run it again") from None
        kinds[kind] = kinds.get(kind, 0) + 1
    return kinds
