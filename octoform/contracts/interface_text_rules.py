"""Rules for INTERFACE about what clients read and give: words that name no unit, and results with members.

A description goes to every model that uses the endpoint and, as part of the artifact, into git.
"""

import re
from collections.abc import Iterator
from typing import Any

from octoform.contracts.member_units import measured_without_unit
from octoform.contracts.model import Artifacts, JsonObject, Rule, effects_of
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error, warning

_INSTANCE = {
    "a hardware address": re.compile(r"\b[0-9a-f]{2}(?:[:-][0-9a-f]{2}){5}\b", re.IGNORECASE),
    "a place of a device": re.compile(r"(?<![\w/])/(?:dev|sys)/\w[\w/.:-]*"),
    "a port of a bus": re.compile(r"\b(?:usb|port|bus)\s+\d+-\d+(?:\.\d+)*\b", re.IGNORECASE),
    "a serial number": re.compile(
        r"\bserial (?:number|no\.?)\s*[:=]?\s*(?=[A-Z0-9-]*\d)[A-Z0-9][A-Z0-9-]{4,}\b", re.IGNORECASE
    ),
}
_ORDERS = re.compile(
    r"\b(?:ignore|disregard|forget|override)\s+(?:\w+\s+){0,3}?(?:instructions?|prompts?|rules)\b"
    r"|<\s*/?\s*(?:system|assistant|user|instructions?|important)\s*>|(?:^|\n)\s*(?:system|assistant)\s*:"
    r"|\byou are now\b|\breveal (?:your|the) (?:system )?prompt\b|\bdo not (?:tell|inform) the user\b",
    re.IGNORECASE,
)
_DEMANDS = re.compile(r"\byou (?:must|have to) (?:always )?(?:call|use|run|execute)\b", re.IGNORECASE)


def description(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A description tells of kinds, names no single unit and no place, and gives the reader no orders."""
    serials, names = _serials(artifacts), _names(artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        for where, text in _descriptions(tool, ("tools", index)):
            unit = next((what for what, form in _INSTANCE.items() if _said(form, text, names)), None)
            if unit or any(serial in text for serial in serials):
                summary = f"a description of {shown(tool['name'])} has {unit or 'a serial number'} in it"
                hint = "describe the kind of device; which unit it is and where it is are found when a tool is called"
                out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
            elif _said(_ORDERS, text, names):
                summary = f"a description of {shown(tool['name'])} gives orders to whoever reads it"
                hint = "say what the tool does; what a device calls itself is quoted, and never obeyed"
                out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
            elif _said(_DEMANDS, text, names):
                summary = f"a description of {shown(tool['name'])} demands that another tool is called"
                hint = "say what to beware of; when to call what is for the caller to decide"
                out.append(warning("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
    return out


def result_bare(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading has members with units; a bare text may have to be parsed by whoever calls it."""
    effects, out = effects_of(artifacts), []
    hint = 'describe each reading as a member with its unit: {"temperature_celsius": {"type": "number"}}'
    for index, tool in enumerate(value["tools"]):
        if tool["effect"] != "read" or effects.get(tool["capability"], "read") != "read":
            continue  # of an effect that is understated another rule tells, and it is the cause
        where = pointer("tools", index, "output_schema")
        if why := _bare(tool.get("output_schema")):
            summary = f"the result of {shown(tool['name'])} {why}"
            out.append(error("INTERFACE-RESULT-BARE", summary, pointer=where, hint=hint))
        elif _is_text(tool["output_schema"]):
            summary = f"the result of {shown(tool['name'])} is one text"
            out.append(warning("INTERFACE-RESULT-BARE", summary, pointer=where, hint=hint))
    return out


def _bare(schema: Any) -> str:
    """What is missing of a schema for a result; empty where nothing is."""
    if schema is None:
        return "is not described: there is no output_schema"
    if not isinstance(schema, dict) or {"$ref", "anyOf", "oneOf", "allOf"} & schema.keys():
        return ""
    members = schema.get("properties")
    return "" if isinstance(members, dict) and members else "has no members that say what they are"


def _is_text(schema: Any) -> bool:
    members = schema.get("properties") if isinstance(schema, dict) else None
    if not isinstance(members, dict) or len(members) != 1:
        return False
    only = next(iter(members.values()))
    return isinstance(only, dict) and only.get("type") == "string" and "enum" not in only and bool(set(members) & _BARE)


def result_without_unit(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A member that is a quantity has its unit in its name or description: results are judged by it."""
    out = []
    for index, tool in enumerate(value["tools"]):
        schema = tool.get("output_schema") if tool["effect"] == "read" else None
        for where, name in measured_without_unit(schema):
            summary = f"the result's {shown(name)} of {shown(tool['name'])} is a quantity, and no unit is given"
            hint = f"put the unit into the description of {shown(name)} or at the end of its name, or a member `unit` "
            hint += "beside it; what a device gives without one is called raw"
            place = pointer("tools", index, "output_schema", *where)
            out.append(error("INTERFACE-RESULT-UNIT", summary, pointer=place, hint=hint))
    return out


_BARE = frozenset({"result", "text", "output", "value", "response", "answer", "stdout", "reply"})
RULES = (
    Rule("INTERFACE-DESCRIPTION", description),
    Rule("INTERFACE-RESULT-BARE", result_bare),
    Rule("INTERFACE-RESULT-UNIT", result_without_unit),
)


def _descriptions(value: Any, where: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """(place, text) of every description in a tool, its schemas' too."""
    if isinstance(value, dict):
        for name, item in value.items():
            if name == "description" and isinstance(item, str):
                yield (*where, name), item
            else:
                yield from _descriptions(item, (*where, name))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _descriptions(item, (*where, index))


def _said(form: "re.Pattern[str]", text: str, names: str) -> bool:
    """Whether a description says something itself; what a device calls itself is quoted in it, whatever that is."""
    return any(found[0].casefold() not in names for found in form.finditer(text))


def _names(artifacts: Artifacts) -> str:
    """What all devices are called, by themselves and by IDENTIFY."""
    found = [*(artifacts.identify or {}).get("devices", ()), *(artifacts.probe or {}).get("devices", ())]
    told = (str(device.get(name, "")) for device in found for name in ("identified_as", "name", "raw_descriptor"))
    return "\n".join(told).casefold()


def _serials(artifacts: Artifacts) -> set[str]:
    """The serial numbers that PROBE saw, where they are long enough to be nothing else."""
    devices = (artifacts.probe or {}).get("devices", ())
    found = {str((device.get("instance") or {}).get("serial") or "") for device in devices}
    return {serial for serial in found if len(serial) >= 6 and any(map(str.isdigit, serial))}
