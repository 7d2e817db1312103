"""Rules for which units of a device a tool acts on: without them a restriction of one joint holds for some tools only.

A device has several units where a tool of it names them or its protocol definition drives them. Every tool that
actuates such a device names the one it acts on; only then can the endpoint keep a joint still, or in its range,
whatever moves it.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.diagnostics import Diagnostic, error

_DRIVES = frozenset({"move_unit", "move_units", "pose", "set_torque"})


def units_missing(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that actuates a device with several units states which of them a call acts on."""
    of_units = _devices_of_units(value, artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        concerned = sorted(of_units.intersection(tool["devices"]))
        if not concerned or tool["effect"] == "read" or tool.get("stops") or "units" in tool:
            continue
        summary = f"{display(tool['name'])} does not declare which units of {listed(concerned)} it acts on"
        hint = "write `units`: their names, the parameter that names one, and where a call moves them"
        out.append(error("INTERFACE-UNITS-MISSING", summary, pointer=pointer("tools", index), hint=hint))
    return out


def units_wrong(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A tool's ``units`` must fit its parameters and its description."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for problem, hint in _problems(tool) if "units" in tool else ():
            summary = f"the units of {display(tool['name'])} {problem}"
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


def _problems(tool: JsonObject) -> Iterator[tuple[str, str]]:
    """(what is wrong, the cure) of a tool's units."""
    found = tool["units"]
    names, stands, goal = found["names"], found.get("parameters", {}), found.get("goal", {})
    properties = tool["input_schema"].get("properties")
    known = set(properties) if isinstance(properties, dict) else set()
    if absent := sorted({*stands, *_given(found, "parameter"), *_given(goal, "parameter")} - known):
        yield (
            f"name {listed([display(name) for name in absent])}, which is no parameter of it",
            "name parameters of input_schema",
        )
    if strange := sorted({*stands.values(), *goal.get("fixed", {})} - set(names)):
        yield f"do not list {listed([display(name) for name in strange])} among their names", "add it to `names`"
    if unplaced := sorted(set(names) - set(goal["fixed"])) if goal.get("fixed") else []:
        cure = "add its place to `fixed`, or take the unit out of `names`"
        yield f"have a pose without a place of {listed([display(name) for name in unplaced])}", cure
    words = [word for name, others in names.items() for word in (name, *others)]
    if reports := found.get("reports"):
        yield from _unreported(tool, reports)
    if twice := sorted({word for word in words if words.count(word) > 1}):
        yield f"mean more than one by {listed([display(word) for word in twice])}", "give each word to one unit"
    choices = (properties or {}).get(found.get("parameter"), {}).get("enum", ())
    if strange := sorted({str(word) for word in choices} - set(words)):
        cure = "add the choices of the parameter to `names`, as a unit or as another word for one"
        yield f"do not define which one {listed([display(word) for word in strange])} is", cure


def _unreported(tool: JsonObject, reports: JsonObject) -> Iterator[tuple[str, str]]:
    """Where the output schema has no such place, or the place would be of nothing."""
    if "goal" not in tool["units"]:
        yield "report a place without a goal", "write `goal`, or take `reports` out"
    record = (tool.get("output_schema") or {}).get("properties") or {}
    if name := reports.get("records"):
        items = (record.get(name) or {}).get("items") or {}
        record = items.get("properties") or {}
    if "unit" not in reports and len(tool["units"]["names"]) > 1:
        cure = "write into `reports.unit` which member of the record names the unit; only one unit needs none"
        yield "report a place and do not name its unit", cure
    wanted = [name for name in (reports["field"], reports.get("unit")) if name]
    if absent := sorted({*wanted} - set(record)):
        cure = "name members of the record: those of the items of `records`, or without it of the result itself"
        yield f"report by {listed([display(name) for name in absent])}, which the output schema does not have", cure


def _given(units: Mapping[str, Any], name: str) -> tuple[str, ...]:
    return (units[name],) if name in units else ()
