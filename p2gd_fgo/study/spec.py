"""A study as a user writes it: question, base, recordings, axes, rules, pairing, profiles."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from p2gd_fgo.config import yaml_text
from p2gd_fgo.config.base import Model, Positive
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.run_record import Label
from p2gd_fgo.study.ranges import spread
from p2gd_fgo.study.rules import Rule, check_rules

FULL = "full"
"""The profile of a study as it is written; every other one overrides parts of it."""


def _bundles(value: Any) -> Any:
    """Values of an axis as label and settings; a plain value is its own label."""
    value = spread(value)
    if isinstance(value, dict):
        value = [{label: settings} for label, settings in value.items()]
    if not isinstance(value, list):
        value = [value]
    values = []
    for given in value:
        if not isinstance(given, dict):
            values.append({"label": given, "settings": None})
            continue
        values += [{"label": label, "settings": held or {}} for label, held in given.items()]
    return values


class AxisValue(Model):
    """One value of an axis."""

    label: Label = Field(description="what tables call it")
    settings: dict[str, Any] | None = Field(
        description="fields of the configuration; null: the axis is a field, the label its value"
    )


Axis = Annotated[tuple[AxisValue, ...], BeforeValidator(_bundles), Field(min_length=1)]


class BaseSpec(Model):
    """The configuration that all runs share."""

    config: str | None = Field(
        None, description="file, relative to the study's folder or to configs/"
    )
    settings: dict[str, Any] = Field({}, description="fields by dotted name, over the file")


class SequenceSpec(Model):
    """Recordings of one kind: routes rendered from their seeds, or a folder."""

    simulate: str | None = Field(None, description="preset or scenario file to render")
    routes: Annotated[tuple[int, ...], BeforeValidator(spread)] = Field(
        (), description="simulate: seeds, as [200, 201] or 200..211"
    )
    duration_s: Positive | None = Field(None, description="simulate: null: the preset's own")
    scenario: dict[str, Any] = Field({}, description="simulate: fields of the scenario")
    path: str | None = Field(None, description="folder of a recording, relative to --data")
    name: str | None = Field(None, description="path: short name; null: the folder's")
    group: str | None = Field(
        None, description="what stands together in tables; null: the preset, or 'recordings'"
    )
    settings: dict[str, Any] = Field({}, description="fields of the configuration, over the base")

    @model_validator(mode="after")
    def _one_kind(self) -> SequenceSpec:
        if (self.simulate is None) == (self.path is None):
            raise ValueError("an entry has either 'simulate' or 'path'")
        if self.simulate is not None and not self.routes:
            raise ValueError(f"simulate: {self.simulate} needs routes, such as 1..12")
        if len(set(self.routes)) < len(self.routes):
            raise ValueError(f"simulate: {self.simulate} has a route twice")
        if self.path is not None and (self.routes or self.duration_s or self.scenario):
            raise ValueError("routes, duration_s and scenario are for 'simulate'")
        return self

    @property
    def group_name(self) -> str:
        """What its recordings are called together."""
        return self.group or ("recordings" if self.simulate is None else Path(self.simulate).stem)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its recordings, in their order."""
        if self.path is not None:
            return (self.name or Path(self.path).expanduser().name,)
        return tuple(f"{self.group_name}-{seed}" for seed in self.routes)


class PairingSpec(Model):
    """What is compared: runs that differ in this axis alone are a pair."""

    axis: str = Field(description="an axis of the study")
    baseline: Label = Field(description="the label that the others are compared with")


class ProfileSpec(Model):
    """What another size of the study replaces."""

    note: str = Field("", description="what it is for")
    sequences: tuple[SequenceSpec, ...] | None = Field(None, description="instead of all")
    axes: dict[str, Axis] = Field({}, description="instead of those of these names")
    timeout_s: Positive | None = Field(None, description="instead of the study's")


class StudySpec(Model):
    """All of a study."""

    name: str = Field(pattern=r"^[a-zA-Z0-9_-]+$", description="of the study")
    question: str = Field(description="that it answers")
    base: BaseSpec = BaseSpec()
    sequences: tuple[SequenceSpec, ...] = Field(min_length=1)
    axes: dict[str, Axis] = Field({}, description="name: values; runs are their product")
    include: tuple[Rule, ...] = Field((), description="keep only runs that one of these fits")
    exclude: tuple[Rule, ...] = Field((), description="leave out runs that one of these fits")
    pairing: PairingSpec | None = None
    external: dict[str, str] = Field(
        {},
        description="trajectories of other programs, name: path/{sequence}.tum, under --data or in "
        "the study's folder; their name is a label on the pairing axis",
    )
    timeout_s: Positive = Field(1800.0, description="of one run, its rendering aside")
    segments: bool = Field(
        False, description="put the errors of each 10 m of the way into the records: 0.5 kB each"
    )
    profiles: dict[str, ProfileSpec] = Field({}, description="other sizes of the study, by name")

    @model_validator(mode="after")
    def _consistent(self) -> StudySpec:
        self.check_axes()
        check_rules((*self.include, *self.exclude), self._labels())
        return self

    def _labels(self) -> dict[str, list[str]]:
        """Whatever a rule may name, in any profile."""
        known: dict[str, dict[str, None]] = {}
        for axes in (self.axes, *(profile.axes for profile in self.profiles.values())):
            for name, values in axes.items():
                known.setdefault(name, {}).update({str(value.label): None for value in values})
        entries = [*self.sequences]
        for profile in self.profiles.values():
            entries += profile.sequences or ()
        names = dict.fromkeys(name for entry in entries for name in entry.names)
        known |= {"group": dict.fromkeys(entry.group_name for entry in entries)}
        return {name: list(found) for name, found in known.items()} | {
            "route": list(names), "sequence": list(names)
        }  # fmt: skip

    def check_axes(self) -> None:
        """Refuse axes with a label twice, a pairing that isn't on them, and externals without one.

        Raises
        ------
        ValueError
            In the words of an error of the file.
        """
        for name, values in self.axes.items():
            labels = [str(value.label) for value in values]
            if len(set(labels)) < len(labels):
                raise ValueError(f"axes.{name} has a label twice: {', '.join(labels)}")
        if self.pairing is not None:
            if self.pairing.axis not in self.axes:
                raise ValueError(
                    f"pairing.axis '{self.pairing.axis}' is no axis: "
                    f"there are {', '.join(self.axes) or 'none'}"
                )
            labels = [str(value.label) for value in self.axes[self.pairing.axis]]
            if str(self.pairing.baseline) not in labels:
                raise ValueError(
                    f"pairing.baseline '{self.pairing.baseline}' is not on the axis "
                    f"'{self.pairing.axis}': there are {', '.join(labels)}"
                )
            for name in set(self.external) & set(labels):
                raise ValueError(
                    f"external '{name}' is a label of the axis '{self.pairing.axis}', too: give it "
                    "another name"
                )
        elif self.external:
            raise ValueError(
                "external needs 'pairing', which says beside what these trajectories stand"
            )

    def profile(self, name: str) -> StudySpec:
        """The study in another size.

        Raises
        ------
        ConfigError
            No such profile, or its axes don't fit the pairing.
        """
        if name == FULL and name not in self.profiles:
            return self
        if name not in self.profiles:
            known = [FULL, *(p for p in self.profiles if p != FULL)]
            raise ConfigError(
                f"--profile {name}: {self.name} has no such profile: there are {', '.join(known)}"
            )
        chosen = self.profiles[name]
        data: dict[str, Any] = {"axes": self.axes | chosen.axes}
        if chosen.sequences is not None:
            data["sequences"] = chosen.sequences
        if chosen.timeout_s is not None:
            data["timeout_s"] = chosen.timeout_s
        made = self.model_copy(update=data)
        try:
            made.check_axes()
        except ValueError as error:
            raise ConfigError(f"--profile {name}: {error}") from None
        return made


def load_study(path: Path) -> StudySpec:
    """Read a study.

    Raises
    ------
    ConfigError
        No such file, unreadable, an unknown key (the nearest valid one is named) or a bad value.
    """
    try:
        data = yaml_text.parse(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such study file") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {error}") from None
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: a study is a mapping of keys")
    try:
        return StudySpec.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{path}: {_sentence(error)}") from None


def _sentence(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _fields_of(first["loc"][:-1])
        near = difflib.get_close_matches(str(first["loc"][-1]), known, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else f"it takes {', '.join(known)}"
        return f"unknown key '{where}': {hint}"
    message = first["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if first["type"] == "missing":
        return f"'{where}' is missing"
    given = first["input"]
    value = "" if isinstance(given, Mapping | Model | list | tuple) else f" is {given!r}"
    return f"{where}{value}: {message}" if where else message


def _fields_of(location: tuple[int | str, ...]) -> list[str]:
    models: dict[str, type[Model]] = {
        "base": BaseSpec, "sequences": SequenceSpec, "pairing": PairingSpec, "profiles": ProfileSpec
    }  # fmt: skip
    for part in reversed(location):
        if part in models:
            return list(models[str(part)].model_fields)
    return list(StudySpec.model_fields)
