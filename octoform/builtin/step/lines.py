"""Trials of a product that is driven by lines of text: each axis goes a bounded way, and the camera sees it or not.

Only a movement that is counted from where the product stands can be undone without knowing where that is.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.grammars import parameters
from octoform.builtin.step.cameras import best

PART = 2
"""Half of the farthest single move: far enough to be seen plainly."""


def trials(given: Mapping[str, Any], grammar: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One trial for each tool with a single distance that goes both ways, in the order of the grammar."""
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
    """The parameter that says how far and a bounded distance; None for a command that is no such movement."""
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
    """The axis that the command moves, as the grammar calls it; else its tool."""
    axes = grammar.get("position", {}).get("axes", {})
    return next((str(name) for name, axis in axes.items() if axis["tool"] == command["tool"]), str(command["tool"]))
