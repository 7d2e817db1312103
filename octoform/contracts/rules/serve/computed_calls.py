"""The calls of a served tool, computed on attributes that are made up: what comes back, and what was written."""

import ast
import contextlib
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from octoform.base.quantities import unit_of_text
from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.rules.serve.write_rules import only_reads
from octoform.contracts.server_code.computed_values import Failed, Key, Unsure, World
from octoform.contracts.server_code.server_evaluator import Evaluator, ways
from octoform.contracts.server_code.server_source import Function, Source

_BUDGET, _MAX_WAYS, _MAX_CALLS, _MAX_PARTS = 400_000, 24, 12, 2000


class Calls:
    """The calls of a server's tools on attributes that are made up."""

    def __init__(self, source: Source, artifacts: Artifacts) -> None:
        self.source, self._left = source, [_BUDGET]
        self.served: dict[str, tuple[JsonObject, Function]] = {}
        for site, tool in served_tools(source, artifacts):
            functions = tool_functions(source, site)
            if len(functions) == 1:
                self.served[tool["name"]] = tool, functions[0]
        acting = {each for tool, root in self.served.values() if tool["effect"] != "read" for each in self._used(root)}
        self._of_readings = frozenset(call for call, _ in source.calls if source.owner(call) not in acting)
        """The calls that no tool which sets something makes: what they give is unknown, and no more than that."""

    def _used(self, root: Function) -> list[Function]:
        return self.source.entered_from([root])

    def world(self, most: float, usual: float, stored: Mapping[tuple[str, ...], str]) -> World:
        """Attributes of which each maximum is ``most`` and each other number ``usual``."""

        def number(name: str) -> float:
            if "max" in name or "period" in name or "range" in name:
                return most
            return 0 if "min" in name or "offset" in name else 1 if "scale" in name or "step" in name else usual

        return World(number, self._left, dict(stored))

    def outcomes(
        self, tool: str, given: Mapping[str, Any], world: World, *, programs: bool = False
    ) -> Iterator[tuple[World, Any]]:
        """The attributes after each way through one call, with its result; none of a way that ends with an error.

        What a program did is known to those only who look at its words (``programs``).
        """
        _, function = self.served[tool]

        def along(choices: list[bool]) -> Evaluator:
            now = World(world.usual, world.left, dict(world.stored))
            return Evaluator(self.source, now, choices, self._harmless)

        for call in ways(along, _MAX_WAYS, whole=True):
            with contextlib.suppress(Failed):
                result = call.call(function, given)
                if call.world.ran and not programs:
                    raise Unsure
                yield call.world, result

    def number(self, node: ast.expr | ast.stmt, name: str, number: float) -> float | None:
        """What an expression is, or what a name is after a statement, where this name has this number before.

        None where it is no number, or not certainly the same one.
        """
        evaluator = Evaluator(self.source, self.world(1000.0, 500.0, {}), [], self._harmless)
        try:
            known = {name: number}
            found = evaluator.run([node], known)[name] if isinstance(node, ast.stmt) else evaluator.value(node, known)
        except (Unsure, Failed, RecursionError):
            return None
        return found if type(found) in (int, float) and not evaluator.taken else None

    def _harmless(self, call: ast.Call, name: str, changed: bool) -> bool:
        """Whether a call changes no attribute, and none of the lists and tables that it may be given (``changed``)."""
        if call in self._of_readings and not changed:
            return True
        return name == "time.sleep" or name.startswith("logging.") or only_reads(self.source, call, name)


def arguments(tool: JsonObject, device: str, spared: str | None = None) -> Iterator[dict[str, Any]]:
    """What a caller may give to all parameters but one: each choice, each end of a range."""
    ways: dict[str, list[Any]] = {}
    smoke = tool.get("smoke", {}).get("arguments", {})
    for name, member in (tool["input_schema"].get("properties") or {}).items():
        if name == "device":
            ways[name] = [device]
        elif name in smoke:
            ways[name] = [smoke[name]]
        elif name != spared:
            ways[name] = _values(member, optional=name not in tool["input_schema"].get("required", ()))
    calls = list(itertools.islice(itertools.product(*ways.values()), _MAX_CALLS + 1))
    if not 0 < len(calls) <= _MAX_CALLS:
        raise Unsure
    for values in calls:
        yield {name: value for name, value in zip(ways, values, strict=True) if value is not _ABSENT}


_ABSENT = object()


def _values(member: Any, *, optional: bool) -> list[Any]:
    if not isinstance(member, dict):
        raise Unsure
    found = [_ABSENT] if optional else []
    if "const" in member:
        return [*found, member["const"]]
    if "enum" in member:
        return [*found, *member["enum"]]
    if member.get("type") == "boolean":
        return [False, True]
    low, high = member.get("minimum"), member.get("maximum")
    if member.get("type") in ("number", "integer") and None not in (low, high):
        return [*found, low, high]
    if not found:
        raise Unsure
    return found


def records(value: Any) -> Iterator[dict[Any, Any]]:
    """The records in a result, at any depth; Unsure for one that is too large."""
    waiting, seen = [value], 0
    while waiting:
        item, seen = waiting.pop(), seen + 1
        if seen > _MAX_PARTS or len(waiting) > _MAX_PARTS:
            raise Unsure
        if isinstance(item, dict):
            yield item
        waiting += item.values() if isinstance(item, dict) else item if isinstance(item, list | tuple) else ()


def numbers_of(value: Any, name: str) -> list[float]:
    """The numbers of a member, at any depth of a result."""
    found = (record.get(name) for record in records(value))
    return [float(each) for each in found if isinstance(each, int | float) and not isinstance(each, bool)]


def results_of(
    calls: Calls, tool: JsonObject, given: Mapping[str, Any], stored: Iterable[Mapping[tuple[str, ...], str]]
) -> list[Any]:
    """The result of a call on each of these attributes; empty where one of them leaves no way or several."""
    found = []
    for attributes in stored:
        ways = [*itertools.islice(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, attributes)), 2)]
        if len(ways) != 1:
            return []
        found.append(ways[0][1])
    return found


def with_unit(value: Any, name: str, unit: str | None) -> list[tuple[float, str | None]]:
    """The numbers of a member with the unit of each, which a member `unit` beside it may give."""
    return [
        (number, unit or unit_of_text(record.get("unit")))
        for record in records(value)
        for number in numbers_of({name: record.get(name)}, name)
    ]


_MAXIMUM = re.compile(r"\bmax_brightness\b\W{1,3}(\d{1,9})\b")


def is_level(key: Key) -> bool:
    """Whether an attribute is the level of a light, which goes up to the `max_brightness` beside it."""
    return key[1:2] in (("backlight",), ("leds",)) and key[-1] == "brightness"


def maxima_of_lights(artifacts: Artifacts, device: str) -> list[float]:
    """Every `max_brightness` that PROBE shows of a device."""
    devices = (artifacts.probe or {"devices": []})["devices"]
    texts = [each.get("raw_descriptor", "") for each in devices if each["id"] == device]
    return sorted({float(found[1]) for text in texts for found in _MAXIMUM.finditer(text)} - {0.0})
