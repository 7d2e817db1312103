"""Ranges of places on the units of a device, brought to every tool that moves these units. Pure, light.

A range is written for the parameter of one tool; what it protects is a joint or an axis, which other tools move too,
one by one or in a pose. So each range of a place is collected by device, quantity and unit, and then holds for the
goals of every tool, however that tool is told its goal.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Tool = Mapping[str, Any]
Place = tuple[str, str, str]
"""(device, quantity, unit of the device)"""


@dataclass(frozen=True, slots=True)
class Bound:
    """One range of a source: of the value of ``parameter`` in calls of ``tool``, for ``units`` alone where some are."""

    tool: Tool
    parameter: str
    minimum: float | None
    maximum: float | None
    source: str
    units: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Range:
    """The tightest ends so far, each with who set it."""

    minimum: float | None = None
    maximum: float | None = None
    low: str = ""
    high: str = ""

    def within(self, bound: Bound) -> "Range":
        """This range, narrowed by a bound."""
        found = self
        if bound.minimum is not None and (found.minimum is None or bound.minimum > found.minimum):
            found = Range(bound.minimum, found.maximum, bound.source, found.high)
        if bound.maximum is not None and (found.maximum is None or bound.maximum < found.maximum):
            found = Range(found.minimum, bound.maximum, found.low, bound.source)
        return found


def ranges(bounds: Iterable[Bound]) -> dict[Place, Range]:
    """The tightest range of each unit's place."""
    found: dict[Place, Range] = {}
    for bound in bounds:
        of = (bound.tool.get("units") or {}).get("goal", {}).get("of")
        for unit in _bounded(bound) if of else ():
            for device in bound.tool["devices"]:
                place = (device, of, unit)
                found[place] = found.get(place, Range()).within(bound)
    return found


def limits(tool: Tool, known: Mapping[Place, Range]) -> Iterator[dict[str, Any]]:
    """The limits on the goals of a tool: those that are tighter than what the tool keeps to anyway."""
    told = tool.get("units") or {}
    goal = told.get("goal") or {}
    for unit in told.get("names", ()) if goal else ():
        found = _of_all(tool, known, goal["of"], unit)
        if _is_tighter(found, _inherent(goal, unit)):
            yield _limit(found, goal, unit)


def reported(tool: Tool, known: Mapping[Place, Range]) -> Iterator[dict[str, Any]]:
    """The ranges against which the places are held that the device reports after a call of a tool."""
    told = tool.get("units") or {}
    goal = told.get("goal") or {}
    for unit in told.get("names", ()) if goal else ():
        if (found := _of_all(tool, known, goal["of"], unit)) != Range():
            yield _limit(found, goal, unit)


def fixed_outside(tool: Tool, known: Mapping[Place, Range]) -> Iterator[tuple[str, float, str]]:
    """(unit, place, who limits it) of each fixed place of a tool that is outside of its range: no call will pass."""
    fixed = ((tool.get("units") or {}).get("goal") or {}).get("fixed") or {}
    for limit in limits(tool, known):
        place = fixed.get(limit["of"])
        low, high = limit.get("minimum"), limit.get("maximum")
        if place is not None and ((low is not None and place < low) or (high is not None and place > high)):
            yield limit["of"], place, limit["source"]


def _of_all(tool: Tool, known: Mapping[Place, Range], quantity: str, unit: str) -> Range:
    """The tightest range of a unit's place over all devices of a tool."""
    found = Range()
    for device in tool["devices"]:
        each = known.get((device, quantity, unit), Range())
        found = found.within(Bound(tool, "", each.minimum, None, each.low))
        found = found.within(Bound(tool, "", None, each.maximum, each.high))
    return found


def _limit(found: Range, goal: Mapping[str, Any], unit: str) -> dict[str, Any]:
    ends = {"minimum": found.minimum, "maximum": found.maximum}
    return {
        "kind": "goal",
        "of": unit,
        **{name: value for name, value in ends.items() if value is not None},
        **({"unit": goal["unit"]} if goal.get("unit") else {}),
        "source": _source(found),
    }


def _bounded(bound: Bound) -> tuple[str, ...]:
    """The units whose place the parameter of a bound is."""
    told = bound.tool["units"]
    if bound.parameter == told["goal"].get("parameter"):
        found = tuple(told["names"])
    else:
        found = tuple(unit for name, unit in told.get("parameters", {}).items() if name == bound.parameter)
    return tuple(unit for unit in found if not bound.units or unit in bound.units)


def _inherent(goal: Mapping[str, Any], unit: str) -> tuple[float | None, float | None]:
    """Where the tool itself never leaves: its one place, or the range that INTERFACE says."""
    if unit in goal.get("fixed", {}):
        return goal["fixed"][unit], goal["fixed"][unit]
    return goal.get("minimum"), goal.get("maximum")


def _is_tighter(found: Range, inherent: tuple[float | None, float | None]) -> bool:
    low, high = inherent
    below = found.minimum is not None and (low is None or low < found.minimum)
    return below or (found.maximum is not None and (high is None or high > found.maximum))


def _source(found: Range) -> str:
    if found.low == found.high or not (found.low and found.high):
        return found.low or found.high
    return f"{found.low} (minimum), {found.high} (maximum)"
