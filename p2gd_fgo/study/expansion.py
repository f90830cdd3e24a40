"""From a study to its runs: the product of recordings and axes, by the rules."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from p2gd_fgo.config import Config, load_config, override, resolve
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import ConfigError, P2gdError
from p2gd_fgo.run_record import Label
from p2gd_fgo.simulation.presets import find_preset, load_scenario
from p2gd_fgo.simulation.production import with_route_hash
from p2gd_fgo.simulation.scenario import Scenario
from p2gd_fgo.study.external import External, find_externals
from p2gd_fgo.study.keys import data_hash, run_key
from p2gd_fgo.study.rules import is_kept
from p2gd_fgo.study.runs import Recorded, Rendered, Run
from p2gd_fgo.study.spec import AxisValue, SequenceSpec, StudySpec

_SEED_FIELD = "runtime.seed"
SHORT_NAMES = {
    "distribution": "distribution.kind",
    "backend": "backend.kind",
    "window": "backend.window",
    "tracker": "frontend.tracker",
    "priors": "priors.source",
    "seed": _SEED_FIELD,
}
"""Axes that name a field of the configuration by one word."""

SEEDS_A_ROUTE = 1000
"""The IMU's noise on route r with seed s is drawn from seed 1000 r + s: no two are alike."""


@dataclass(frozen=True, slots=True)
class Plan:
    """All runs of a study.

    Attributes
    ----------
    spec
        The study, in the profile chosen.
    runs
        In the order in which they are started.
    left_out
        Recordings and trajectories that a study names and nobody has given, by path.
    externals
        Trajectories of other programs that are there.
    absent
        Those that aren't, of programs that have one for another recording.
    """

    spec: StudySpec
    runs: tuple[Run, ...]
    left_out: tuple[str, ...]
    externals: tuple[External, ...] = ()
    absent: tuple[Path, ...] = ()

    @property
    def rows(self) -> tuple[Run | External, ...]:
        """Whatever has a line in the results."""
        return (*self.runs, *self.externals)


@dataclass(frozen=True, slots=True)
class _Route:
    name: str
    group: str
    seed: int | None
    settings: Mapping[str, Any]
    scenario: Scenario | None
    folder: Path | None

    def source(self, seed: int, config: Config) -> Rendered | Recorded:
        if self.scenario is None:
            return self._opened(config)
        assert self.seed is not None
        imu = self.scenario.imu.model_copy(update={"seed": self.seed * SEEDS_A_ROUTE + seed})
        scenario = self.scenario.model_copy(update={"imu": imu})
        return Rendered(scenario, round(scenario.duration_s * scenario.camera.rate_hz) + 1)

    def _opened(self, config: Config) -> Recorded:
        assert self.folder is not None
        dataset = config.dataset.model_copy(update={"path": str(self.folder)})
        try:
            sequence = open_sequence(dataset)
        except P2gdError as error:
            raise ConfigError(f"{error} (named by the study, under --data)") from None
        return Recorded(
            self.folder, len(sequence.image_stamps_ns), sequence.calibration.camera.width
        )


def expand(spec: StudySpec, folder: Path, data: Path | None = None) -> Plan:
    """All runs of a study.

    Parameters
    ----------
    folder
        Where the study's file lies.
    data
        Root of the recordings; without it entries with a relative path are left out.

    Raises
    ------
    ConfigError, DataError
        A setting, rule or recording that can't be used, two runs that are the same, or another
        program without any trajectory.
    """
    base = _base(spec, folder)
    routes, left_out = _routes(spec, folder, data)
    _check_seeds(spec)
    runs: dict[str, Run] = {}
    for route in routes:
        hashes: dict[int, tuple[Rendered | Recorded, str]] = {}
        for values in itertools.product(*_axes(spec).values()):
            chosen = dict(zip(_axes(spec), values, strict=True))
            labels = {name: value.label for name, value in chosen.items()}
            places = {"group": route.group, "route": route.name, "sequence": route.name}
            known = {name: str(label) for name, label in labels.items()} | places
            if not is_kept(spec.include, spec.exclude, known):
                continue
            config = _config(spec, base, route, chosen)
            seed = config.runtime.seed
            if not 0 <= seed < SEEDS_A_ROUTE:
                raise ConfigError(
                    f"{spec.name}: {_SEED_FIELD} is {seed}: give one below {SEEDS_A_ROUTE}"
                )
            shared = seed if route.scenario is not None else 0
            if shared not in hashes:
                source = route.source(seed, config)
                hashes[shared] = (source, data_hash(source))
            source, held = hashes[shared]
            config = resolve(config, source.width)
            place = source.folder if isinstance(source, Recorded) else None
            key = run_key(config, held, place)
            if key in runs:
                raise ConfigError(
                    f"{spec.name}: the runs '{runs[key].label}' and '{_label(route, labels)}' are "
                    "the same: leave one out with 'exclude', or change its settings"
                )
            runs[key] = Run(
                key, spec.name, labels, route.name, route.name, route.group, seed,
                config, source, spec.timeout_s, spec.segments,
            )  # fmt: skip
    if not runs:
        hint = f" (--data is not given, which {', '.join(left_out)} need)" if left_out else ""
        raise ConfigError(f"{spec.name}: the rules leave no run{hint}")
    planned = tuple(runs.values())
    found = find_externals(spec, planned, folder, data)
    return Plan(spec, planned, (*left_out, *found.left_out), found.there, found.absent)


def _axes(spec: StudySpec) -> dict[str, tuple[AxisValue, ...]]:
    """The axes with the seed's first: its runs share a recording."""
    return dict(sorted(spec.axes.items(), key=lambda axis: axis[0] != "seed"))


def _check_seeds(spec: StudySpec) -> None:
    if _SEED_FIELD in spec.axes:
        raise ConfigError(f"{spec.name}: axes.{_SEED_FIELD}: name the axis 'seed'")
    for value in spec.axes.get("seed", ()):
        seed = value.label
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < SEEDS_A_ROUTE:
            raise ConfigError(
                f"{spec.name}: axes.seed has {seed!r}: give whole numbers from 0 to "
                f"{SEEDS_A_ROUTE - 1}"
            )


def _base(spec: StudySpec, folder: Path) -> Config:
    path = None
    if spec.base.config is not None:
        above = folder.resolve().parents
        places = (p / spec.base.config for p in (folder, *(a / "configs" for a in above)))
        path = next((place for place in places if place.is_file()), None)
        if path is None:
            raise ConfigError(
                f"{spec.name}: base.config '{spec.base.config}' is neither in {folder} nor in "
                "configs/"
            )
    return _override(load_config(path), spec.base.settings, f"{spec.name}: base.settings")


def _routes(spec: StudySpec, folder: Path, data: Path | None) -> tuple[list[_Route], list[str]]:
    routes: list[_Route] = []
    left_out = []
    for entry in spec.sequences:
        if entry.simulate is not None:
            routes += _rendered(entry, folder)
            continue
        assert entry.path is not None
        place = Path(entry.path).expanduser()
        if not place.is_absolute():
            if data is None:
                left_out.append(entry.path)
                continue
            place = data.expanduser() / place
        (name,) = entry.names
        routes.append(_Route(name, entry.group_name, None, entry.settings, None, place.resolve()))
    names = [route.name for route in routes]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(
                f"{spec.name}: two recordings are called '{name}': give them a 'name' or a 'group'"
            )
    return routes, left_out


def _rendered(entry: SequenceSpec, folder: Path) -> Iterator[_Route]:
    assert entry.simulate is not None
    near = folder / entry.simulate
    path = near if near.is_file() else find_preset(entry.simulate)
    for name, seed in zip(entry.names, entry.routes, strict=True):
        settings = {**entry.scenario, "seed": seed}
        if entry.duration_s is not None:
            settings["duration_s"] = entry.duration_s
        scenario = with_route_hash(load_scenario(path, settings))
        yield _Route(name, entry.group_name, seed, entry.settings, scenario, None)


def _config(
    spec: StudySpec, base: Config, route: _Route, chosen: Mapping[str, AxisValue]
) -> Config:
    config = _override(base, route.settings, f"{spec.name}: {route.name}")
    for name, value in chosen.items():
        if value.settings is None:
            field = SHORT_NAMES.get(name, name)
            if "." not in field:
                raise ConfigError(
                    f"{spec.name}: axes.{name} is neither a field of the configuration nor one of "
                    f"{', '.join(SHORT_NAMES)}: give each value its settings, as "
                    "{label: {key: value}}"
                )
            settings: Mapping[str, Any] = {field: value.label}
        else:
            settings = value.settings
        config = _override(config, settings, f"{spec.name}: axes.{name}, {value.label}")
    return override(config, {"runtime.threads": 1, "name": route.name, "dataset.path": None})


def _override(config: Config, settings: Mapping[str, Any], where: str) -> Config:
    try:
        return override(config, settings)
    except ConfigError as error:
        raise ConfigError(f"{where}: {str(error).removeprefix('--set').lstrip(': ')}") from None


def _label(route: _Route, labels: Mapping[str, Label]) -> str:
    return " · ".join([route.name, *(str(label) for label in labels.values())])
