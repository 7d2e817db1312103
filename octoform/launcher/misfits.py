"""What is wrong with the arguments of a call, in sentences that a model can correct itself by.

The validation says it for programmers, with types of its own and an address to read. What helps is the argument's name
as the schema has it, what is wrong, and what the schema allows. Texts that came are not repeated: they may be secret,
and the sentence goes to the audit log.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import ValidationError

MOST = 5
"""Sentences; what else is wrong shows in the next try."""
DEPTH = 3
_NAMED = {"integer": "a whole number", "number": "a number", "string": "a text", "boolean": "true or false"}
_MORE = {"array": "a list", "object": "an object", "null": "null"}
_UNKNOWN = frozenset({"unexpected_keyword_argument", "extra_forbidden"})
_BOUNDS = (
    ("minimum", "at least"),
    ("exclusiveMinimum", "above"),
    ("maximum", "at most"),
    ("exclusiveMaximum", "below"),
)
_COUNTS = (("minLength", "maxLength", "characters"), ("minItems", "maxItems", "items"))


class _Place(NamedTuple):
    """Where a fault is: its name, its part of the schema, and whether the schema led all the way there."""

    name: str
    part: Mapping[str, Any]
    whole: bool


def told(tool: str, problem: ValidationError, schema: Mapping[str, Any]) -> str:
    """Sentences about every argument that does not fit the tool's input schema (without references)."""
    sentences: dict[str, str] = {}
    for fault in problem.errors(include_url=False, include_context=False):
        place = _place(fault["loc"], schema)
        if place.name not in sentences:
            sentences[place.name] = _sentence(tool, place, fault)
    every = list(sentences.values())
    more = [f"{len(every) - MOST} more do not fit."] if len(every) > MOST else []
    return " ".join([*every[:MOST], *more])


def _sentence(tool: str, place: _Place, fault: Mapping[str, Any]) -> str:
    kind = str(fault["type"])
    if not place.name:
        return f"The arguments of {tool} do not fit: {_words(fault)}."
    if place.whole and kind in _UNKNOWN:
        return f"{tool} has no argument {json.dumps(place.name[:80])}; {_known(place.part)}."
    allowed = _allowed(place.part, DEPTH)
    takes = f"; it takes {allowed}" if allowed else ""
    if place.whole and kind.startswith("missing"):
        return f"The argument {place.name} of {tool} is missing{takes}."
    shown = f" is {json.dumps(fault['input'])}" if place.whole and _short(fault["input"]) else " does not fit"
    return f"The argument {place.name} of {tool}{shown}: {_words(fault)}{takes}."


def _short(value: Any) -> bool:
    """Whether a value can be repeated: no text, and not a number without end."""
    return value is None or isinstance(value, float) or (isinstance(value, int) and value.bit_length() <= 64)


def _words(fault: Mapping[str, Any]) -> str:
    """What the validation says, as the end of a sentence."""
    text = " ".join(str(fault["msg"]).split())
    text = text.removeprefix("Value error, ").removeprefix("Assertion failed, ").rstrip(".")
    if text.startswith("Input should"):
        text = f"it should{text.removeprefix('Input should')}"
    return text[:300]


def _place(loc: Sequence[int | str], schema: Mapping[str, Any]) -> _Place:
    """The argument's name, with what it is within it.

    For a name that the schema does not have, the part is the object that has no such name. The validation also names
    the ways it tried to read a value, which are in no schema: what is behind them is told as of the whole value.
    """
    name, part = "", schema
    for step in loc:
        inner = _only(part)
        known = inner.get("properties") or {}
        if isinstance(step, int) and isinstance(inner.get("items"), Mapping):
            name, part = f"{name}[{step}]", inner["items"]
        elif step in known:
            name, part = f"{name}.{step}" if name else str(step), known[step]
        elif known or not name:
            return _Place(f"{name}.{step}" if name else str(step), inner, True)
        else:
            return _Place(name, part, False)
    return _Place(name, part, True)


def _only(part: Mapping[str, Any]) -> Mapping[str, Any]:
    """The one way to read a value that may also be null, which the validation does not name."""
    ways = [way for way in part.get("anyOf") or () if way.get("type") != "null"]
    return ways[0] if len(ways) == 1 else part


def _known(part: Mapping[str, Any]) -> str:
    names = list(part.get("properties") or {})
    return f"it takes {', '.join(names)}" if names else "it takes none"


def _allowed(part: Mapping[str, Any], depth: int) -> str:
    """What a schema lets pass, in words; empty when it says nothing about it."""
    if "const" in part or "enum" in part:
        values = [part["const"]] if "const" in part else list(part["enum"])
        return _either([json.dumps(value) for value in values[:40]])
    ways = part.get("anyOf") or part.get("oneOf")
    if ways and depth:
        return _either([words for way in ways if (words := _allowed(way, depth - 1))])
    kinds = part.get("type")
    named = [kinds] if isinstance(kinds, str) else list(kinds or ())
    words = _either([_NAMED.get(kind) or _MORE.get(kind, kind) for kind in named]) or "a value"
    bounds = [f"{text} {part[key]}" for key, text in _BOUNDS if key in part] + _counts(part)
    if "pattern" in part:
        bounds.append(f"matching {part['pattern']}")
    if depth and named == ["array"] and part.get("items"):
        bounds.insert(0, f"of {_allowed(part['items'], depth - 1)}")
    if named == ["object"] and part.get("properties"):
        bounds.append(f"with {', '.join(part['properties'])}")
    return f"{words} {' and '.join(bounds)}" if bounds else "" if words == "a value" else words


def _counts(part: Mapping[str, Any]) -> list[str]:
    return [
        f"of {part.get(least, 0)} to {part.get(most, 'any number of')} {unit}"
        for least, most, unit in _COUNTS
        if least in part or most in part
    ]


def _either(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 2 else list(words))
