"""Read the ``grammar`` field of a profile, of either kind: every problem with its place, or the definition.

Pure.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from typing import Any

from octoform.frontmatter import Place
from octoform.profiles import lines, register_parser
from octoform.profiles.definition_forms import Found, Problem, Tool, Value, near
from octoform.profiles.model import Grammar, plain

PLACE: Place = ("grammar",)
MAX_BYTES = 24 * 1024
"""An agent is notified every parameter of every command, and its prompt is bounded."""


def read(given: object) -> tuple[Grammar | None, list[Problem]]:
    """The protocol definition that a front-matter value states, and every problem of it as (place, summary, hint)."""
    found = Found()
    if not isinstance(given, Mapping):
        found.add(
            PLACE,
            "the protocol definition is no mapping",
            "write grammar: {line: ..., commands: ...}, or registers: for line:",
        )
        return None, found.problems
    if "registers" in given and "line" in given:
        found.add(PLACE, "a protocol definition has one kind, and this has two", "keep `line` or `registers`")
        return None, found.problems
    read_kind = register_parser.read if "registers" in given else lines.read
    grammar: Grammar = read_kind(found, given, PLACE)
    if not found.problems and len(json.dumps(plain(grammar))) > MAX_BYTES:
        hint = "a tool that moves all units has a parameter for each: keep one of them, and what an agent needs"
        found.add(PLACE, f"the commands and their parameters, written out, are more than {MAX_BYTES} bytes", hint)
    return (None if found.problems else grammar), found.problems


# The bounds of a protocol definition as limits of its profile, so that they hold outside the generated code as well.
# Pure.
#
# What an author wrote under ``limits`` is enforced by the endpoint whatever the server does. The same must hold for
# each number of each command, and no one should have to write it a second time.

Limit = Mapping[str, Any]


def derived(tools: Iterable[Tool], given: Iterable[Limit]) -> tuple[Limit, ...]:
    """The bounds of the parameters that no limit of ``given`` keeps as tightly already.

    Tools with the same bounds of one parameter share a limit that names none of them.
    """
    uses: dict[str, list[tuple[Tool, Value]]] = {}
    for tool in tools:
        for value in tool.parameters:
            uses.setdefault(value.name, []).append((tool, value))
    listed = tuple(given)
    return tuple(limit for pairs in uses.values() for limit in _of_one(pairs, listed))


def _of_one(uses: list[tuple[Tool, Value]], given: tuple[Limit, ...]) -> Iterator[Limit]:
    """The limits of one parameter, for all tools that have it."""
    found = [_limit(tool, value, given) for tool, value in uses]
    if found[0] and all(limit == found[0] for limit in found):
        yield found[0]
        return
    for (tool, _), limit in zip(uses, found, strict=True):
        if limit:
            yield {"tool": tool.tool, **limit}


def _limit(tool: Tool, value: Value, given: tuple[Limit, ...]) -> dict[str, Any]:
    """The bounds that are not limited yet, in the author's unit, so that no two limits disagree."""
    own = [
        item for item in given if item.get("parameter") == value.name and fnmatchcase(tool.tool, item.get("tool", "*"))
    ]
    ends: dict[str, float] = {}
    if value.minimum is not None and not any(item.get("minimum", float("-inf")) >= value.minimum for item in own):
        ends["minimum"] = value.minimum
    if value.maximum is not None and not any(item.get("maximum", float("inf")) <= value.maximum for item in own):
        ends["maximum"] = value.maximum
    unit = next((item["unit"] for item in own if "unit" in item), value.unit)
    return {"parameter": value.name, **ends, **({"unit": unit} if unit else {})} if ends else {}


def idle(limit: Limit, tools: Iterable[Tool]) -> tuple[str, str, str] | None:
    """The member of a limit that names nothing of the definition, what is wrong with it, and what to do; else None."""
    listed = {tool.tool: tool for tool in tools}
    glob, name, zero = limit.get("tool", "*"), limit.get("parameter"), limit.get("zero")
    meant = [tool for tool in listed.values() if isinstance(glob, str) and fnmatchcase(tool.tool, glob)]
    if isinstance(glob, str) and not meant:
        return "tool", f"the protocol definition has no tool {glob!r}", near(glob, listed, "its tools are ")
    parameters = {value.name: None for tool in meant for value in tool.parameters}
    if isinstance(name, str) and name not in parameters:
        return "parameter", f"the tools of this limit take no parameter {name!r}", near(name, parameters, "they take ")
    if isinstance(zero, str) and zero not in listed:
        return "zero", f"the protocol definition has no tool {zero!r}", near(zero, listed, "its tools are ")
    return None
