"""Rules for what ends a movement: IDENTIFY marks the capability, INTERFACE repeats it, and neither marks too much.

A call of such a tool passes those that wait for the device, so the mark belongs to tools that do nothing but stop.
Where a profile has a protocol definition, that alone marks the stop command, and its own rules report deviations.
"""

from octoform.base.escaping import display
from octoform.base.pointer import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, described
from octoform.diagnostics import Diagnostic, error

_ACTUATE = "actuate"


def identify_stops(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability that stops actuates, and does so on every device that has it."""
    commanded = {device: commands for device, _, commands in described(value, artifacts)}
    first: dict[str, bool] = {}
    out = []
    for index, device in enumerate(value["devices"]):
        for at, capability in enumerate(device["capabilities"]):
            stops, name = capability.get("stops", False), capability["name"]
            if name in commanded.get(device["id"], {}):
                continue
            if stops and capability["effect"] != _ACTUATE:
                summary, hint = f"{display(name)} stops and is {capability['effect']}", "what ends a movement actuates"
            elif first.setdefault(name, stops) is not stops:
                summary = f"{display(name)} stops on one device and not on another"
                hint = "give capabilities that do different things different names"
            else:
                continue
            where = pointer("devices", index, "capabilities", at)
            out.append(error("IDENTIFY-STOPS", summary, pointer=where, hint=hint))
    return out


def interface_stops(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool stops where its capability does, and takes no parameter but the device."""
    stopping = {
        capability["name"]: capability.get("stops", False)
        for device in (artifacts.identify or {"devices": []})["devices"]
        for capability in device["capabilities"]
    }
    for _, _, commands in described(artifacts.identify, artifacts):
        for name in commands:
            stopping.pop(name, None)
    out = []
    for index, tool in enumerate(value["tools"]):
        stops = tool.get("stops", False)
        wanted = stopping.get(tool["capability"], stops)
        properties = tool["input_schema"].get("properties")
        others = sorted(set(properties if isinstance(properties, dict) else ()) - {"device"})
        if stops is not wanted:
            word = "true" if wanted else "false"
            summary = f"{display(tool['name'])} and its capability differ in `stops`"
            where, hint = pointer("tools", index), f'write "stops": {word}'
        elif stops and others:
            summary = f"{display(tool['name'])} stops, and takes the parameter {display(others[0])}"
            where = pointer("tools", index, "input_schema", "properties", others[0])
            hint = "a tool that stops takes no parameter but `device`"
        else:
            continue
        out.append(error("INTERFACE-STOPS", summary, pointer=where, hint=hint))
    return out


IDENTIFY_RULES = (Rule("IDENTIFY-STOPS", identify_stops),)
INTERFACE_RULES = (Rule("INTERFACE-STOPS", interface_stops),)
