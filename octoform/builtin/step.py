"""A privileged step: the hardware tests that prove the tools of a device, from the profile's protocol definition."""

from collections.abc import Mapping, Sequence
from typing import Any

from octoform.builtin.task import Task, TaskRefused, holding, parameters

# Which camera is looked through: the one that a person named, else one on a hub of its own, else a USB one.


def best(cameras: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The camera to take; the first of equals by its id. TaskRefused when there is none.

    A camera that shares a hub with what moves may vanish just when it is needed; a built-in one looks elsewhere.
    """
    if not cameras:
        raise TaskRefused("no tool of this host takes a picture, so nothing can be seen to move")
    ranked = sorted(
        cameras,
        key=lambda item: (not item["hint"], bool(item["hub_shared_with"]), item["built_in"], item["device"]),
    )
    return ranked[0]


# Hardware tests of a product that is driven by lines of text: each axis goes a bounded way, and the camera sees it or
# not.
#
# Only a movement that is counted from where the product stands can be undone without knowing where that is.

PART = 2
"""Half of the farthest single move: far enough to be seen plainly."""


def line_tests(given: Mapping[str, Any], grammar: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One test for each tool with a single distance that goes both ways, in the order of the protocol definition."""
    camera = best(given["cameras"])
    view = {"tool": camera["tool"], "arguments": dict(camera["arguments"])}
    offered = {tool["name"]: tool for tool in given["tools"]}
    found = []
    for command in grammar["commands"]:
        tool = offered.get(command["tool"])
        way = _way(command) if tool is not None else None
        if tool is None or way is None:
            continue
        several = "device" in tool["input_schema"].get("properties", {})
        arguments = {"device": given["device"]["id"]} if several else {}
        move = {"tool": command["tool"], "arguments": arguments, "vary": way[0], "by": way[1], "relative": True}
        found.append({"unit": _unit(grammar, command), "move": move, "read": None, "view": view})
    return found


def _way(command: Mapping[str, Any]) -> tuple[str, int] | None:
    """The parameter that states how far and a bounded distance; None for a command that is no such movement."""
    values = parameters({}, command)
    if command["effect"] != "actuate" or len(values) != 1:
        return None
    name, value = next(iter(values.items()))
    low, high = value.get("minimum"), value.get("maximum")
    if value["type"] not in ("integer", "number") or low is None or high is None or not low < 0 < high:
        return None
    by = int(min(-low, high) / PART)
    return (name, by) if by > 0 else None


def _unit(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    """The axis that the command moves, as the protocol definition calls it; else its tool."""
    axes = grammar.get("position", {}).get("axes", {})
    return next((str(name) for name, axis in axes.items() if axis["tool"] == command["tool"]), str(command["tool"]))


# Hardware tests of a product that is driven by registers: each enabled unit goes a little way at a low speed, and back.
#
# The way is small enough to be safe wherever the unit stands and four times what has to be seen; octoform takes it in
# the direction that has more room, which is towards the middle. The last unit comes first: of an arm that is the
# outermost joint, whose way is free wherever the others stand.

FACTOR = 4
SECONDS = 1.0
"""How long the way should take: slowly, and well within the time that a movement is waited for."""
_READS = ("read_unit", "read_units")


def register_tests(given: Mapping[str, Any], grammar: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One test for each unit of the definition that is not disabled; TaskRefused without a tool to move or read one."""
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
    """How a unit is made limp again that was limp before; None where no tool reads it or sets it.

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
    raise TaskRefused(f"no tool of this device does {do}, so no unit of it can be tried")


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


# The stage: the step's input in, its hardware tests out. It moves nothing: octoform carries the tests out.
#
# The embedded agent never rewrites a server: its tools are made from the same definition, so there is nothing that it
# would write otherwise. What it cannot prove it refuses, with the reason.


def run(task: Task) -> str:
    """Write the step's output; the summary line (``5 tests, 1 unit skipped``).

    TaskRefused states why there is none.
    """
    given = task.read_input()
    try:
        value = answer(given, task)
    except (KeyError, TypeError, AttributeError) as problem:
        raise TaskRefused(f"the step's input cannot be used: {type(problem).__name__}: {problem}") from problem
    task.write(value)
    if value["camera"] is not None:
        return f"the camera {value['camera']['device']}"
    return f"{len(value['trials'])} hardware tests, {len(value['skipped'])} units skipped"


def answer(given: Mapping[str, Any], task: Task) -> dict[str, Any]:
    """The output for an input; TaskRefused where nothing that is known can prove it."""
    kind, device = given["proof"]["kind"], given["device"]
    blank = {"format": 1, "step": given["step"], "device": None, "server": None}
    if kind == "frame":
        camera = best(given["cameras"])
        chosen = {name: camera[name] for name in ("device", "tool", "arguments")}
        return {**blank, "trials": [], "skipped": [], "camera": chosen}
    if device is None:
        raise TaskRefused("this step is for no certain device; the embedded agent moves only what a profile describes")
    profile = holding(task.profiles, device["id"])
    grammar = (profile or {}).get("grammar") or {}
    skipped: list[dict[str, str]] = []
    if kind == "reading" and "registers" in grammar:
        trials, skipped = register_tests(given, grammar), disabled(grammar)
    elif kind == "view" and "line" in grammar:
        trials = line_tests(given, grammar)
    else:
        raise TaskRefused(
            f"the profile has no protocol definition from which a hardware test of the kind {kind} could be made"
        )
    if not trials:
        raise TaskRefused("nothing of this device can be tried: no enabled unit, or no tool that moves it to and fro")
    return {**blank, "device": device["id"], "trials": trials, "skipped": skipped, "camera": None}


__all__ = ["run"]
