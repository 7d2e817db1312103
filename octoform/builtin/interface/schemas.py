"""Writes JSON Schemas in few words, in exactly the form that the generated server's own types give.

A record's ``title`` is the name of the class that the server makes of it; two records of one title must be equal.
Units stand in the names of members (``size_bytes``) or beside the value (``unit``).
"""

from typing import Any

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
    """A value that the device may not tell."""
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
