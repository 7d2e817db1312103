"""Rules for SERVE about what becomes of a reading: its scale, its sign, its sense and its steps.

The calls are computed on attributes that are made up, and what comes back is held against what the kernel documents of
each attribute (Documentation/hwmon, ABI/testing). Only a result that follows an attribute in a straight line is judged.
"""

import ast
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from octoform.base.escaping import display, listed
from octoform.base.quantities import unit_of_text
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.computed_calls import (
    Calls,
    arguments,
    is_level,
    maxima_of_lights,
    records,
    results_of,
    with_unit,
)
from octoform.contracts.rules.serve.value_rules import constant_reading, default_reading, numbers_read
from octoform.contracts.server_code.chosen_values import declared_numbers
from octoform.contracts.server_code.computed_values import Key, Spent, Unsure
from octoform.contracts.server_code.server_source import Source, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

COARSE, OTHERWISE = "SERVE-READING-COARSE", "SERVE-READING-OTHERWISE"
_TOLERANCE = 0.02
_SWEEPS = ((20_000, 137), (20_000, 600), (200, 1), (3000, 7))
"""First raw number and step of each series that a reading is computed for."""
_IN_A_SERIES = 61
_NEIGHBOURS = (0, 1, 30, 31, 59, 60)
_SPEAKS_OF_STEPS = ("whole", "step", "round", "nearest", "multiple", "resolution", "coarse", "tens of", "bars", "level")
_WHOLE, _OF_KERNEL = 0.999, frozenset({"degC", "degF", "K", "V", "A", "W"})
"""From which step on a reading is whole in one of these units, of which the kernel counts thousandths and less."""


def coarse_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A quantity keeps the steps in which it was read: it is not rounded to tens."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "return the number as it was read; coarse steps belong in output_schema, as multipleOf"
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


def _step_of(calls: Calls, tool: JsonObject) -> tuple[str, float, str] | None:
    """(member, step, unit) of a quantity that is rounded to more than a unit of it, and more than a fiftieth."""
    units = dict(numbers_read(tool.get("output_schema") or {}))
    given = next(arguments(tool, tool["devices"][0]))
    first = next(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {})), None)
    schema = tool.get("output_schema") or {}
    for key in list(first[0].read) if first is not None else ():
        for begin, step in _sweeps(key):
            series = [f"{begin + step * at}" for at in range(_IN_A_SERIES)]
            # Where neighbours differ at both ends and in the middle, the steps are finer than the series.
            few = results_of(calls, tool, given, ({key: series[at]} for at in _NEIGHBOURS))
            if not any(one == two for one, two in zip(few[::2], few[1::2], strict=True)):
                continue
            results = results_of(calls, tool, given, ({key: raw} for raw in series))
            for name, unit in units.items() if results else ():
                found = [with_unit(each, name, unit) for each in results]
                numbers = sorted({number for each in found for number, _ in each})
                known = {each for row in found for _, each in row}
                gaps = [two - one for one, two in itertools.pairwise(numbers)]
                wide = bool(gaps) and min(gaps) > max(1.5, _TOLERANCE * max(map(abs, numbers)))
                whole = bool(gaps) and min(gaps) > _WHOLE and _is_finer(key) and known <= _OF_KERNEL
                wide = wide or (whole and not _is_integer(schema, name))
                if wide and len(numbers) * 4 <= _IN_A_SERIES and len(known) == 1 and not known & {None, "%"}:
                    return name, min(gaps), str(known.pop())
    return None


class _Meaning(NamedTuple):
    """What the kernel counts in an attribute: the unit, and how much of it one count is."""

    unit: str
    one: float


_KERNEL: tuple[tuple[str, str, _Meaning], ...] = (
    ("hwmon", r"temp\d+_(?:input|average)", _Meaning("degC", 0.001)),
    ("hwmon", r"in\d+_(?:input|average)", _Meaning("V", 0.001)),
    ("hwmon", r"curr\d+_(?:input|average)", _Meaning("A", 0.001)),
    ("hwmon", r"power\d+_(?:input|average)", _Meaning("W", 1e-6)),
    ("hwmon", r"humidity\d+_input", _Meaning("%", 0.001)),
    ("hwmon", r"fan\d+_input", _Meaning("rpm", 1.0)),
    ("thermal", r"temp", _Meaning("degC", 0.001)),
    ("power_supply", r"voltage_now|voltage_avg", _Meaning("V", 1e-6)),
    ("power_supply", r"current_now|current_avg", _Meaning("A", 1e-6)),
    ("power_supply", r"power_now|power_avg", _Meaning("W", 1e-6)),
    ("power_supply", r"temp", _Meaning("degC", 0.1)),
    ("power_supply", r"capacity", _Meaning("%", 1.0)),
    ("iio", r"in_temp\d*_(?:input|raw)", _Meaning("degC", 0.001)),
    ("iio", r"in_voltage\d*_(?:input|raw)", _Meaning("V", 0.001)),
    ("iio", r"in_current\d*_(?:input|raw)", _Meaning("A", 0.001)),
    ("iio", r"in_humidityrelative\d*_(?:input|raw)", _Meaning("%", 0.001)),
    ("iio", r"in_pressure\d*_(?:input|raw)", _Meaning("kPa", 1.0)),
)
_INTO = {("degC", "degF"): (1.8, 32.0), ("degC", "K"): (1.0, 273.15), ("kPa", "hPa"): (10.0, 0.0)}
_APART = {"rpm": ("degC", "V", "A", "W", "kPa"), "degC": ("V", "A", "W", "rpm", "kPa")}
"""Units in which nothing is that the kernel counts in another one; of a voltage anything may be made."""
_SECTOR = 512
_ADDS_UP, _HAS_A_SIGN, _FAR = frozenset({"W", "A"}), frozenset({"degC", "A"}), 100.0
_AMOUNTS = (15.0, 30.0, 60.0)
_BELOW, _ABOVE = (-39.0, -24.0, -12.0, -3.0), (0.5, 1, 2, 5, 10, 15, 30, 45, 60, 75, 90, 105, 120)
_REVOLUTIONS, _IN_ITS_RANGE = 100, 5
"""How many revolutions are tried for one of another unit, and how many numbers are left of what is cut off."""
_OF_FAHRENHEIT = 5 / 9
_SENSES = {"removable": ("removable",), "rotational": ("rotational",), "ro": ("read_only", "readonly", "ro")}
_MOST = regex(r"(?:.*_)?max(?:imum)?(?:_.*)?")
_MAX_DEVICES = 3
_CHANNEL = regex(r"\b(?:temp|in|fan|curr|power|humidity)\d+(?=\b|_)")


def read_otherwise(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading is what the kernel counts, in the unit that it names: its scale, sign and sense are kept."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "return what the attribute means by the kernel's documentation, in the unit of the result"
    out: dict[ast.AST, Diagnostic] = dict(_misnamed(source, hint))
    written = {str(node.value) for node in source.by_kind[ast.Constant]}
    for tool, function in calls.served.values():
        lights = {each: maxima_of_lights(artifacts, each) for each in tool["devices"]}
        shifts = any(isinstance(item, ast.RShift) for each in source.entered_from([function]) for item in walk(each))
        for device in tool["devices"][:_MAX_DEVICES] if tool["effect"] == "read" and not shifts else ():
            try:
                summary = next(_otherwise(calls, tool, device, _channels(artifacts, device), written), None)
                summary = summary or next(_undimmed(calls, tool, device, lights[device]), None)
            except Unsure:
                continue
            except Spent:
                return list(out.values())
            if summary is not None:
                summary = f"{display(tool['name'])} returns {summary}"
                out.setdefault(function, source.problem(OTHERWISE, function, summary, hint))
    cause = out and (constant_reading(value, artifacts) or default_reading(value, artifacts))
    return [] if cause else list(out.values())


def _sweeps(key: Key) -> Iterable[tuple[int, int]]:
    """First raw number and step of each series for an attribute: those for all, and 20 of its unit and on."""
    meaning = _meaning(key)
    own = [(round(20 / meaning.one), round(0.137 / meaning.one))] if meaning is not None and _is_finer(key) else []
    return dict.fromkeys((*own, *_SWEEPS))


def _is_finer(key: Key) -> bool:
    """Whether the kernel counts a tenth of the unit, or less, in an attribute."""
    meaning = _meaning(key)
    return meaning is not None and meaning.one < 0.2


def _is_integer(schema: Any, name: str) -> bool:
    """Whether INTERFACE declares a member as an integer, wherever it is in a result."""
    if isinstance(schema, list):
        return any(_is_integer(item, name) for item in schema)
    if not isinstance(schema, dict):
        return False
    members = schema.get("properties")
    member = members.get(name) if isinstance(members, dict) else None
    forms = [member, *member.get("anyOf", ())] if isinstance(member, dict) else []
    kinds = {
        str(kind)
        for form in forms
        if "type" in form
        for kind in (form["type"] if isinstance(form["type"], list) else [form["type"]])
    }
    return ("integer" in kinds and "number" not in kinds) or any(_is_integer(item, name) for item in schema.values())


def _misnamed(source: Source, hint: str) -> Iterator[tuple[ast.AST, Diagnostic]]:
    """Calls of the runtime's reader of hwmon with a scale or a unit that the kernel's channels do not have."""
    for call, name in source.calls:
        if name != "runtime.channels.hwmon" or len(call.args) != 4 or call.keywords:
            continue
        kind, scale, symbol = (item.value if isinstance(item, ast.Constant) else None for item in call.args[1:])
        meaning, unit = _meaning(("", "hwmon", f"{kind!s}1_input")), unit_of_text(symbol)
        if meaning is None or unit is None or not isinstance(scale, int | float):
            continue
        if unit != meaning.unit or abs(scale / meaning.one - 1) > _TOLERANCE:
            summary = (
                f"it reads {display(kind)} as {scale:g} {unit}, and the kernel counts {meaning.one:g} {meaning.unit}"
            )
            yield call, source.problem(OTHERWISE, call, summary, hint)


def _channels(artifacts: Artifacts, device: str) -> set[str]:
    """The channels of hwmon that PROBE shows of a device."""
    devices = (artifacts.probe or {"devices": []})["devices"]
    texts = [each.get("raw_descriptor", "") for each in devices if each["id"] == device]
    return {found[0] for text in texts for found in _CHANNEL.finditer(text)}


def _otherwise(calls: Calls, tool: JsonObject, device: str, shown: set[str], written: set[str]) -> Iterator[str]:
    given = next(arguments(tool, device))
    first = next(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {})), None)
    keys = list(first[0].read) if first is not None else []
    units = dict(numbers_read(tool.get("output_schema") or {}))
    read = {found[0]: key[-1] for key in keys if key[1:2] == ("hwmon",) and (found := _CHANNEL.match(key[-1]))}
    for channel in sorted(read.keys() - shown) if not read.keys() & shown and set(read.values()) <= written else ():
        others = sorted(each for each in shown if each.rstrip("0123456789") == channel.rstrip("0123456789"))
        if others:
            yield f"{display(read[channel])}, which the device does not have; it has {listed(others)}"
    for meaning in dict.fromkeys(filter(None, map(_meaning, keys))):
        same = [key for key in keys if _meaning(key) == meaning]
        amounts = (*_AMOUNTS, -_AMOUNTS[0]) if meaning.unit in _HAS_A_SIGN else _AMOUNTS
        results = [_result(calls, tool, given, same, round(each / meaning.one)) for each in amounts]
        if _is_derived(calls, tool, given, dict.fromkeys(same, str(round(_AMOUNTS[0] / meaning.one))), keys):
            continue
        for name, unit in units.items() if None not in results[: len(_AMOUNTS)] else ():
            yield from _misread(name, unit, meaning, len(same), results)
        yield from _cut_off(calls, tool, given, same, meaning)
    for key in keys:
        yield from _turned(calls, tool, given, key)
        yield from _sized(calls, tool, given, key)
        yield from _exchanged(calls, tool, given, key, keys)


def _is_derived(
    calls: Calls, tool: JsonObject, given: Mapping[str, Any], fixed: Mapping[Key, str], keys: Sequence[Key]
) -> bool:
    """Whether a result follows other attributes too: a share of a maximum is in no unit of the kernel's."""
    others = [key for key in keys if key not in fixed]
    found = [results_of(calls, tool, given, [{**dict.fromkeys(others, number), **fixed}]) for number in ("40", "90")]
    return bool(others) and found[0] != found[1]


def _meaning(key: Key) -> _Meaning | None:
    known = (meaning for kind, name, meaning in _KERNEL if key[1:2] == (kind,) and re.fullmatch(name, key[-1]))
    return next(known, None)


def _result(calls: Calls, tool: JsonObject, given: Mapping[str, Any], keys: Sequence[Key], number: int) -> Any:
    """The result of a call where these attributes have this number; None where it has none or several."""
    found = results_of(calls, tool, given, [dict.fromkeys(keys, str(number))])
    return found[0] if found else None


def _misread(name: str, unit: str | None, meaning: _Meaning, several: int, results: Sequence[Any]) -> Iterator[str]:
    """What is wrong with the numbers of one member, for attributes that are at `_AMOUNTS`, and at less than nothing."""
    rows = [with_unit(each, name, unit) for each in results if each is not None]
    for column in zip(*rows, strict=False) if len({len(row) for row in rows}) == 1 else ():
        shown = column[0][1]
        gain, zero = _INTO.get((meaning.unit, shown or ""), (1.0, 0.0) if shown == meaning.unit else (0.0, 0.0))
        one, two, three, *below = (number for number, _ in column)
        rate = (three - one) / (_AMOUNTS[2] - _AMOUNTS[0])
        straight = abs((two - one) / (_AMOUNTS[1] - _AMOUNTS[0]) - rate) <= 0.1 * abs(rate)
        if shown in _APART.get(meaning.unit, ()) and rate and straight:
            yield f"in {shown} what the kernel counts in {meaning.unit}"
        if not gain or not rate or not straight:
            continue
        right = [gain * (several if meaning.unit in _ADDS_UP else 1), gain, gain * _OF_FAHRENHEIT]
        what = f"a {display(name)} of {one:g} {shown} where the kernel counts {round(_AMOUNTS[0] / meaning.one)}"
        far = meaning.unit == "degC" and abs(one - gain * _AMOUNTS[0] - zero) > _FAR
        if far or all(abs(rate / each - 1) > 0.2 for each in right):
            yield f"{what}, which is {gain * _AMOUNTS[0] + zero:g} {shown}"
        elif below and below[0] - zero > 0.5 * gain * _AMOUNTS[0]:
            what = f"a {display(name)} of {below[0]:g} {shown} where the kernel counts"
            yield f"{what} {round(-_AMOUNTS[0] / meaning.one)}, which is {zero - gain * _AMOUNTS[0]:g} {shown}"


def _cut_off(
    calls: Calls, tool: JsonObject, given: Mapping[str, Any], keys: Sequence[Key], meaning: _Meaning
) -> Iterator[str]:
    """A bound of the server at which a reading ends, though INTERFACE declares none and the attribute goes on."""
    if meaning.unit == "%":
        return
    counts = (_REVOLUTIONS if meaning.unit == "rpm" else 1) / meaning.one
    amounts = [*(_BELOW if meaning.unit in _HAS_A_SIGN else ()), *_ABOVE]
    results = [_result(calls, tool, given, keys, round(each * counts)) for each in amounts]
    schema = tool.get("output_schema") or {}
    for name, unit in numbers_read(schema) if None not in results else ():
        rows = [with_unit(each, name, unit) for each in results]
        allowed = declared_numbers(schema, name) or frozenset()
        for column in zip(*rows, strict=False) if len({len(row) for row in rows}) == 1 else ():
            shown, numbers = column[0][1], [number for number, _ in column]
            kept = shown == meaning.unit or (meaning.unit, shown) in _INTO
            ends = [end[0] for end in (numbers[-2:], numbers[:2]) if len(set(end)) == 1]
            for end in ends if kept and len(set(numbers)) >= _IN_ITS_RANGE else ():
                if end not in allowed | {0.0}:
                    yield f"a {display(name)} that is cut off at {end:g} {shown}, which INTERFACE does not declare"


def _turned(calls: Calls, tool: JsonObject, given: Mapping[str, Any], key: Key) -> Iterator[str]:
    """A truth value that is false where its attribute is 1."""
    off, on = (_result(calls, tool, given, [key], number) if key[-1] in _SENSES else None for number in (0, 1))
    for before, after in zip(records(off), records(on), strict=False):
        for name in _SENSES.get(key[-1], ()):
            if before.get(name) is True and after.get(name) is False:
                yield f"{display(name)} as false where the kernel's {display(key[-1])} is 1"


def _sized(calls: Calls, tool: JsonObject, given: Mapping[str, Any], key: Key) -> Iterator[str]:
    """A size in bytes that does not follow the sectors of a disk, of which each has 512 bytes whatever it is."""
    if key[1:2] != ("block",) or key[-1] != "size":
        return
    less, most = 20_000, 60_000
    few, more = (_result(calls, tool, given, [key], number) for number in (less, most))
    for one, two in zip(records(few), records(more), strict=False):
        for name in (each for each in one if isinstance(each, str) and each.endswith("bytes")):
            if isinstance(one[name], int | float) and isinstance(two.get(name), int | float):
                rate = (two[name] - one[name]) / (most - less)
                if rate and abs(rate / _SECTOR - 1) > _TOLERANCE:
                    yield f"as {display(name)} {rate:g} for each sector, which has {_SECTOR} bytes"


def _undimmed(calls: Calls, tool: JsonObject, device: str, maxima: Sequence[float]) -> Iterator[str]:
    """A percentage of a light that is 100 neither at the maximum that PROBE shows nor, where it is turned, at 0."""
    units = [name for name, unit in numbers_read(tool.get("output_schema") or {}) if unit == "%"]
    if not maxima or not units:
        return
    given = next(arguments(tool, device))
    first = next(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {})), None)
    keys = [key for key in first[0].read if key[1:2] in (("backlight",), ("leds",))] if first is not None else []
    levels = [key for key in keys if is_level(key)]
    for name in units if levels else ():
        tops = []
        for most in maxima:
            whole = {key: f"{most:g}" for key in keys if "brightness" in key[-1]}
            both = results_of(calls, tool, given, [whole | dict.fromkeys(levels, "0"), whole])
            numbers = [[number for number, _ in with_unit(each, name, "%")] for each in both]
            pairs = [*zip(*numbers, strict=False)] if len(numbers) == 2 else []
            tops += [(most, max(pair)) for pair in pairs if pair[0] != pair[1]]
        if tops and all(abs(top - 100) > _TOLERANCE * 100 for _, top in tops):
            most, top = tops[0]
            yield f"a {display(name)} of {top:g} where the light is at its maximum, which PROBE shows as {most:g}"


def _exchanged(
    calls: Calls, tool: JsonObject, given: Mapping[str, Any], key: Key, keys: Sequence[Key]
) -> Iterator[str]:
    """A maximum that follows a reading, and not the attribute with the maximum."""
    mosts = [each for each in keys if each[:-1] == key[:-1] and _MOST.fullmatch(each[-1])]
    if _MOST.fullmatch(key[-1]) or not mosts:
        return
    plain, more = (_result(calls, tool, given, [key], number) for number in (100, 300))
    wider = results_of(calls, tool, given, [{key: "100", **dict.fromkeys(mosts, "4000")}])
    for one, two, three in zip(records(plain), records(more), records(wider[0] if wider else None), strict=False):
        for name in (each for each in one if isinstance(each, str) and _MOST.fullmatch(each)):
            if isinstance(one[name], int | float) and one[name] != two.get(name) and one[name] == three.get(name):
                yield f"as {display(name)} what it reads in {display(key[-1])}"


RULES = (Rule(COARSE, coarse_reading), Rule(OTHERWISE, read_otherwise))
