"""What a model refuses, as a sentence that says what to write instead."""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING

from pydantic import BaseModel

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def place_of(error: ErrorDetails) -> str:
    """The dotted name of the field that was refused; empty for the whole."""
    return ".".join(str(part) for part in error["loc"])


def refusal(error: ErrorDetails) -> str:
    """The sentence for one refused value, without the file or option that it stands in."""
    where, value = place_of(error), error["input"]
    said = _said(error, where, value)
    if isinstance(value, dict | BaseModel):
        return f"{where}: {said}" if where else said
    return f"{where} is {value!r}: {said}" if where else said


def _said(error: ErrorDetails, where: str, value: object) -> str:
    kind, message = error["type"], error["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if kind == "literal_error" and isinstance(value, str):
        near = difflib.get_close_matches(value, re.findall(r"'([^']*)'", message), n=1, cutoff=0.5)
        return message + (f" (did you mean '{near[0]}'?)" if near else "")
    if kind == "tuple_type":
        numbers = re.findall(r"-?\d+(?:\.\d+)?", str(value))
        example = f", such as [{','.join(numbers)}]" if len(numbers) > 1 else ""
        return f"a list in brackets is expected{example}"
    if kind == "model_type":
        return f"a section of fields is expected: set {where}.FIELD"
    return message
