"""YAML as configurations use it: plain trees, numbers such as 1e-05, no surprises.

A configuration comes from anywhere, so what makes YAML treacherous is refused: aliases (a few lines
of them expand to gigabytes), a key given twice, endless nesting.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

MAX_CHARACTERS = 1_000_000
_MAX_DEPTH = 50
_EXPONENT = re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")


class _Loader(yaml.SafeLoader):
    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        if self.check_event(yaml.AliasEvent):
            raise yaml.MarkedYAMLError(
                problem="aliases (*name) are not taken: repeat the value, or use 'extends'",
                problem_mark=mark,
            )
        if self.depth >= _MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem="nested too deep", problem_mark=mark)
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        given: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in given:
                raise yaml.MarkedYAMLError(
                    problem=f"the key '{name}' is given twice", problem_mark=key.start_mark
                )
            given.add(name)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    pass


# YAML 1.1 wants a dot in every float and takes 1e-05 for text.
for _class in (_Loader, _Dumper):
    _class.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))


def parse(text: str) -> Any:
    """Read one YAML document.

    Raises
    ------
    ValueError
        With what is wrong and where, on one line.
    """
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"longer than {MAX_CHARACTERS} characters")
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).split())) from None
    except (KeyError, IndexError, AttributeError, TypeError) as error:
        # What PyYAML makes of a tag on a value that isn't of its kind, such as "!!bool maybe".
        raise ValueError(f"a value that its tag doesn't fit ({error})") from None


def dump_value(value: object) -> str:
    """Write one value on one line, so that :func:`parse` gives it back."""
    text = yaml.dump(
        value, Dumper=_Dumper, default_flow_style=True, allow_unicode=True, width=float("inf")
    )
    return text.removesuffix("\n").removesuffix("\n...")
