"""Whether the results of a trial call can be true: physical bounds, the device that was asked, numbers that move.

A result that satisfies its schema may still be nonsense: millidegrees told as degrees, the reading of another device, a
constant.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from octoform.base.quantities import BOUNDS, is_possible
from octoform.base.unit_names import COUNTS, last_word, unit_in, unit_of_name, unit_of_text
from octoform.endpoint.client.check_report import TrialCall

_NAMES = frozenset({"device", "device_id"})
_MOVED = 0.1
"""A reading that moved by a tenth shows in a result, however it is rounded."""


def out_of_bounds(result: Any, schema: Any) -> list[str]:
    """``member: value unit, beyond bounds`` for each number of a result that no device can have measured."""
    return [
        f"{where or 'the result'}: {value:g} {unit}, which no device measures ({low:g} to {high:g} are possible)"
        for where, value, unit in _measured(result, schema, "", None)
        for low, high in [BOUNDS[unit]]
        if not is_possible(value, unit)
    ]


def of_another(call: TrialCall, devices: frozenset[str]) -> str | None:
    """The id of another device that a result gives for its own; None where it gives its own, or none."""
    for result in call.results if call.device is not None else ():
        if isinstance(result, dict):
            told = [result[name] for name in sorted(_NAMES & result.keys()) if result[name] in devices]
            if told and told[0] != call.device:
                return str(told[0])
        named = set(_texts(result)) & devices
        if named and call.device not in named:
            return sorted(named)[0]
    return None


def unmoved(call: TrialCall) -> str | None:
    """The attribute that moved while three results stayed the same; None where that was not seen."""
    if len(call.results) < 3 or len(call.raw) < 3:
        return None
    told = [_numbers(result) for result in call.results]
    if not told[0] or any(numbers != told[0] for numbers in told):
        return None
    return next((name for name in call.raw[0] if _moves([table.get(name) for table in call.raw])), None)


def _moves(values: Sequence[float | None]) -> bool:
    known = [value for value in values if value is not None]
    widest = max(map(abs, known), default=0.0)
    return len(known) == len(values) and widest > 0 and max(known) - min(known) > _MOVED * widest


def _measured(value: Any, schema: Any, where: str, unit: str | None) -> Iterator[tuple[str, float, str]]:
    """(member, number, unit) of each number whose unit is known."""
    if isinstance(value, Mapping):
        beside = unit_of_text(value.get("unit"))
        members = schema.get("properties", {}) if isinstance(schema, Mapping) else {}
        for name, item in value.items():
            inner = members.get(name, {})
            said = inner.get("description") if isinstance(inner, Mapping) else None
            own = unit_of_name(str(name)) or (beside if name in ("value", "reading") else None)
            own = own or (None if last_word(str(name)) in COUNTS else unit_in(said))
            yield from _measured(item, inner, f"{where}.{name}" if where else str(name), own)
    elif isinstance(value, list):
        inner = schema.get("items", {}) if isinstance(schema, Mapping) else {}
        for index, item in enumerate(value):
            yield from _measured(item, inner, f"{where}[{index}]", unit)
    elif isinstance(value, int | float) and not isinstance(value, bool) and unit is not None:
        yield where, float(value), unit


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)


def _numbers(value: Any) -> list[Any]:
    """The numbers of a result in their order; times and counts of calls are numbers too, and then it moves."""
    if isinstance(value, dict | list):
        items = value.values() if isinstance(value, dict) else value
        return [number for item in items for number in _numbers(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []
