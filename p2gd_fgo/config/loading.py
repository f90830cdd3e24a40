"""Read, override, resolve, dump and hash configurations."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from p2gd_fgo.config import yaml_text
from p2gd_fgo.config.models import Config
from p2gd_fgo.config.refusals import place_of, refusal
from p2gd_fgo.errors import ConfigError

_WIDE_IMAGE_PX = 1000
_BY_WIDTH = {  # paper IV-A1: KAIST Urban (1280 px wide) and the robot (800 px)
    True: {"max_features": 180, "grid": (10, 6), "min_distance_px": 40.0},
    False: {"max_features": 150, "grid": (8, 6), "min_distance_px": 30.0},
}


def load_config(path: Path | None = None) -> Config:
    """Read a YAML configuration, its ``extends:`` chain first; defaults without a path.

    ``extends`` names one file or a list of files, relative to the file that says so; later files
    win over earlier ones, and the file itself over all of them.

    Raises
    ------
    ConfigError
        Missing or unreadable file, a circle of ``extends``, an unknown key (the nearest valid one
        is named) or a value out of bounds.
    """
    data = {} if path is None else _read(Path(path), ())
    return _validate(data, str(path) if path is not None else "the configuration")


def override(
    config: Config,
    settings: Mapping[str, object],
    options: Mapping[str, str] | None = None,
) -> Config:
    """A copy with fields replaced: ``{"frontend.max_features": 180}``; values may be YAML text.

    Parameters
    ----------
    config
        What is copied.
    settings
        Dotted names and values.
    options
        Of some of these names the option that they were given by, for what is said of a value
        that is refused; ``--set`` for the others.

    Raises
    ------
    ConfigError
        As :func:`load_config`.
    """
    data = config.model_dump(exclude_unset=True)
    options = options or {}
    for key, value in settings.items():
        node = data
        *parents, leaf = key.split(".")
        for parent in parents:
            node = node.setdefault(parent, {})
            if not isinstance(node, dict):
                raise ConfigError(f"--set {key}: '{parent}' holds a value, not further keys")
        node[leaf] = _parse(value, key, options.get(key)) if isinstance(value, str) else value
    return _validate(data, "--set", options)


def resolve(config: Config, image_width: int) -> Config:
    """Fill the fields whose default depends on the image or on another field.

    Wide images (over 1000 px) get the paper's KAIST settings, others those of its robot; a track
    is at most as long as the window, and prior poses reach as far ahead (paper III-C2).
    """
    chosen: dict[str, object] = dict(_BY_WIDTH[image_width > _WIDE_IMAGE_PX])
    chosen["max_track_length"] = config.backend.window
    missing = {k: v for k, v in chosen.items() if getattr(config.frontend, k) is None}
    frontend = config.frontend.model_copy(update=missing)
    distribution = config.distribution
    if distribution.p2gd.horizon is None:
        p2gd = distribution.p2gd.model_copy(update={"horizon": config.backend.window})
        distribution = distribution.model_copy(update={"p2gd": p2gd})
    return config.model_copy(update={"frontend": frontend, "distribution": distribution})


def dump_yaml(config: Config, *, comments: bool = False) -> str:
    """The whole configuration as YAML, with each field's meaning behind it on request."""
    return "\n".join(_lines(config, 0, comments)) + "\n"


def config_hash(config: Config, *extra: str) -> str:
    """Ten hex digits that name the resolved configuration (and extra strings, such as a path)."""
    text = json.dumps([config.model_dump(mode="json"), *extra], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:10]


def _read(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    try:
        path = path.resolve()
        if path in above:
            raise ConfigError(f"{path}: 'extends' goes round in a circle through this file")
        if path.stat().st_size > yaml_text.MAX_CHARACTERS:
            raise ValueError("too large")
        data = yaml_text.parse(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such configuration file") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {error}") from None
    if data is None:
        data = {}
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: a configuration is a mapping of keys, not a {_kind(data)}")
    bases = data.pop("extends", [])
    if isinstance(bases, str):
        bases = [bases]
    if not isinstance(bases, list) or not all(isinstance(b, str) for b in bases):
        raise ConfigError(f"{path}: 'extends' takes a file name or a list of them, not {bases!r}")
    merged: dict[str, Any] = {}
    for base in bases:
        merged = _merge(merged, _read(path.parent / base, (*above, path)))
    return _merge(merged, data)


def _merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in over.items():
        old = out.get(key)
        if isinstance(old, dict) and isinstance(value, dict | None):
            out[key] = _merge(old, value or {})
        else:
            out[key] = value
    return out


def _parse(text: str, key: str, option: str | None) -> Any:
    """The value that text stands for: YAML, except that a text field takes it as it is."""
    if _is_text(key) and text != "null" and not text.startswith(("'", '"')):
        return text
    try:
        return yaml_text.parse(text)
    except ValueError:
        raise ConfigError(f"{option or f'--set {key}'}: {text!r} is not a YAML value") from None


def _is_text(key: str) -> bool:
    model: type[BaseModel] | None = Config
    options: tuple[Any, ...] = ()
    for name in key.split("."):
        info = model.model_fields.get(name) if model is not None else None
        if info is None:
            return False
        model, options = _model_of(info.annotation), _options(info.annotation)
    return str in options


def _kind(value: object) -> str:
    return "list" if isinstance(value, list) else type(value).__name__


def _validate(
    data: dict[str, Any], source: str, options: Mapping[str, str] | None = None
) -> Config:
    for dotted, node, model in _unknown_keys(data, Config, ""):
        names = list(model.model_fields)
        near = difflib.get_close_matches(node, names, n=1, cutoff=0.5)
        elsewhere = [key for key in _keys(Config, "") if key.endswith(f".{dotted}")]
        likely = " or ".join(f"'{key}'" for key in (elsewhere or near))
        hint = f"did you mean {likely}?" if likely else f"it takes {', '.join(names)}"
        raise ConfigError(f"{source}: unknown key '{dotted}': {hint}")
    try:
        return Config.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        source = (options or {}).get(place_of(first), source)
        raise ConfigError(f"{source}: {refusal(first)}") from None


def _unknown_keys(
    data: Mapping[Any, Any], model: type[BaseModel], prefix: str
) -> Iterator[tuple[str, str, type[BaseModel]]]:
    for key, value in data.items():
        info = model.model_fields.get(str(key))
        if info is None:
            yield f"{prefix}{key}", str(key), model
            continue
        inner = _model_of(info.annotation)
        if inner is not None and isinstance(value, dict):
            yield from _unknown_keys(value, inner, f"{prefix}{key}.")


def _keys(model: type[BaseModel], prefix: str) -> Iterator[str]:
    """Dotted names of all fields."""
    for name, info in model.model_fields.items():
        yield f"{prefix}{name}"
        inner = _model_of(info.annotation)
        if inner is not None:
            yield from _keys(inner, f"{prefix}{name}.")


def _model_of(annotation: Any) -> type[BaseModel] | None:
    for option in _options(annotation):
        if isinstance(option, type) and issubclass(option, BaseModel):
            return option
    return None


def _options(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)


def _lines(model: BaseModel, indent: int, comments: bool) -> Iterator[str]:
    pad = "  " * indent
    for name, info in type(model).model_fields.items():
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            note = (type(value).__doc__ or "").strip().splitlines()[0]
            yield f"{pad}{name}:" + (f"  # {note}" if comments else "")
            yield from _lines(value, indent + 1, comments)
            continue
        text = yaml_text.dump_value(list(value) if isinstance(value, tuple) else value)
        line = f"{pad}{name}: {text}"
        yield f"{line:<36}  # {info.description}" if comments and info.description else line
