"""The words in which a caller hears what became of a call that did not simply return."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fastmcp.tools.base import ToolResult
from pydantic import ValidationError

from octoform.server.execution.work import Stopped
from octoform.server.latch import Estop

from .calls import Call, CallRefused

REFUSED = "octoform/refused"
DRY = "octoform/dry_run"
UNAUDITED = "octoform/audit"
ARGUMENTS_CHARS = 2000


def refusal(refused: CallRefused) -> ToolResult:
    """An error with the sentence, and the code for programs."""
    return ToolResult(content=str(refused), meta={REFUSED: refused.code}, is_error=True)


def error(text: str) -> ToolResult:
    return ToolResult(content=text, is_error=True)


def estop(stop: Estop) -> CallRefused:
    """The refusal of a tool that moves something while the emergency stop is engaged."""
    return CallRefused(
        "estop",
        f"emergency stop: engaged by {stop.by} at {stop.since or 'an unknown time'} "
        f"({stop.reason or 'no reason given'}). "
        "Nothing that moves is called until a person runs octoform estop -clear",
    )


def overtaken() -> CallRefused:
    """An emergency stop came, and was cleared perhaps, while the call waited."""
    return CallRefused(
        "estop",
        "emergency stop: it came after this call did, so the call is not made, no matter who approved it before. "
        "Call the tool again if it still has to be done",
    )


def absent(names: list[str]) -> CallRefused:
    return CallRefused(
        "absent", f"device absent: {', '.join(names)}. Nothing was done; the tool works again once it is there"
    )


def stopped(call: Call, problem: Stopped) -> str:
    """The client's error for a call that was stopped while it ran."""
    policy = call.entry.policy
    if call.work is not None and not call.work.begun:
        why = "the endpoint ends" if problem.cause == "shutdown" else "an emergency stop came"
        return f"{call.entry.name} was not begun, because {why}"
    if problem.cause == "estop":
        text = f"emergency stop: {call.entry.name} was interrupted while it ran"
    elif problem.cause == "shutdown":
        text = f"{call.entry.name} was interrupted because the endpoint ends"
    elif problem.cause == "blocked":
        text = f"{call.entry.name} blocked every other call and was interrupted"
    else:
        text = f"{call.entry.name} did not return within its {policy.timeout:g} s and was stopped"
    if problem.ended:
        return f"{text}. What its device did until then is not undone"
    held = f" of {', '.join(policy.buses)}" if policy.buses else ""
    return f"{text}, but its code has not ended yet; other calls{held} wait until it has"


def dry_run(call: Call) -> ToolResult:
    """The result of a dry run. As data where the tool's output schema has room for that, else as an error without data:
    a client refuses a result without the data that the schema promises."""
    policy = call.entry.policy
    shown = json.dumps(dict(call.arguments), ensure_ascii=True, default=repr)
    if len(shown) > ARGUMENTS_CHARS:
        shown = f"{shown[:ARGUMENTS_CHARS]}... ({len(shown)} characters)"
    first = " after a person confirmed it" if call.confirms else ""
    where = f" on {', '.join(policy.buses)}" if policy.buses else ""
    text = f"dry run: nothing was done. {call.entry.name} would be called{where} with {shown}{first} ({policy.source})"
    data: dict[str, Any] = {"dry_run": True, "tool": call.entry.name, "arguments": shown}
    meta = {DRY: True}
    if call.entry.fits is None:
        return ToolResult(content=text, meta=meta)
    if call.entry.fits(data) is None:
        return ToolResult(content=text, structured_content=data, meta=meta)
    return ToolResult(content=text, meta=meta, is_error=True)


# What is wrong with the arguments of a call, in sentences that a model can correct itself by.
#
# The validation words it for programmers, with types of its own and an address to read. What helps is the argument's
# name as the schema has it, what is wrong, and what the schema allows. Texts that came are not repeated: they may be
# secret, and the sentence goes to the audit log.

MAX_FAULTS = 5
"""Sentences; what else is wrong shows in the next try."""
DEPTH = 3
_NAMED = {"integer": "an integer", "number": "a number", "string": "a string", "boolean": "true or false"}
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


def describe(tool: str, problem: ValidationError, schema: Mapping[str, Any]) -> str:
    """Sentences about every argument that does not fit the tool's input schema (without references)."""
    sentences: dict[str, str] = {}
    for fault in problem.errors(include_url=False, include_context=False):
        place = _place(fault["loc"], schema)
        if place.name not in sentences:
            sentences[place.name] = _sentence(tool, place, fault)
    every = list(sentences.values())
    more = [f"{len(every) - MAX_FAULTS} more do not fit."] if len(every) > MAX_FAULTS else []
    return " ".join([*every[:MAX_FAULTS], *more])


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
    """A fault of the validation, as the end of a sentence."""
    text = " ".join(str(fault["msg"]).split())
    text = text.removeprefix("Value error, ").removeprefix("Assertion failed, ").rstrip(".")
    if text.startswith("Input should"):
        text = f"it should{text.removeprefix('Input should')}"
    return text[:300]


def _place(loc: Sequence[int | str], schema: Mapping[str, Any]) -> _Place:
    """The argument's name, with what it is within it.

    For a name that the schema does not have, the part is the object that has no such name. The validation also names
    the ways it tried to read a value, which are in no schema: what is behind them is reported as of the whole value.
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
    """The values that a schema allows, in words; empty when it does not restrict them."""
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
