"""Rules for INTERFACE about parameters: none takes a program, and none belongs to another kind of device.

A string that is evaluated is a raw pipe into the server, whatever the tool is called. A volume beside a touch screen's
events changes nothing there, or something that the tool's description does not state.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.pointer import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import tokens
from octoform.diagnostics import Diagnostic, error

_PROGRAM = re.compile(
    r"(?i)\b(?:python|javascript|typescript|lua|perl|ruby|bash|shell|sql|jq|awk|sed|json ?path|xpath|regexp?|regular"
    r"|boolean|arithmetic|filter|lambda|cel|jinja2?|template)\s+"
    r"(?:expressions?|code|scripts?|commands?|programs?|snippets?|statements?|functions?|quer(?:y|ies)|syntax|language)\b"
    r"|\b(?:is|be|gets|are)\s+(?:\w+\s+)?(?:evaluated|executed|interpreted|compiled)\b|\beval(?:uate)?\b|\blambdas?\b"
    r"|\b(?:source|program) code\b|\b(?:code|scripts?|programs?|commands?|statements?)\s+(?:to|that is)\s+"
    r"(?:run|be run|execute|evaluate|send|filter|apply|select)\b|\bexpressions?\s+(?:to|that|which|over|for|by)\b"
    r"|\bregular expressions?\b|\bregexp?\b|\bpredicate\b|\bformula\b"
)
"""Words that state that a string is a program, in whatever language."""
_PROGRAMS = frozenset(
    {"expression", "expr", "lambda", "eval", "predicate", "script", "snippet", "program", "formula"}
    | {"jq", "sql", "regex", "regexp", "jsonpath", "xpath"}
)
"""Words by which the name of a parameter states the same."""
_CHOSEN = frozenset({"enum", "const", "pattern", "format"})

_SOUND = "audio sound speaker mic voice speech tone beep buzz horn siren alarm music song play pcm alsa mixer radio tv"
_LIGHT = "light led lamp display screen backlight bright camera image video picture projector illumin dim flash"
_LIMBS = "servo arm motor joint robot gripper actuator wheel axis stepper winch valve"
_OPTICS = "camera image picture video lens scan photo optic microscope telescope zoom focus projector webcam"
_OF: tuple[tuple[frozenset[str], tuple[str, ...]], ...] = (
    (frozenset({"volume", "loudness", "mute", "muted"}), tuple(_SOUND.split())),
    (frozenset({"brightness", "backlight"}), tuple(_LIGHT.split())),
    (frozenset({"torque", "joint", "servo", "gripper"}), tuple(_LIMBS.split())),
    (frozenset({"zoom", "exposure", "shutter", "iris", "aperture", "fps"}), tuple(_OPTICS.split())),
)
"""Words for a quantity, and parts of the words of which at least one is in the texts of the devices that have it."""
_VOLUMES = re.compile(r"(?i)\b(?:percent|decibels?|db|loud|level)\b|%")


def takes_a_program(tool: JsonObject) -> str | None:
    """The parameter that takes a string which is evaluated; None where there is none."""
    properties = tool["input_schema"].get("properties")
    for name, member in properties.items() if isinstance(properties, dict) else ():
        if not isinstance(member, Mapping) or not any(map(_is_free, _forms(member))):
            continue
        if set(tokens(name)) & _PROGRAMS or _PROGRAM.search(f"{member.get('description', '')}"):
            return str(name)
    return None


def foreign(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A parameter, and each of its choices, belongs to the devices of its tool."""
    return [*_of_another_kind(value, artifacts), *_of_another_device(value, artifacts)]


def _of_another_kind(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A parameter is of the kind of device that the tool has: no volume of a touch screen."""
    out = []
    for index, tool in enumerate(value["tools"]):
        known = _known(tool, artifacts)
        properties = tool["input_schema"].get("properties")
        for name, member in properties.items() if known and isinstance(properties, dict) else ():
            spoken = set(tokens(name))
            text = f"{name.replace('_', ' ')} {member.get('description', '') if isinstance(member, dict) else ''}"
            for words, kinds in _OF:
                own = spoken & words
                if own == {"volume"} and not _VOLUMES.search(text):
                    continue  # that of a liquid or of a disk
                if own and not own & set(re.findall(r"[a-z]+", known)) and not any(kind in known for kind in kinds):
                    summary = f"{display(name)} of {display(tool['name'])} is no matter of its devices"
                    hint = "take it out: no text of IDENTIFY or PROBE about these devices speaks of it"
                    where = pointer("tools", index, "input_schema", "properties", name)
                    out.append(error("INTERFACE-PARAMETER-FOREIGN", summary, pointer=where, hint=hint))
    return out


def _known(tool: JsonObject, artifacts: Artifacts) -> str:
    """What IDENTIFY has of the capability and what it and PROBE have of the devices, in small letters."""
    if artifacts.identify is None:
        return ""
    wanted, found = {*tool["devices"]}, [tool["capability"]]
    for device in artifacts.identify["devices"]:
        if device["id"] in wanted:
            own = [each for each in device["capabilities"] if each["name"] == tool["capability"]]
            found += [device["identified_as"], device.get("class", ""), str(own)]
    for device in (artifacts.probe or {}).get("devices", ()):
        if device["id"] in wanted:
            found += [str(device.get("raw_descriptor", "")), str(device.get("classes", ""))]
    for facts in artifacts.profiles.values():
        found += [str(facts.commands)] if facts.holds & wanted else []
    return "\n".join(found).casefold()


def _forms(member: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    yield member
    for key in ("anyOf", "oneOf"):
        yield from (each for each in member.get(key, ()) if isinstance(each, Mapping))
    if isinstance(member.get("items"), Mapping):
        yield member["items"]


def _is_free(member: Mapping[str, Any]) -> bool:
    """Whether it is a string that may hold anything."""
    kinds = member.get("type")
    return "string" in (kinds if isinstance(kinds, list) else [kinds]) and not _CHOSEN & member.keys()


def _of_another_device(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No choice is the id of a device that the tool does not serve, and none is among the units of others alone."""
    devices = (artifacts.identify or {"devices": []})["devices"]
    units = {each["id"]: set(_units(each)) for each in devices}
    hint = "offer what belongs to the devices of the tool; the others have tools of their own"
    out = []
    for index, tool in enumerate(value["tools"]):
        own = {*tool["devices"]}
        others = set().union(*(names for each, names in units.items() if each not in own))
        mine = "\n".join(strings_of(tool, artifacts)).casefold()
        properties = tool["input_schema"].get("properties")
        for name, member in properties.items() if isinstance(properties, dict) else ():
            given = set(_choices(member)) if name != "device" and isinstance(member, Mapping) else set()
            parts = given if given <= others and not any(each.casefold() in mine for each in given) else set()
            strange = given & units.keys() - own or parts
            if strange:
                summary = (
                    f"{display(name)} of {display(tool['name'])} offers {listed(sorted(strange))}, of another device"
                )
                where = pointer("tools", index, "input_schema", "properties", name)
                out.append(error("INTERFACE-PARAMETER-FOREIGN", summary, pointer=where, hint=hint))
    return out


def strings_of(tool: JsonObject, artifacts: Artifacts) -> Iterator[str]:
    """What PROBE and IDENTIFY have of a tool's devices, as text."""
    for artifact in (artifacts.probe, artifacts.identify):
        for device in (artifact or {}).get("devices", ()):
            if device["id"] in tool["devices"]:
                yield str(device)


def _choices(member: Mapping[str, Any]) -> Iterator[str]:
    for form in _forms(member):
        enum = form.get("enum")
        every = (*(enum if isinstance(enum, list) else ()), form.get("const"))
        yield from (item for item in every if isinstance(item, str))


_SHARED = frozenset(
    {"left", "right", "front", "rear", "back", "top", "bottom", "upper", "lower", "center", "centre"}
    | {"main", "first", "second", "none", "all", "auto", "manual", "on", "off", "high", "low", "normal"}
    | {
        "red",
        "green",
        "blue",
        "white",
        "yellow",
        "orange",
        "amber",
        "cyan",
        "magenta",
        "purple",
        "black",
        "grey",
        "gray",
    }
)
"""Names that a part or a choice of any device may have: places, colours, states."""
_PARTS = frozenset(
    {"lights", "leds", "lamps", "backlights", "panels", "screens", "displays", "indicators", "zones", "channels"}
    | {"inputs", "outputs", "ports", "relays", "switches", "valves", "pumps", "fans", "heaters", "motors", "servos"}
    | {
        "joints",
        "axes",
        "sensors",
        "probes",
        "rails",
        "supplies",
        "slots",
        "drives",
        "lines",
        "pins",
        "keys",
        "controls",
    }
)
"""Words of lists of IDENTIFY whose rows are parts of a device, and not its formats or modes."""


def _units(device: JsonObject) -> Iterator[str]:
    """The names of lights, channels and other parts that IDENTIFY lists of a device, without those of any device."""
    for ability in device["capabilities"]:
        for word, rows in (ability.get("parameters") or {}).items():
            parts = isinstance(rows, list) and not _PARTS.isdisjoint(tokens(word))
            names = (str(row["name"]) for row in rows if isinstance(row, dict) and row.get("name")) if parts else ()
            yield from (name for name in names if not name.isdecimal() and name.casefold() not in _SHARED)


RULES = (Rule("INTERFACE-PARAMETER-FOREIGN", foreign),)
