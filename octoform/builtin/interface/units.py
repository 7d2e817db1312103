"""Which units of a device a tool acts on, as the grammar of its profile says: joints on a bus, axes of a rail.

The endpoint needs it to hold a restriction or a range of one unit whichever tool reaches that unit.
"""

from collections.abc import Mapping
from typing import Any

_MOVES = ("move_unit", "move_units", "pose")
OFF = 60
"""How far from its goal a unit may stand for the runtime to say that it came there."""
_NAMED = ("move_unit", "set_torque")


def acted_on(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """The ``units`` of the tool of a command; empty for one that reads or stops, and where no units are described."""
    if command["effect"] == "read" or command.get("do") == "stop":
        return {}
    bank = grammar.get("registers")
    return _of_bank(bank, command) if bank else _of_axes(grammar.get("position") or {}, command)


def _of_bank(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    do, ids = command["do"], bank["units"]
    acted = bank["poses"][command["pose"]] if do == "pose" else ids
    told: dict[str, Any] = {"names": {name: [str(ids[name])] for name in acted}}
    if do in _NAMED:
        told["parameter"] = str(bank["unit"])
    if do == "move_units":
        told["parameters"] = {name: name for name in command["parameters"] if name in ids}
    if do in _MOVES:
        told["goal"] = _goal(bank, command)
        told["reports"] = _reports(bank, command)
    return told


def _reports(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """Where the answer says at which place the units stand."""
    unit = str(bank["unit"])
    records = {} if command["do"] == "move_unit" else {"records": f"{unit}s"}
    return {"field": "position", **records, "unit": unit, "within": OFF}


def _goal(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    motion = bank["motion"]
    unit = bank["fields"][motion["goal"]].get("unit")
    goal = {"of": "position", "minimum": motion["minimum"], "maximum": motion["maximum"]}
    goal |= {"unit": unit} if unit else {}
    if command["do"] == "pose":
        goal["fixed"] = dict(bank["poses"][command["pose"]])
    elif command["do"] == "move_unit" and not command.get("scale"):
        goal["parameter"] = "position"
    return goal


def _of_axes(position: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    axes = position.get("axes") or {}
    own = [name for name, axis in axes.items() if axis["tool"] == command["tool"]]
    acted = list(axes) if command["tool"] == position.get("zero") else own
    return {"names": {name: [] for name in acted}} if acted else {}
