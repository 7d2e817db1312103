"""Rules for SERVE about what comes of a call: what was set is what is read afterwards, and a reading keeps its steps.

A setter that halves its argument, caps it or puts the former value back answers as if it had done what it was asked.
Its outcome is computed on made-up attributes (`server_evaluator`), and one example is the finding.
"""

import ast
import itertools
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display
from octoform.base.quantities import unit_in, unit_of_name, unit_of_text
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.movement_words import is_time
from octoform.contracts.rules.serve.computed_calls import Calls, arguments, is_level, maxima_of_lights, numbers_of
from octoform.contracts.rules.serve.tool_rules import HELPERS, WISHED, passed_on, readings_of
from octoform.contracts.rules.serve.value_rules import numbers_read
from octoform.contracts.server_code.computed_values import Spent, Unsure, World
from octoform.contracts.server_code.server_source import Function, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

OTHERWISE, CUT = "SERVE-SETS-OTHERWISE", "SERVE-ARGUMENT-CUT"
_SHARES = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
"""Where in its range an argument is tried; what happens at the very ends is the device's own."""
_TOLERANCE, _FINE = 0.02, 50
"""How far off a reading may be, as a part of the range, and from how many steps on a range is as fine as that."""


def _stored(statement: ast.Assign) -> set[str]:
    return {item.id for target in statement.targets for item in walk(target) if isinstance(item, ast.Name)}


_MAX_DEVICES = 8
_Example = tuple[ast.Call, float, float]


def _tried(member: Mapping[str, Any]) -> list[float]:
    """The arguments that are tried: numbers of its range, away from its ends."""
    low, high = member.get("minimum"), member.get("maximum")
    if member.get("type") not in ("number", "integer") or not isinstance(low, int | float) or "enum" in member:
        return []
    if not isinstance(high, int | float) or not 0 < high - low < 1e9:
        return []
    step = member.get("multipleOf") or (1 if member["type"] == "integer" else 0)
    numbers = [low + share * (high - low) for share in _SHARES]
    return [round(item / step) * step if step else item for item in numbers]


class _Setting:
    """One argument of a tool that sets, and one reading of the same quantity on the same device."""

    def __init__(self, calls: Calls, tool: JsonObject, reading: JsonObject, name: str, device: str) -> None:
        self._calls, self._tool, self._reading, self._name = calls, tool, reading, name
        self._device = device
        self._member = tool["input_schema"]["properties"][name]
        self._range = abs(self._member["maximum"] - self._member["minimum"])
        self._shown: list[float] = []
        """The maxima of the device's lights where PROBE shows them: no other number explains what is written then."""

    def show(self, maxima: list[float]) -> tuple[Any, ...]:
        """Use these maxima as those of the device; the result differs where another device is written otherwise."""
        if not maxima:
            return ()
        tried = _tried(self._member)[-2]
        given = next(arguments(self._tool, self._device, self._name)) | {self._name: tried}
        world = self._calls.world(maxima[-1], maxima[-1] / 2, {})
        after = [after for after, _ in self._calls.outcomes(self._tool["name"], given, world)]
        if any(is_level(key) for each in after for key in each.written):
            self._shown = maxima
        return (*maxima, *(each.stored[key] for each in after for key in each.written))

    def wrong(self) -> _Example | None:
        """(write, argument, what is read then) of an example; None where some numbers of the device make it right."""
        example: _Example | None = None
        for most, usual in self._kinds():
            world = self._calls.world(most, usual, {})
            found = [self._misread(number, world) for number in _tried(self._member)]
            wrong = next((each for each in found if isinstance(each, tuple)), None)
            if wrong is None and any(found):
                return None
            example = example or wrong
        return example

    def _kinds(self) -> Iterator[tuple[float, float]]:
        """(maximum, usual number) of the devices that are made up; of the real one where PROBE shows it."""
        if self._shown:
            yield from ((each, each / 2) for each in self._shown)
            return
        yield from ((1000.0, 500.0), (255.0, 100.0))
        asks = self._asks()
        yield from ((each, each) for each in self._constants() if each >= _FINE or not asks)

    def _asks(self) -> bool:
        """Whether what is written follows the range that the device reports."""
        written: list[list[str]] = [[], []]
        for most, found in zip((1000.0, 777.0), written, strict=True):
            for number in _tried(self._member):
                given = next(arguments(self._tool, self._device, self._name)) | {self._name: number}
                world = self._calls.world(most, 500.0, {})
                for after, _ in self._calls.outcomes(self._tool["name"], given, world):
                    found += [after.stored[key] for key in after.written]
        return written[0] != written[1]

    def _constants(self) -> list[float]:
        """The numbers that a device may have for its range where a tool does not ask for it: those of the code."""
        source, roots = (
            self._calls.source,
            [self._calls.served[each["name"]][1] for each in (self._tool, self._reading)],
        )
        parts: list[ast.AST] = [item for each in source.entered_from(roots) for item in walk(each)]
        names = {item.id for item in parts if isinstance(item, ast.Name)}
        for statement in source.tree.body:
            parts += walk(statement.value) if isinstance(statement, ast.Assign) and names & _stored(statement) else ()
        constants = [item.value for item in parts if isinstance(item, ast.Constant)]
        given = {float(each) for each in constants if isinstance(each, int | float)}
        found = given | {self._range / each for each in given if each} | {self._range}
        return sorted(each for each in found if each.is_integer() and 0 < each <= 10_000_000)

    def _misread(self, number: float, world: World) -> _Example | bool:
        """An example, where each way of the call and each reading afterwards misses; True where one does not."""
        example: _Example | None = None
        given = int(number) if self._member["type"] == "integer" else number
        for others in arguments(self._tool, self._device, self._name):
            for after, _ in self._calls.outcomes(self._tool["name"], {**others, self._name: given}, world):
                found = self._read(after, given) if after.written else None
                if found is None:
                    continue
                node, shown, step = found
                # A level of a light whose steps are known may be rounded down.
                if abs(shown - given) <= max(_TOLERANCE * self._range, (1.01 if self._shown else 0.51) * step):
                    return True
                example = example or (node, float(given), shown)
        return example or False

    def _read(self, after: World, given: float) -> _Example | None:
        """(write, what is read, how far one step of the attribute moves it), the nearest of all ways; None if none."""
        best = None
        for call in arguments(self._reading, self._device):
            for key, node in after.written.items():
                plain = self._read_then(after, call, {})
                moved = [self._read_then(after, call, {key: more}) for more in _moved(after.stored[key])]
                if not plain or all(each == plain for each in moved):
                    continue
                shown = min(plain, key=lambda each: abs(each - given))
                step = max((abs(one - two) for one, two in zip(moved[0], plain, strict=False)), default=0.0)
                if best is None or abs(shown - given) < abs(best[1] - given):
                    best = node, shown, step
        return best

    def _read_then(self, after: World, call: Mapping[str, Any], changed: Mapping[tuple[str, ...], str]) -> list[float]:
        world = World(after.usual, after.left, {**after.stored, **changed})
        results = [value for _, value in self._calls.outcomes(self._reading["name"], call, world)]
        return [number for value in results for number in numbers_of(value, self._name)]


def _moved(text: str) -> list[str]:
    """An attribute that is a step larger, and much larger; Unsure for one that is no number."""
    try:
        number = float(text)
    except ValueError:
        return [text]
    return [f"{number + 1:g}", f"{2 * number + 10:g}"]


def _is_same(tool: JsonObject, reading: JsonObject, name: str, member: Any) -> bool:
    """Whether a reading has the quantity that an argument sets, by its name and its unit."""
    found = dict(numbers_read(reading.get("output_schema") or {}))
    own = unit_of_name(name) or unit_in(member.get("description") if isinstance(member, dict) else None)
    known = {limit.get("unit") for limit in tool.get("limits", ()) if limit["parameter"] == name}
    units = {unit for unit in (own, found.get(name), *map(unit_of_text, known)) if unit is not None}
    return name in found and len(units) <= 1


def _misset(calls: Calls, tool: JsonObject, reading: JsonObject, name: str, artifacts: Artifacts) -> _Example | None:
    """An example of one argument, of the first device and of each on which something else is written."""
    seen: set[tuple[Any, ...]] = set()
    for device in [item for item in tool["devices"] if item in reading["devices"]][:_MAX_DEVICES]:
        setting = _Setting(calls, tool, reading, name, device)
        kind = setting.show(maxima_of_lights(artifacts, device))
        if kind in seen:
            continue
        seen.add(kind)
        found = setting.wrong()
        if found is not None:
            return found
    return None


def set_not_read(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """What a tool sets is what is read afterwards: whole, not capped before INTERFACE's maximum, not put back."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "write the whole of what was asked for and leave it; a smaller range or coarser steps belong in INTERFACE, "
    hint += "as minimum, maximum and multipleOf"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, _ in calls.served.values():
        others = readings_of(tool, artifacts) if tool["effect"] != "read" and "units" not in tool else []
        for reading in (each for each in others if each["name"] in calls.served):
            for name, member in (tool["input_schema"].get("properties") or {}).items():
                if not _is_same(tool, reading, name, member) or not _tried(member):
                    continue
                try:
                    found = _misset(calls, tool, reading, name, artifacts)
                except Unsure:
                    continue
                except Spent:
                    return list(out.values())
                if found is not None:
                    node, given, shown = found
                    summary = (
                        f"the tool {display(tool['name'])}, given {given:g} for {display(name)}, leaves {shown:g} "
                    )
                    summary += f"to be read by {display(reading['name'])}"
                    out.setdefault(node, source.problem(OTHERWISE, node, summary, hint))
    return list(out.values()) or program_given_less(value, artifacts)


def program_given_less(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A program that sets something is given what the caller passes: that percentage, over the whole range."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "give the program the whole of what was asked for; a smaller range belongs in INTERFACE, as maximum"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, _ in calls.served.values():
        settable = (tool["input_schema"].get("properties") or {}) if tool["effect"] != "read" else {}
        for name, member in settable.items():
            try:
                found = _given_to_programs(calls, tool, name) if isinstance(member, dict) and _tried(member) else []
            except Unsure:
                continue
            except Spent:
                return list(out.values())
            for node, percent, series in found:
                numbers = [number for _, number in series]
                same = percent and _unit_of(tool, name, member) == "%"
                far = [each for each in series if same and abs(each[0] - each[1]) > _TOLERANCE * 100]
                if len(set(numbers)) > _FEW and (len(set(numbers[-_FEW:])) == 1 or len(set(numbers[:_FEW])) == 1):
                    far = far or [series[-1 if len(set(numbers[-_FEW:])) == 1 else 0]]
                if far:
                    summary = f"the tool {display(tool['name'])}, given {far[0][0]:g} for {display(name)}, gives its "
                    summary += f"program {far[0][1]:g}"
                    out.setdefault(node, source.problem(OTHERWISE, node, summary, hint))
    return list(out.values())


_FEW = 3
"""From how many equal numbers on, at either end of the range, an argument counts as capped."""
_Given = tuple[ast.Call, bool, list[tuple[float, float]]]
_PERCENTAGE, _PLAIN_NUMBER = regex(r"(\d+(?:\.\d+)?)%"), regex(r"(?:[\w.]+=)?(\d+(?:\.\d+)?)%?")


def _unit_of(tool: JsonObject, name: str, member: Any) -> str | None:
    known = [limit.get("unit") for limit in tool.get("limits", ()) if limit["parameter"] == name]
    own = unit_of_name(name) or unit_in(member.get("description") if isinstance(member, dict) else None)
    return own or next(filter(None, map(unit_of_text, known)), None)


def _given_to_programs(calls: Calls, tool: JsonObject, name: str) -> list[_Given]:
    """For each number among the words of a program: whether it is a percentage, and what it is for each argument.

    Only a word that each call passes at the same place, and that differs from argument to argument, is such a number.
    """
    member = tool["input_schema"]["properties"][name]
    tried = [int(each) if member["type"] == "integer" else each for each in _tried(member)]
    rows: dict[ast.Call, list[list[str]]] = {}
    for number in tried:
        given = next(arguments(tool, tool["devices"][0], name)) | {name: number}
        ways = [
            *itertools.islice(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {}), programs=True), 2)
        ]
        for node, words in ways[0][0].ran if len(ways) == 1 else ():
            rows.setdefault(node, []).append(words)
    out = []
    for node, lines in rows.items():
        for column in zip(*lines, strict=False) if len(lines) == len(tried) else ():
            pattern = _PERCENTAGE if all(each.endswith("%") for each in column) else _PLAIN_NUMBER
            found = [match for each in column if (match := pattern.fullmatch(each))]
            if len(found) == len(tried) and len(set(column)) > 1:
                series = [(float(one), float(each[1])) for one, each in zip(tried, found, strict=True)]
                out.append((node, pattern is _PERCENTAGE, series))
    return out


_PARTS = (0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1)
"""Where in its range an argument is tried that a tool may cut off."""


def argument_cut(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading uses the whole range of its argument, and so does a wait: none is cut off at a number of the server."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "use what the caller passes as it is; a smaller range belongs in INTERFACE, as minimum and maximum"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, function in calls.served.values():
        for name, member in (tool["input_schema"].get("properties") or {}).items():
            tried = _over_range(member) if tool["effect"] == "read" or is_time(name) else []
            try:
                found = _cut(calls, function, name, tried, HELPERS) if tried else None
            except Spent:
                return list(out.values())
            if found is None or (WISHED.search(member.get("description", "")) and not _cuts_default(member, found[1])):
                continue
            node, (given, used) = found
            summary = f"the tool {display(tool['name'])}, given {given:g} for {display(name)}, uses {used:g}"
            out.setdefault(node, source.problem(CUT, node, summary, hint))
    return list(out.values())


RULES = (Rule(CUT, argument_cut),)


def _over_range(member: Any) -> list[float]:
    low, high = (member.get(each) if isinstance(member, dict) else None for each in ("minimum", "maximum"))
    if not isinstance(low, int | float) or not isinstance(high, int | float) or "enum" in member or high <= low:
        return []
    numbers = [low + part * (high - low) for part in _PARTS]
    return sorted({round(each) for each in numbers}) if member.get("type") == "integer" else numbers


def _cuts_default(member: Mapping[str, Any], example: tuple[float, float]) -> bool:
    """Whether the default of a wish is beyond the number at which a tool cuts it off."""
    given, used = example
    usual = member.get("default")
    return isinstance(usual, int | float) and (usual > used if given > used else usual < used)


def _cut(
    calls: Calls, function: Function, name: str, tried: list[float], depth: int
) -> tuple[ast.AST, tuple[float, float]] | None:
    """(where, (argument, what is left of it)) where each use of a parameter is of what is left of it."""
    source = calls.source
    uses = [item for part in function.body for item in walk(part) if isinstance(item, ast.Name) and item.id == name]
    bound = [item for item in uses if isinstance(item.ctx, ast.Store)]
    if any(isinstance(each, ast.For | ast.While) for item in bound for each, _ in source.above(item)):
        return None  # it is counted down, and all of it is used
    if bound:
        first = next(part for part in function.body if uses[0] in walk(part))
        example = _example([(each, calls.number(first, name, each)) for each in tried])
        return (first, example) if example is not None else None
    found: tuple[ast.AST, tuple[float, float]] | None = None
    for item in uses:
        above = [each for each, _ in source.above(item)]
        if any(isinstance(each, ast.Raise | ast.JoinedStr) for each in above):
            continue  # an error that names it
        mine = _cut_where_used(calls, item, above, tried) or _cut_by_helper(calls, item, tried, depth)
        if mine is None:
            return None
        found = found or mine
    return found


def _cut_where_used(
    calls: Calls, use: ast.Name, above: list[ast.AST], tried: list[float]
) -> tuple[ast.AST, tuple[float, float]] | None:
    for node in (each for each in above if not isinstance(each, ast.keyword)):
        if any(isinstance(each, ast.Call) and calls.source.dotted(each.func) == "len" for each in walk(node)):
            return None  # as many as there are
        numbers = [calls.number(node, use.id, each) for each in tried] if isinstance(node, ast.expr) else [None]
        if None in numbers:
            return None
        example = _example([*zip(tried, numbers, strict=True)])
        if example is not None:
            return node, example
    return None


def _cut_by_helper(
    calls: Calls, use: ast.Name, tried: list[float], depth: int
) -> tuple[ast.AST, tuple[float, float]] | None:
    passed = passed_on(calls.source, use) if depth else None
    return (
        _cut(calls, passed[0], passed[1][0], tried, depth - 1) if passed is not None and len(passed[1]) == 1 else None
    )


def _example(pairs: list[tuple[float, float | None]]) -> tuple[float, float] | None:
    """(argument, what is left of it) where an argument is used as it is up to a number, and beyond as that one.

    A bound that is within the tolerance of an end of the range does not count.
    """
    known = [(given, used) for given, used in pairs if used is not None]
    beyond = [(given, used) for given, used in known if used != given]
    above = {used for given, used in beyond if used < given}
    below = {used for given, used in beyond if used > given}
    if len(known) < len(pairs) or not beyond or len(beyond) == len(known) or len(above) > 1 or len(below) > 1:
        return None
    sides = all((used in above and given > used) or (used in below and given < used) for given, used in beyond)
    farthest = max(beyond, key=lambda each: abs(each[0] - each[1]))
    span = max(given for given, _ in pairs) - min(given for given, _ in pairs)
    return farthest if sides and abs(farthest[0] - farthest[1]) > _TOLERANCE * span else None
