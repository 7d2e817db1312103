"""Whether a JSON value has the form that its reader stands on, checked before any of it is used.

A reader that finds a word where a list should be would otherwise end with a traceback, far from the file that is
damaged. For records of octoform's own; what agents write is held against its schema. JSON pointers (RFC 6901) name the
place of a value in a document, as one text. Standard library only.
"""

from collections.abc import Mapping
from typing import Any

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
