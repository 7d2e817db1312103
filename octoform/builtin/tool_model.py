"""The catalog's facts of a tool before any host is known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

from octoform.records import dataclass

# Writes JSON Schemas in few words, in exactly the form that the generated server's own types give.
#
# A record's ``title`` is the name of the class that the server makes of it; two records of one title must be equal.
# Units are in the names of members (``size_bytes``) or beside the value (``unit``).

Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}
WHOLE: Schema = {"type": "integer"}
NUMBER: Schema = {"type": "number"}


def record(title: str, **members: Schema) -> Schema:
    """An object that has all of these members."""
    return {"title": title, "type": "object", "properties": members, "required": list(members)}


def listing(items: Schema) -> Schema:
    """An array of one kind of item."""
    return {"type": "array", "items": items}


def maybe(value: Schema) -> Schema:
    """A value that the device may not report."""
    return {"anyOf": [value, {"type": "null"}]}


def whole(description: str, low: int, high: int, default: int) -> Schema:
    """An integer parameter with its unit in the description and an inclusive range."""
    return {"description": description, "type": "integer", "minimum": low, "maximum": high, "default": default}


def number(description: str, low: float, high: float, default: float | None = None) -> Schema:
    """A number parameter with its unit in the description and an inclusive range; required without a default."""
    schema: Schema = {"description": description, "type": "number", "minimum": low, "maximum": high}
    return schema if default is None else {**schema, "default": default}


def choice(description: str, *values: str) -> Schema:
    """One of some words; the first is the default."""
    return {**one_of(description, values), "default": values[0]}


def one_of(description: str, values: tuple[str, ...] | list[str]) -> Schema:
    """One of some words, without a default."""
    allowed: Schema = {"const": values[0]} if len(values) == 1 else {"enum": list(values)}
    return {"description": description, "type": "string", **allowed}


Facts = Sequence[Mapping[str, Any]]
"""The ``parameters`` that IDENTIFY gave the capability, one object per device."""


def no_parameters(_: Facts) -> dict[str, Schema]:
    """For tools that need nothing but the device."""
    return {}


@dataclass(frozen=True, slots=True)
class Kind:
    """One capability's tool.

    ``worth`` states what is kept when the tool budget is short: 90 what only hardware can do (see, hear, move), 60 a
    measurement, 30 a description of something that another tool already shows. ``parameters`` makes the properties
    beside ``device``. ``smoke`` are the arguments of a test call that is quick and changes nothing; only for reads.
    ``units`` names the unit of each bounded parameter, for the tool's limits. ``stops``: it ends a movement that is
    under way, so it does not wait for it. ``acts_on`` is the tool's ``units``: of a device with several, which ones.
    """

    name: str
    description: str
    output: Schema
    worth: int
    effect: str = "read"
    parameters: Callable[[Facts], dict[str, Schema]] = no_parameters
    smoke: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    idempotent: bool = True
    stops: bool = False
    acts_on: Mapping[str, Any] = field(default_factory=dict)
