"""The values that the class modules give: claims with their evidence and capabilities, and the tool of a capability.

A `Claim` is one class module's reading of one device ("this unit holds a camera, because ..."). Several modules may
claim one unit, because a unit is a bus device and may carry several kernel classes (a drive with a temperature
sensor). The first claim in the order of the modules states what the unit is; the capabilities of all of them count.

A `Kind` is the tool of one capability as far as it is known before any host is.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from octoform.records import dataclass, field

READ, ACTUATE = "read", "actuate"
SENSOR, ACTUATOR, BIDIRECTIONAL = "sensor", "actuator", "bidirectional"
INFRASTRUCTURE, UNKNOWN = "infrastructure", "unknown"
# Writes JSON Schemas in few words, in exactly the form that the generated server's own types give.
#
# A record's ``title`` is the name of the class that the server makes of it; two records of one title must be equal.
# Units are in the names of members (``size_bytes``) or beside the value (``unit``).

Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}
WHOLE: Schema = {"type": "integer"}
NUMBER: Schema = {"type": "number"}


@dataclass(frozen=True, slots=True)
class Evidence:
    """A quote that stands verbatim in the device's PROBE entry, and what follows from it."""

    quote: str
    says: str = ""

    def as_json(self) -> dict[str, str]:
        """The schema's object; both texts within its bounds."""
        value = {"quote": self.quote[:500]}
        return {**value, "says": self.says[:300]} if self.says else value


@dataclass(frozen=True, slots=True)
class Capability:
    """One thing that a caller could do, through one standard interface, with what INTERFACE must know about it."""

    name: str
    description: str
    via: str
    effect: str = READ
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The schema's object; no `parameters` when there are none."""
        value: dict[str, Any] = {
            "name": self.name,
            "description": self.description[:500],
            "via": self.via[:200],
            "effect": self.effect,
        }
        return {**value, "parameters": dict(self.parameters)} if self.parameters else value


@dataclass(frozen=True, slots=True)
class Claim:
    """One class module's reading of a unit.

    ``kind`` is the class word of the annotation, ``noun`` what the thing is called when nothing names the product.
    ``names`` are the kernel's own strings for it, best first, each with the lines it is in. ``settled`` is false
    where even the class is an inference: the annotation then stays below one half.
    """

    kind: str
    category: str
    noun: str
    evidence: tuple[Evidence, ...]
    capabilities: tuple[Capability, ...] = ()
    names: tuple[tuple[str, ...], ...] = ()
    settled: bool = True
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Leave:
    """A unit that is not identified, and why; ``reason`` is one of the schema's words."""

    reason: str
    detail: str


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
