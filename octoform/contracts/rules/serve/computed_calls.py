"""The calls of a served tool, computed on attributes that are made up: what comes back, and what was written."""

import ast
import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from octoform.base.quantities import unit_of_text
from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.rules.serve.write_rules import only_reads
from octoform.contracts.server_code.computed_values import Failed, Key, Spent, Unsure, World
from octoform.contracts.server_code.server_evaluator import Evaluator, ways
from octoform.contracts.server_code.server_source import Function, Source
from octoform.patterns import regex

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
        # The calls that no tool which sets something makes: what they give is unknown, and no more than that.
        of_readings = frozenset(call for call, _ in source.calls if source.owner(call) not in acting)
        self._memo = _memo(source, of_readings)

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
        for call in ways(lambda choices: self._memo.outcome(function, given, choices, world), _MAX_WAYS, whole=True):
            if call.unsure or (call.world.ran and not programs and not call.failed):
                raise Unsure
            if not call.failed:
                yield call.after(world), call.result

    def number(self, node: ast.expr | ast.stmt, name: str, number: float) -> float | None:
        """What an expression is, or what a name is after a statement, where this name has this number before.

        None where it is no number, or not certainly the same one.
        """
        evaluator = Evaluator(self.source, self.world(1000.0, 500.0, {}), [], self._memo.harmless)
        try:
            known = {name: number}
            found = evaluator.run([node], known)[name] if isinstance(node, ast.stmt) else evaluator.value(node, known)
        except (Unsure, Failed, RecursionError):
            return None
        return found if type(found) in (int, float) and not evaluator.taken else None


class _Outcome:
    """What comes of one call along one way."""

    def __init__(self, call: Evaluator, function: Function, given: Mapping[str, Any]) -> None:
        self.world, left = call.world, call.world.left[0]
        self.result, self.failed, self.unsure = None, False, False
        try:
            self.result = call.call(function, given)
        except Failed:
            self.failed = True
        except Unsure:
            self.unsure = True
        self.taken, self.steps = call.taken, left - self.world.left[0]

    def after(self, world: World) -> World:
        """The attributes after the same call in a world that has the same texts where this one read."""
        then = self.world
        stored = {**world.stored, **{key: then.stored[key] for key in then.written}}
        return World(world.usual, world.left, stored, then.read, then.written, then.ran)


@dataclass(frozen=True)
class _Next:
    """The attribute that a call reads next, and what comes of the call for each text of it."""

    key: Key
    by_text: dict[Any, "_Outcome | _Next"]


class _Memo:
    """The calls of a file that were computed, for all rules: the same call on the same texts does the same."""

    def __init__(self, source: Source, of_readings: frozenset[ast.Call]) -> None:
        self._source, self._of_readings = source, of_readings
        self._first: dict[Any, _Outcome | _Next] = {}

    def outcome(self, function: Function, given: Mapping[str, Any], choices: list[bool], world: World) -> _Outcome:
        """What comes of a call that begins in a world, along the way that begins with these choices."""
        call = function, repr(given), tuple(choices)
        found = self._first.get(call)
        while isinstance(found, _Next):
            found = found.by_text.get(world.peek(found.key))
        if found is None:
            now = World(world.usual, world.left, dict(world.stored))
            found = _Outcome(Evaluator(self._source, now, choices, self.harmless), function, given)
            self._keep(call, found)
        else:  # as if it were computed again: no verdict depends on which rules ran before
            world.left[0] -= found.steps
            if world.left[0] < 0:
                raise Spent
        return found

    def _keep(self, call: Any, outcome: _Outcome) -> None:
        at, last = self._first, call
        for key, text in outcome.world.met.items():
            step = at.setdefault(last, _Next(key, {}))
            at, last = step.by_text if isinstance(step, _Next) else {}, text
        at[last] = outcome

    def harmless(self, call: ast.Call, name: str, changed: bool) -> bool:
        """Whether a call changes no attribute, and none of the lists and tables that it may be given (``changed``)."""
        if call in self._of_readings and not changed:
            return True
        return name == "time.sleep" or name.startswith("logging.") or only_reads(self._source, call, name)


_memo = lru_cache(maxsize=4)(_Memo)


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


_MAXIMUM = regex(r"\bmax_brightness\b\W{1,3}(\d{1,9})\b")


def is_level(key: Key) -> bool:
    """Whether an attribute is the level of a light, which goes up to the `max_brightness` beside it."""
    return key[1:2] in (("backlight",), ("leds",)) and key[-1] == "brightness"


def maxima_of_lights(artifacts: Artifacts, device: str) -> list[float]:
    """Every `max_brightness` that PROBE shows of a device."""
    devices = (artifacts.probe or {"devices": []})["devices"]
    texts = [each.get("raw_descriptor", "") for each in devices if each["id"] == device]
    return sorted({float(found[1]) for text in texts for found in _MAXIMUM.finditer(text)} - {0.0})
