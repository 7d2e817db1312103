"""Rules for which units of a device a tool acts on: without them a restriction of one joint holds for some tools only.

A device has several units where a tool of it names them or its profile's grammar drives them. Every tool that actuates
such a device says which it acts on; only then can the endpoint keep a joint still, or in its range, whatever moves it.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import Diagnostic, error

_DRIVES = frozenset({"move_unit", "move_units", "pose", "set_torque"})


def units_missing(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that actuates a device with several units says which of them a call acts on."""
    of_units = _devices_of_units(value, artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        concerned = sorted(of_units.intersection(tool["devices"]))
        if not concerned or tool["effect"] == "read" or tool.get("stops") or "units" in tool:
            continue
        summary = f"{shown(tool['name'])} does not say which units of {listed(concerned)} it acts on"
        hint = "write `units`: their names, the parameter that names one, and where a call moves them"
        out.append(error("INTERFACE-UNITS-MISSING", summary, pointer=pointer("tools", index), hint=hint))
    return out


def units_wrong(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """What a tool says of its units fits its parameters, and its own words."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for problem in _problems(tool) if "units" in tool else ():
            summary = f"the units of {shown(tool['name'])} {problem}"
            hint = "name only parameters that input_schema has, and units that stand in `names`"
            out.append(error("INTERFACE-UNITS-WRONG", summary, pointer=pointer("tools", index, "units"), hint=hint))
    return out


RULES = (Rule("INTERFACE-UNITS-MISSING", units_missing), Rule("INTERFACE-UNITS-WRONG", units_wrong))


def _devices_of_units(value: JsonObject, artifacts: Artifacts) -> set[str]:
    found = {device for tool in value["tools"] if len(_names(tool)) > 1 for device in tool["devices"]}
    for device in (artifacts.identify or {"devices": []})["devices"]:
        facts = artifacts.profiles.get(device.get("profile", ""))
        if facts is not None and any(command.get("do") in _DRIVES for command in facts.commands):
            found.add(device["id"])
    return found


def _names(tool: JsonObject) -> Mapping[str, Any]:
    names: Mapping[str, Any] = (tool.get("units") or {}).get("names") or {}
    return names


def _problems(tool: JsonObject) -> Iterator[str]:
    told = tool["units"]
    names, stands, goal = told["names"], told.get("parameters", {}), told.get("goal", {})
    properties = tool["input_schema"].get("properties")
    known = set(properties) if isinstance(properties, dict) else set()
    if absent := sorted({*stands, *_given(told, "parameter"), *_given(goal, "parameter")} - known):
        yield f"name {listed([shown(name) for name in absent])}, which is no parameter of it"
    if strange := sorted({*stands.values(), *goal.get("fixed", {})} - set(names)):
        yield f"do not list {listed([shown(name) for name in strange])} among their names"
    if unplaced := sorted(set(names) - set(goal["fixed"])) if goal.get("fixed") else []:
        yield f"have a pose without a place of {listed([shown(name) for name in unplaced])}"
    words = [word for name, others in names.items() for word in (name, *others)]
    if reports := told.get("reports"):
        yield from _unreported(tool, reports)
    if twice := sorted({word for word in words if words.count(word) > 1}):
        yield f"mean more than one by {listed([shown(word) for word in twice])}"
    choices = (properties or {}).get(told.get("parameter"), {}).get("enum", ())
    if strange := sorted({str(word) for word in choices} - set(words)):
        yield f"do not say which one {listed([shown(word) for word in strange])} is"


def _unreported(tool: JsonObject, reports: JsonObject) -> Iterator[str]:
    """Where the output schema has no such place, or the place would be of nothing."""
    if "goal" not in tool["units"]:
        yield "report a place without a goal"
    record = (tool.get("output_schema") or {}).get("properties") or {}
    if name := reports.get("records"):
        items = (record.get(name) or {}).get("items") or {}
        record = items.get("properties") or {}
    elif "unit" not in reports and len(tool["units"]["names"]) > 1:
        yield "report a place and do not say of which unit"
    wanted = [name for name in (reports["field"], reports.get("unit")) if name]
    if absent := sorted({*wanted} - set(record)):
        yield f"report by {listed([shown(name) for name in absent])}, which the output schema does not have"


def _given(told: Mapping[str, Any], name: str) -> tuple[str, ...]:
    return (told[name],) if name in told else ()
