"""Read, override, write and hash scenarios."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from p2gd_fgo.config import yaml_text
from p2gd_fgo.config.refusals import place_of, refusal
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.simulation.scenario import Scenario

PRESETS = Path(__file__).parent / "scenarios"


def find_preset(name: str) -> Path:
    """Find the file of a preset, or take ``name`` as a path.

    Raises
    ------
    ConfigError
        Neither.
    """
    for path in (Path(name), Path("configs/simulation") / f"{name}.yaml", PRESETS / f"{name}.yaml"):
        if path.is_file():
            return path
    known = sorted(path.stem for path in PRESETS.glob("*.yaml"))
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(known)}"
    raise ConfigError(f"'{name}' is neither a preset nor a scenario file: {hint}")


def load_scenario(path: Path, settings: Mapping[str, object] | None = None) -> Scenario:
    """Read a YAML scenario, its ``extends:`` first, and replace fields by dotted name.

    A relative ``route.file`` is taken from the scenario's folder.

    Raises
    ------
    ConfigError
        No such file, unreadable, an unknown key, or a value out of bounds.
    """
    data = _read(path, ())
    for key, value in (settings or {}).items():
        node = data
        *parents, leaf = key.split(".")
        for parent in parents:
            node = node.setdefault(parent, {})
            if not isinstance(node, dict):
                raise ConfigError(f"--set {key}: '{parent}' holds a value, not further keys")
        node[leaf] = _value(value, key)
    route = data.get("route")
    chosen = (settings or {}).get("route.file")
    if isinstance(route, dict) and isinstance(route.get("file"), str) and chosen is None:
        route["file"] = str(path.parent / route["file"])
    data.setdefault("name", path.stem)
    return check_scenario(data, str(path), settings)


def check_scenario(
    data: dict[str, Any], source: str, settings: Mapping[str, object] | None = None
) -> Scenario:
    """Make a scenario of plain data, of which ``settings`` were given by options.

    Raises
    ------
    ConfigError
        With ``source`` or ``--set``, the key and the value.
    """
    for dotted, key, names in _unknown(data, Scenario, ""):
        near = difflib.get_close_matches(key, names, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else f"it takes {', '.join(names)}"
        raise ConfigError(f"{source}: unknown key '{dotted}': {hint}")
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = place_of(first)
        set_here = any(where == key or where.startswith(f"{key}.") for key in settings or ())
        raise ConfigError(f"{'--set' if set_here else source}: {refusal(first)}") from None


def dump_scenario(scenario: Scenario) -> str:
    """Write the whole scenario as YAML that :func:`load_scenario` reads back."""
    lines = []
    for name, value in scenario.model_dump(mode="json").items():
        if isinstance(value, dict):
            lines.append(f"{name}:")
            lines += [f"  {key}: {yaml_text.dump_value(v)}" for key, v in value.items()]
        else:
            lines.append(f"{name}: {yaml_text.dump_value(value)}")
    return "\n".join(lines) + "\n"


def scenario_hash(scenario: Scenario, version: int) -> str:
    """Twelve hex digits that name everything that the recording's bytes depend on."""
    return _hash([version, _content(scenario)])


def images_hash(scenario: Scenario, version: int) -> str:
    """Twelve hex digits that name what the images depend on: all but the IMU and the name."""
    data = _content(scenario)
    del data["imu"]
    return _hash([version, "images", data, scenario.imu.time_offset_s])


def _content(scenario: Scenario) -> dict[str, Any]:
    """Everything but the name; a route counts by its content, not by where its file is."""
    data = scenario.model_dump(mode="json", exclude={"name": True})
    if scenario.route.sha256 is not None:
        del data["route"]["file"]
    return data


def _hash(data: object) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:12]


def _value(value: object, key: str) -> object:
    if not isinstance(value, str) or key in {"name", "route.file"}:
        return value
    try:
        return yaml_text.parse(value)
    except ValueError:
        raise ConfigError(f"--set {key}: {value!r} is not a YAML value") from None


def _read(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    path = path.resolve()
    if path in above:
        raise ConfigError(f"{path}: 'extends' goes round in a circle through this file")
    try:
        data = yaml_text.parse(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such scenario file") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {error}") from None
    if not isinstance(data, dict | None):
        raise ConfigError(f"{path}: a scenario is a mapping of keys")
    data = data or {}
    base = data.pop("extends", None)
    if base is None:
        return data
    if not isinstance(base, str):
        raise ConfigError(f"{path}: 'extends' takes one file name, not {base!r}")
    return _merged(_read(path.parent / base, (*above, path)), data)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in over.items():
        old = out.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            out[key] = _merged(old, value)
        else:
            out[key] = value
    return out


def _unknown(
    data: Mapping[str, Any], model: type[BaseModel], prefix: str
) -> Iterator[tuple[str, str, list[str]]]:
    for key, value in data.items():
        info = model.model_fields.get(str(key))
        if info is None:
            yield f"{prefix}{key}", str(key), list(model.model_fields)
            continue
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel) and isinstance(value, dict):
            yield from _unknown(value, inner, f"{prefix}{key}.")
