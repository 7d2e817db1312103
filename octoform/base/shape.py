"""Whether a JSON value has the form that its reader stands on, checked before any of it is used.

A reader that finds a word where a list should be would otherwise end with a traceback, far from the file that is
damaged. For records of octoform's own; what agents write is held against its schema. JSON pointers (RFC 6901) name the
place of a value in a document, as one text. Standard library only.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any, cast

_DAY = 24 * 60
_TEXT = (str, None)
INSTANCES = {
    "format": int,
    "devices": {
        str: {
            "serial": _TEXT,
            "port": _TEXT,
            "sysfs": _TEXT,
            "strength": _TEXT,
            "nodes": ([{"class": _TEXT, "path": _TEXT}], None),
        }
    },
}
"""The ledger of instances, which octoform writes and the runtime beside a generated server reads."""


def fits(value: Any, shape: Any) -> bool:
    """True when ``value`` has the form ``shape``.

    A shape is a type (``int`` and ``float`` take no truth value, ``float`` takes integers), None, a tuple of
    shapes of which one fits, ``[shape]`` for a list, ``{str: shape}`` for an object of any names, ``{"name": shape}``
    for an object with at least these fields, where one that is missing counts as None.
    """
    if isinstance(shape, tuple):
        return any(fits(value, each) for each in shape)
    if isinstance(shape, list):
        return isinstance(value, list) and all(fits(each, shape[0]) for each in value)
    if isinstance(shape, dict):
        return isinstance(value, dict) and _object_fits(value, shape)
    if shape is None:
        return value is None
    if isinstance(value, bool) and shape in (int, float):
        return False
    return isinstance(value, (int, float) if shape is float else shape)


def _object_fits(value: dict[str, Any], shape: dict[Any, Any]) -> bool:
    if str in shape:
        return all(fits(each, shape[str]) for each in value.values())
    return all(fits(value.get(name), each) for name, each in shape.items())


def step(part: object) -> str:
    """One reference token: ``~`` and ``/`` inside it are escaped (section 3)."""
    return str(part).replace("~", "~0").replace("/", "~1")


def pointer(*parts: str | int) -> str:
    """The pointer of the parts; ``""`` for none, which is the whole document."""
    return "".join(f"/{step(part)}" for part in parts)


def resolve(document: object, place: str) -> object:
    """The value that a pointer points to, or the local reference of a schema (``#/$defs/x``); None without one."""
    for part in place.removeprefix("#").split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        if isinstance(document, Mapping):
            document = document.get(key)
        elif isinstance(document, list) and key.isdigit() and int(key) < len(document):
            document = document[int(key)]
        else:
            return None
    return document


class Fields:
    """The fields of a JSON object that is read whole or not at all: ValueError names the place of what is wrong."""

    def __init__(self, value: Any, place: str) -> None:
        if not isinstance(value, dict):
            raise ValueError(f"{place} is no object")
        self.items: Mapping[str, Any] = value
        self.place = place

    def at(self, name: str) -> str:
        """The place of a field."""
        return f"{self.place}.{name}" if self.place else name

    def has(self, name: str) -> bool:
        """Whether a field has a value."""
        return self.items.get(name) is not None

    def fields(self, name: str, default: Any = None) -> "Fields":
        """A field that is itself an object."""
        return Fields(self.items.get(name, default), self.at(name))

    def all(self, name: str) -> Iterator[tuple[Any, str]]:
        """The members of a field that is an array, each with its place; none without the field."""
        for index, value in enumerate(array(self.items.get(name, []), self.at(name))):
            yield value, f"{self.at(name)}[{index}]"

    def strings(self, name: str) -> tuple[str, ...]:
        """A field that is an array of strings."""
        return tuple(string(value, self.at(name)) for value in array(self.items.get(name, []), self.at(name)))

    def string(self, name: str) -> str:
        """A string, empty where it is absent."""
        return string(self.items.get(name) or "", self.at(name))

    def text(self, name: str) -> str:
        """A string that is there and not empty."""
        text = string(self.items.get(name), self.at(name))
        if not text:
            raise ValueError(f"{self.at(name)} is empty")
        return text

    def flag(self, name: str) -> bool:
        """True or false, false where it is absent."""
        value = self.items.get(name, False)
        if not isinstance(value, bool):
            raise ValueError(f"{self.at(name)} is {value!r}, which is neither true nor false")
        return value

    def one_of(self, name: str, allowed: tuple[str, ...]) -> str:
        """One of these words."""
        value = self.items.get(name)
        if value not in allowed:
            raise ValueError(f"{self.at(name)} is {value!r}, which is none of {', '.join(allowed)}")
        return cast(str, value)

    def number(self, name: str) -> float | None:
        """A finite number or null; integers stay whole, so that a message shows them as they were written."""
        value = self.items.get(name)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value or abs(value) == math.inf:
            raise ValueError(f"{self.at(name)} is {value!r}, which is no finite number")
        return value

    def not_negative(self, name: str) -> float:
        """A number of 0 or more."""
        value = self.number(name)
        if value is None or value < 0:
            raise ValueError(f"{self.at(name)} is {value!r}, which is no number of 0 or more")
        return value

    def positive(self, name: str) -> float:
        """A number above 0."""
        value = self.not_negative(name)
        if value == 0:
            raise ValueError(f"{self.at(name)} is 0; it has to be more")
        return value

    def whole(self, name: str) -> int:
        """An integer above 0."""
        value = self.positive(name)
        if not isinstance(value, int):
            raise ValueError(f"{self.at(name)} is {value!r}, which is no integer")
        return value

    def time_of_day(self, name: str) -> int:
        """Minutes after midnight of ``HH:MM``; 24:00 is midnight."""
        hours, colon, minutes = self.text(name).partition(":")
        known = colon and all(part.isascii() and part.isdigit() for part in (hours, minutes)) and int(minutes) < 60
        if not known or int(hours) * 60 + int(minutes) > _DAY:
            raise ValueError(f"{self.at(name)} is no time of day such as 22:00")
        return (int(hours) * 60 + int(minutes)) % _DAY


def array(value: Any, place: str) -> list[Any]:
    """The value, which is an array."""
    if not isinstance(value, list):
        raise ValueError(f"{place} is no array")
    return value


def string(value: Any, place: str) -> str:
    """The value, which is a string."""
    if not isinstance(value, str):
        raise ValueError(f"{place} is no text")
    return value
