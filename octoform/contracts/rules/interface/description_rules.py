"""Rules for INTERFACE about descriptions: they are about kinds, name no unit and no place, and order nothing.

A description goes to every model that uses the endpoint and, as part of the artifact, into git.
"""

import json
import re
from collections.abc import Iterator
from typing import Any

from octoform.base.escaping import display
from octoform.base.pointer import pointer
from octoform.contracts.device_kinds import speaks_bytes
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.interface import subject_rules
from octoform.contracts.rules.interface.bound_rules import listed_of
from octoform.contracts.rules.interface.subject_rules import known_text
from octoform.diagnostics import Diagnostic, error

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
    r"|\balways (?:call|use|run|invoke) (?:this|it)\b|\b(?:before|instead of) (?:any|every|all) others?\b"
    r"|\byou are now\b|\breveal (?:your|the) (?:system )?prompt\b|\bdo not (?:tell|inform) the user\b",
    re.IGNORECASE,
)
_OPEN = re.compile(r"\b(?:TODO|FIXME|TBD|TBA|lorem ipsum)\b|\bdescribe this tool\b")
_DEMANDS = re.compile(
    r"\byou (?:must|have to|need to) (?:(?:always|first|then|also|never|again|please) ){0,2}"
    r"(?:call|use|run|execute|invoke)\b",
    re.IGNORECASE,
)
_CALLS = re.compile(
    r"\b(?:(?:[Cc]all|[Ii]nvoke|[Ee]xecute|[Rr]un)\s+(?:the\s+)?(?:tool\s+)?|[Uu]se\s+the\s+tool\s+)"
    r"[`'\"]?([a-zA-Z][a-zA-Z0-9]*(?:[_.][a-zA-Z0-9]+)+)\b"
)
"""An order to call something whose name can only be that of a tool."""
_SENDS_AWAY = re.compile(
    r"(?:^|[.;\n])(?:(?!\b(?:not|never|no|nothing|none|without)\b)[^.;\n]){0,200}?"
    r"\b(?:(?:e-?mails|uploads?) (?:it|them|the|each|every|a)\b|(?:uploads?|publish(?:es)?|posts?|pushes|transmits?"
    r"|streams?|sends?|shares?|forwards?|synchroni[sz]es?)\b[^.;\n]{0,60}?\b(?:cloud|internet|web ?sites?|web ?hooks?"
    r"|e-?mail|mqtt"
    r"|social media|online|vendor'?s?|remote (?:server|host|service|endpoint|storage))\b)",
    re.IGNORECASE,
)
_SPOKEN = (
    (_ORDERS, "gives orders to anyone who reads it", "quote what a device calls itself, and never obey it"),
    (_DEMANDS, "demands that another tool is called", "name what to beware of; the caller decides when to call what"),
    (
        _SENDS_AWAY,
        "promises that data leave this host",
        "its device is attached here: a result goes to the caller alone",
    ),
)


def description(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A description is about kinds, names no single unit and no place, and gives the reader no orders."""
    serials, names, attached = _serials(artifacts), _names(artifacts), attached_devices(artifacts)
    served = {tool["name"] for tool in value["tools"]}
    out = []
    for index, tool in enumerate(value["tools"]):
        for where, text in _descriptions(tool, ("tools", index)):
            unit = next((what for what, form in _INSTANCE.items() if _states(form, text, names)), None)
            if unit or any(serial in text for serial in serials):
                summary = f"a description of {display(tool['name'])} has {unit or 'a serial number'} in it"
                hint = "describe the kind of device; which unit it is and where it is are found when a tool is called"
                out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
            elif _OPEN.search(text):
                summary = f"a description of {display(tool['name'])} is not written yet"
                hint = "say what the tool does, on which device, and what comes back"
                out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
            for name in _called(tool, text, served):
                summary = f"a description of {display(tool['name'])} has {display(name)} called, which is no tool here"
                hint = "describe what the tool does; name only tools of this interface, under their names"
                out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
            for form, what, hint in _SPOKEN:
                if _states(form, text, names) and (form is not _SENDS_AWAY or attached.issuperset(tool["devices"])):
                    summary = f"a description of {display(tool['name'])} {what}"
                    hint = f"describe what the tool does; {hint}"
                    out.append(error("INTERFACE-DESCRIPTION", summary, pointer=pointer(*where), hint=hint))
        for what, hint in (*subject_rules.problems(tool, artifacts), *_promised(tool, artifacts)):
            summary = f"the description of {display(tool['name'])} {what}"
            at = pointer("tools", index, "description")
            out.append(error("INTERFACE-DESCRIPTION", summary, pointer=at, hint=hint))
    return out


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


def _called(tool: JsonObject, text: str, served: set[str]) -> list[str]:
    """What a description has called that is neither a tool of the interface nor a word of the tool's own schemas."""
    schemas = json.dumps([tool["input_schema"], tool.get("output_schema")])
    found = dict.fromkeys(_CALLS.findall(text.partition("Through:")[0]))
    return [name for name in found if name not in served and f'"{name}"' not in schemas]


def _states(form: "re.Pattern[str]", text: str, names: str) -> bool:
    """Whether a description states something itself; what a device calls itself is quoted in it, whatever that is."""
    return any(found[0].casefold() not in names for found in form.finditer(text))


def _names(artifacts: Artifacts) -> str:
    """The names of all devices, their own and IDENTIFY's."""
    found = [*(artifacts.identify or {}).get("devices", ()), *(artifacts.probe or {}).get("devices", ())]
    lines = (str(device.get(name, "")) for device in found for name in ("identified_as", "name", "raw_descriptor"))
    return "\n".join(lines).casefold()


def _serials(artifacts: Artifacts) -> set[str]:
    """The serial numbers that PROBE saw, where they are long enough to be nothing else."""
    devices = (artifacts.probe or {}).get("devices", ())
    found = {str((device.get("instance") or {}).get("serial") or "") for device in devices}
    return {serial for serial in found if len(serial) >= 6 and any(map(str.isdigit, serial))}


def attached_devices(artifacts: Artifacts) -> set[str]:
    """The devices that PROBE found at this host, and not in its network."""
    probed = (artifacts.probe or {}).get("devices", ())
    return {device["id"] for device in probed if device.get("interface") != "network"}


# What a description promises: no part, quantity or accuracy that its devices do not have.

_PARTS_OF_A_HOST = {
    **dict.fromkeys(("gpu",), ("gpu", "graphic", "drm", "vga", "radeon", "nvidia")),
    **dict.fromkeys(("cpu", "processor"), ("cpu", "processor", "core", "package", "pkg", "tctl", "soc", "k10")),
    **dict.fromkeys(("battery",), ("batter", "power_supply", "pnp0c0a", "ups", "accumulator")),
    **dict.fromkeys(("camera", "webcam"), ("cam", "video", "uvc", "imag", "sensor", "capture")),
    **dict.fromkeys(("backlight",), ("backlight",)),
}
"""Parts that a description may name, each with what a device of that kind has in its strings."""
_QUANTITIES = {
    **{"temperature": "degC", "temperatures": "degC", "humidity": "%", "pressure": "kPa", "voltage": "V"},
    **{"voltages": "V", "illuminance": "lux", "acceleration": "m/s^2"},
}
_NEGATED = re.compile(
    r"\b(?:no|not|nor|neither|never|without|unlike|nothing|only|cannot|except|instead)\b", re.IGNORECASE
)
_ACCURATE = re.compile(
    r"\b(?:accura\w+|precis\w+)\b[^.;\n\d]{0,20}(?:±\s*)?(\d+(?:\.\d+)?)|±\s*(\d+(?:\.\d+)?)", re.IGNORECASE
)


def _promised(tool: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, str]]:
    """(what is wrong, the cure) of a tool's description, up to the paragraph for the next stage."""
    probed = {each["id"]: each for each in (artifacts.probe or {}).get("devices", ())}
    if any(speaks_bytes(probed[device]) for device in tool["devices"] if device in probed):
        return  # what is behind a line, PROBE does not show
    texts, units = known_text(tool, artifacts), {row.get("unit") for _, row in listed_of(tool, artifacts)}
    words = tool["description"].partition("Through:")[0]
    first = re.split(r"[.\n]\s", words.strip())[0]
    spoken = set(re.findall(r"[a-z]+", first.casefold())) if not _NEGATED.search(first) else set()
    parts = [each for each in _PARTS_OF_A_HOST.items() if each[0] in spoken]
    found = [word for word, signs in parts if not any(sign in texts for sign in signs)]
    if tool["effect"] == "read" and units and None not in units:
        named = set(tokens(tool["capability"]))
        found += [word for word, unit in _QUANTITIES.items() if word in spoken - named and unit not in units]
    found += [each[0] for each in _ACCURATE.finditer(words) if (each[1] or each[2]) not in texts]
    if found and texts:
        yield f"has {display(found[0])}, and its devices do not", "describe what PROBE and IDENTIFY show of them"


RULES = (Rule("INTERFACE-DESCRIPTION", description),)
