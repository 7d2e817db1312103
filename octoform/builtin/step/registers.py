"""Trials of a product that is driven by registers: each enabled unit goes a little way at a low speed, and back.

The way is small enough to be safe wherever the unit stands and four times what has to be seen; octoform takes it in
the direction that has more room, which is towards the middle. The last unit comes first: of an arm that is the
outermost joint, whose way is free wherever the others stand.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.task import Refused

FACTOR = 4
SECONDS = 1.0
"""How long the way should take: slowly, and well within the time that a movement is waited for."""
_READS = ("read_unit", "read_units")


def trials(given: Mapping[str, Any], grammar: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One trial for each unit of the grammar that is not disabled; Refused without a tool that moves or reads one."""
    registers = grammar["registers"]
    offered = {tool["name"]: tool for tool in given["tools"]}
    unit = registers.get("unit", "unit")
    move, read = (_command(grammar, offered, do) for do in ("move_unit", "read_unit"))
    vary = next(name for name in move["parameters"] if name not in (unit, "speed"))
    by = _by(given, registers)
    return [
        {
            "unit": name,
            "move": {
                "tool": move["tool"],
                "arguments": {**_device(given, offered[move["tool"]]), unit: name, **_speed(move, by)},
                "vary": vary,
                "by": by,
                "relative": False,
            },
            "read": {
                "tool": read["tool"],
                "arguments": {**_device(given, offered[read["tool"]]), unit: name},
                "value": f"/{registers['motion']['present']}",
            },
            "view": None,
            "restore": _restore(given, grammar, offered, name),
        }
        for name in reversed(list(registers["units"]))
        if name not in registers.get("disabled", {})
    ]


def disabled(grammar: Mapping[str, Any]) -> list[dict[str, str]]:
    """The units that this rig never moves, each with the owner's reason."""
    return [{"unit": name, "reason": why} for name, why in grammar["registers"].get("disabled", {}).items()]


def _restore(
    given: Mapping[str, Any], grammar: Mapping[str, Any], offered: Mapping[str, Any], name: str
) -> dict[str, Any] | None:
    """How a unit is made limp again that was limp before; None where no tool tells it or sets it.

    Only a field that is 0 when the unit is limp can be handed on as it was read: any other value means that it holds.
    """
    registers = grammar["registers"]
    unit, released = registers.get("unit", "unit"), registers["motion"].get("release", {})
    shown = [(read, field) for read in _reads(grammar, offered) for field in read["fields"] if released.get(field) == 0]
    holds = next((one for one in grammar["commands"] if one.get("do") == "set_torque" and one["tool"] in offered), None)
    if not shown or holds is None:
        return None
    read, field = shown[0]
    one = read["do"] == "read_unit"
    place = f"/{field}" if one else f"/{unit}s/{list(registers['units']).index(name)}/{field}"
    arguments = {**_device(given, offered[read["tool"]]), **({unit: name} if one else {})}
    return {
        "read": {"tool": read["tool"], "arguments": arguments, "value": place},
        "set": {
            "tool": holds["tool"],
            "arguments": {**_device(given, offered[holds["tool"]]), unit: name},
            "vary": next(key for key in holds["parameters"] if key != unit),
        },
    }


def _reads(grammar: Mapping[str, Any], offered: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The tools that read units, those for a single one first."""
    found = [one for one in grammar["commands"] if one.get("do") in _READS and one["tool"] in offered]
    return sorted(found, key=lambda one: _READS.index(one["do"]))


def _command(grammar: Mapping[str, Any], offered: Mapping[str, Any], do: str) -> Mapping[str, Any]:
    for command in grammar["commands"]:
        if command.get("do") == do and "scale" not in command and command["tool"] in offered:
            return dict(command)
    raise Refused(f"no tool of this device does {do}, so no unit of it can be tried")


def _by(given: Mapping[str, Any], registers: Mapping[str, Any]) -> int:
    """How far: four times what has to be seen, and never more than a tenth of the whole range."""
    motion, least = registers["motion"], float(given["proof"]["minimum"])
    span = motion["maximum"] - motion["minimum"]
    return int(max(least, min(FACTOR * least, span / 10)))


def _speed(move: Mapping[str, Any], by: int) -> dict[str, int]:
    """A low speed, within what the tool takes; nothing where it takes none."""
    speed = move["parameters"].get("speed")
    if speed is None:
        return {}
    low, high = speed.get("minimum", 0), speed.get("maximum", by)
    return {"speed": round(min(high, max(low, by / SECONDS)))}


def _device(given: Mapping[str, Any], tool: Mapping[str, Any]) -> dict[str, str]:
    """Which device is meant, where a tool serves several."""
    return {"device": given["device"]["id"]} if "device" in tool["input_schema"].get("properties", {}) else {}
