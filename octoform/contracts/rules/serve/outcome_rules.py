"""Rules for SERVE about what comes of a call: what was set is what is read afterwards, and a reading keeps its steps.

A setter that halves its argument, caps it or puts the former value back answers as if it had done what it was asked.
Its outcome is computed on made-up attributes (`server_evaluator`), and one example is the finding.
"""

import ast
import contextlib
import itertools
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from octoform.base.escaping import display
from octoform.base.quantities import unit_in, unit_of_name, unit_of_text
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.tool_rules import readings_of, served_tools, tool_functions
from octoform.contracts.rules.serve.value_rules import constant_reading, numbers_read
from octoform.contracts.rules.serve.write_rules import only_reads
from octoform.contracts.server_code.computed_values import Failed, Spent, Unsure, World
from octoform.contracts.server_code.server_evaluator import Evaluator
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic

OTHERWISE, COARSE = "SERVE-SETS-OTHERWISE", "SERVE-READING-COARSE"
_BUDGET, _MAX_WAYS, _MAX_CALLS, _MAX_PARTS = 400_000, 24, 12, 2000
_SHARES = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
"""Where in its range an argument is tried; what happens at the very ends is the device's own."""
_TOLERANCE, _FINE = 0.02, 50
"""How far off a reading may be, as a part of the range, and from how many steps on a range is as fine as that."""
_SWEEPS = ((20_000, 137), (20_000, 600), (200, 1), (3000, 7))
"""First raw number and step of each series that a reading is computed for."""
_IN_A_SERIES = 61
_SPEAKS_OF_STEPS = ("step", "round", "nearest", "multiple", "resolution", "coarse", "tens of", "bars", "level")


class _Calls:
    """The calls of a server's tools on attributes that are made up."""

    def __init__(self, source: Source, artifacts: Artifacts) -> None:
        self.source, self._left = source, [_BUDGET]
        self.served: dict[str, tuple[JsonObject, Function]] = {}
        for site, tool in served_tools(source, artifacts):
            functions = tool_functions(source, site)
            if len(functions) == 1:
                self.served[tool["name"]] = tool, functions[0]

    def world(self, most: float, usual: float, stored: Mapping[tuple[str, ...], str]) -> World:
        """Attributes of which each maximum is ``most`` and each other number ``usual``."""

        def number(name: str) -> float:
            if "max" in name or "period" in name or "range" in name:
                return most
            return 0 if "min" in name or "offset" in name else 1 if "scale" in name or "step" in name else usual

        return World(number, self._left, dict(stored))

    def outcomes(self, tool: str, given: Mapping[str, Any], world: World) -> Iterator[tuple[World, Any]]:
        """The attributes after each way through one call, with its result; none of a way that ends with an error."""
        _, function = self.served[tool]
        waiting: list[list[bool]] = [[]]
        for _ in range(_MAX_WAYS):
            if not waiting:
                return
            choices = waiting.pop()
            now = World(world.usual, world.left, dict(world.stored))
            evaluator = Evaluator(self.source, now, choices, self._harmless)
            with contextlib.suppress(Failed):
                yield now, evaluator.call(function, given)
            taken = evaluator.taken
            waiting += [[*taken[:at], False] for at in range(len(choices), len(taken))]
        raise Unsure

    def _harmless(self, call: ast.Call, name: str) -> bool:
        return name == "time.sleep" or name.startswith("logging.") or only_reads(self.source, call, name)


def _arguments(tool: JsonObject, device: str, spared: str | None = None) -> Iterator[dict[str, Any]]:
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


def _stored(statement: ast.Assign) -> set[str]:
    return {item.id for target in statement.targets for item in walk(target) if isinstance(item, ast.Name)}


_ABSENT = object()
_Example = tuple[ast.Call, float, float]


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


def _records(value: Any) -> Iterator[dict[Any, Any]]:
    """The records in a result, at any depth; Unsure for one that is too large."""
    waiting, seen = [value], 0
    while waiting:
        item, seen = waiting.pop(), seen + 1
        if seen > _MAX_PARTS or len(waiting) > _MAX_PARTS:
            raise Unsure
        if isinstance(item, dict):
            yield item
        waiting += item.values() if isinstance(item, dict) else item if isinstance(item, list | tuple) else ()


def _numbers(value: Any, name: str) -> list[float]:
    """The numbers of a member, at any depth of a result."""
    found = (record.get(name) for record in _records(value))
    return [float(each) for each in found if isinstance(each, int | float) and not isinstance(each, bool)]


class _Setting:
    """One argument of a tool that sets, and one reading of the same quantity on the same device."""

    def __init__(self, calls: _Calls, tool: JsonObject, reading: JsonObject, name: str) -> None:
        self._calls, self._tool, self._reading, self._name = calls, tool, reading, name
        self._device = next(item for item in tool["devices"] if item in reading["devices"])
        self._member = tool["input_schema"]["properties"][name]
        self._range = abs(self._member["maximum"] - self._member["minimum"])

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
        """(maximum, usual number) of the devices that are made up."""
        yield from ((1000.0, 500.0), (255.0, 100.0))
        asks = self._asks()
        yield from ((each, each) for each in self._constants() if each >= _FINE or not asks)

    def _asks(self) -> bool:
        """Whether what is written follows the range that the device reports."""
        written: list[list[str]] = [[], []]
        for most, found in zip((1000.0, 777.0), written, strict=True):
            for number in _tried(self._member):
                given = next(_arguments(self._tool, self._device, self._name)) | {self._name: number}
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
        for others in _arguments(self._tool, self._device, self._name):
            for after, _ in self._calls.outcomes(self._tool["name"], {**others, self._name: given}, world):
                found = self._read(after, given) if after.written else None
                if found is None:
                    continue
                node, shown, step = found
                if abs(shown - given) <= max(_TOLERANCE * self._range, 0.51 * step):
                    return True
                example = example or (node, float(given), shown)
        return example or False

    def _read(self, after: World, given: float) -> _Example | None:
        """(write, what is read, how far one step of the attribute moves it), the nearest of all ways; None if none."""
        best = None
        for arguments in _arguments(self._reading, self._device):
            for key, node in after.written.items():
                plain = self._shown(after, arguments, {})
                moved = [self._shown(after, arguments, {key: more}) for more in _moved(after.stored[key])]
                if not plain or all(each == plain for each in moved):
                    continue
                shown = min(plain, key=lambda each: abs(each - given))
                step = max((abs(one - two) for one, two in zip(moved[0], plain, strict=False)), default=0.0)
                if best is None or abs(shown - given) < abs(best[1] - given):
                    best = node, shown, step
        return best

    def _shown(self, after: World, arguments: Mapping[str, Any], changed: Mapping[tuple[str, ...], str]) -> list[float]:
        world = World(after.usual, after.left, {**after.stored, **changed})
        results = [value for _, value in self._calls.outcomes(self._reading["name"], arguments, world)]
        return [number for value in results for number in _numbers(value, self._name)]


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


def set_not_read(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """What a tool sets is what is read afterwards: whole, not capped before INTERFACE's maximum, not put back."""
    source = needed_source(value)
    calls = _Calls(source, artifacts)
    hint = (
        "write the whole of what was asked for and leave it; a smaller range or coarser steps belong into INTERFACE, "
    )
    hint += "as minimum, maximum and multipleOf"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, _ in calls.served.values():
        others = readings_of(tool, artifacts) if tool["effect"] != "read" and "units" not in tool else []
        for reading in (each for each in others if each["name"] in calls.served):
            for name, member in (tool["input_schema"].get("properties") or {}).items():
                if not _is_same(tool, reading, name, member) or not _tried(member):
                    continue
                try:
                    found = _Setting(calls, tool, reading, name).wrong()
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
    return list(out.values())


def coarse_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A quantity keeps the steps in which it was read: it is not rounded to tens."""
    source = needed_source(value)
    calls = _Calls(source, artifacts)
    hint = "return the number as it was read; coarse steps belong into output_schema, as multipleOf"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, function in calls.served.values():
        declared = str(tool.get("output_schema")).casefold()
        said = f"{tool['description']} {declared}".casefold()
        parts = (item for each in source.entered_from([function]) for item in walk(each))
        shifts = any(isinstance(item, ast.RShift | ast.BitAnd) for item in parts)  # a field of a register
        told = "multipleof" in declared or any(word in said for word in _SPEAKS_OF_STEPS)
        if tool["effect"] != "read" or shifts or told:
            continue
        try:
            found = _step_of(calls, tool)
        except (Unsure, Spent):
            continue
        if found is not None:
            name, step, unit = found
            summary = f"the {display(name)} that {display(tool['name'])} returns comes in steps of {step:g} {unit} only"
            out[function] = source.problem(COARSE, function, summary, hint)
    # A number that a test of the reading only chooses has few values as well, and that is the cause.
    return list(out.values()) if out and not constant_reading(value, artifacts) else []


def _step_of(calls: _Calls, tool: JsonObject) -> tuple[str, float, str] | None:
    """(member, step, unit) of a quantity that is rounded to more than a unit of it, and more than a fiftieth."""
    units = dict(numbers_read(tool.get("output_schema") or {}))
    given = next(_arguments(tool, tool["devices"][0]))
    first = next(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {})), None)
    for key in list(first[0].read) if first is not None else ():
        for begin, step in _SWEEPS:
            series = [f"{begin + step * at}" for at in range(_IN_A_SERIES)]
            results = _results(calls, tool, given, ({key: raw} for raw in series))
            for name, unit in units.items() if results else ():
                found = [_with_unit(each, name, unit) for each in results]
                numbers = sorted({number for each in found for number, _ in each})
                known = {each for row in found for _, each in row}
                gaps = [two - one for one, two in itertools.pairwise(numbers)]
                wide = bool(gaps) and min(gaps) > max(1.5, _TOLERANCE * max(map(abs, numbers)))
                if wide and len(numbers) * 4 <= _IN_A_SERIES and len(known) == 1 and not known & {None, "%"}:
                    return name, min(gaps), str(known.pop())
    return None


def _results(
    calls: _Calls, tool: JsonObject, given: Mapping[str, Any], stored: Iterable[Mapping[tuple[str, ...], str]]
) -> list[Any]:
    """The result of a call on each of these attributes; empty where one of them leaves no way or several."""
    found = []
    for attributes in stored:
        ways = [*itertools.islice(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, attributes)), 2)]
        if len(ways) != 1:
            return []
        found.append(ways[0][1])
    return found


def _with_unit(value: Any, name: str, unit: str | None) -> list[tuple[float, str | None]]:
    """The numbers of a member with the unit of each, which a member `unit` beside it may give."""
    return [
        (number, unit or unit_of_text(record.get("unit")))
        for record in _records(value)
        for number in _numbers({name: record.get(name)}, name)
    ]


RULES = (Rule(COARSE, coarse_reading),)
