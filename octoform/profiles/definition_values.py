"""The values and the tools that every kind of protocol definition speaks of. Pure."""

from collections.abc import Mapping
from typing import Any

from octoform.records import dataclass


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of a command or a field of its answer: integer, number, boolean, or (with ``choices``) a word.

    A parameter with a ``default`` may be omitted from a call. ``words`` are what a line reports for false and for true.
    """

    name: str
    type: str
    about: str = ""
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    default: float | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Tool:
    """The tool of a command of any kind of definition: its name, its effect and its parameters.

    ``do`` is the action of the device where no line of a protocol definition has it. ``stop`` ends a movement.
    """

    tool: str
    about: str
    effect: str
    parameters: tuple[Value, ...] = ()
    do: str = ""

    @property
    def stops(self) -> bool:
        return self.do == "stop"


def plain_value(value: Value) -> dict[str, Any]:
    """A value as JSON; members without a value are omitted."""
    bounds = {"minimum": value.minimum, "maximum": value.maximum, "enum": list(value.choices) or None}
    fields = {"about": value.about or None, "unit": value.unit or None, "words": list(value.words) or None}
    return present({"type": value.type, **fields, **bounds, "default": value.default})


def plain_values(values: tuple[Value, ...]) -> dict[str, Any]:
    """Values as JSON, by their names."""
    return {item.name: plain_value(item) for item in values}


def present(members: Mapping[str, Any]) -> dict[str, Any]:
    """The members that have a value."""
    return {name: value for name, value in members.items() if value is not None}
