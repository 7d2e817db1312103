"""Rules for INTERFACE about parameters: none is a program or of another device, and results hold what they ask.

A string that is evaluated is a raw pipe into the server, whatever the tool is called. A volume beside a touch screen's
events changes nothing there, or something that the tool's description does not state. A default that is no choice
cannot be given, and a result that has no room for what a call asked for fails each such call.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import changes, tokens
from octoform.contracts.name_words import word_set
from octoform.contracts.rules.raw_line_rules import lines_answered, lines_without_knowledge
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

_PROGRAM = regex(
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
_TINTED = "rgb colour color hue multi tint print display screen monitor"
_SPUN = "fan rpm motor spindle pump pwm disk cooling turntable stepper"
_OPTICS = "camera image picture video lens scan photo optic microscope telescope zoom focus projector webcam"
_OF: tuple[tuple[frozenset[str], tuple[str, ...]], ...] = (
    (frozenset({"volume", "loudness", "mute", "muted"}), tuple(_SOUND.split())),
    (frozenset({"brightness", "backlight"}), tuple(_LIGHT.split())),
    (frozenset({"torque", "joint", "servo", "gripper"}), tuple(_LIMBS.split())),
    (frozenset({"zoom", "exposure", "shutter", "iris", "aperture", "fps"}), tuple(_OPTICS.split())),
    (
        frozenset({"colour", "color", "hue", "saturation", "rgb", "red", "green", "blue"}),
        (*_TINTED.split(), *_OPTICS.split()),
    ),
    (frozenset({"baud", "baudrate", "parity"}), ("tty", "serial", "uart", "baud", "modem", "gnss")),
    (frozenset({"fan", "rpm"}), tuple(_SPUN.split())),
    (frozenset({"gain"}), (*_SOUND.split(), *_OPTICS.split(), "adc", "sdr", "amplif", "iio", "sensor", "scale")),
    (frozenset({"pan", "yaw"}), ("ptz", "gimbal", "rotat", "imu", "gyro", *_LIMBS.split())),
)
"""Words for a quantity, and parts of the words of which at least one is in the texts of the devices that have it."""
_VOLUMES = regex(r"(?i)\b(?:percent|decibels?|db|loud|level)\b|%")


_WHOLE = frozenset(
    {"width", "height", "seconds", "duration", "timeout", "wait", "samples", "count", "frames", "flush", "repeats"}
    | {"repetitions", "events", "readings", "bytes", "pixels", "fps", "milliseconds", "minutes"}
)
"""Words for sizes, counts and waits, of which there is no less than none."""
_DIFFERENCE = regex(r"(?i)change|relative|offset|delta|adjust|differ|shift|correct|negative|before|ago")
_JSON: dict[str, tuple[type, ...]] = {
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "array": (list,),
    "object": (dict,),
}


def unfit(name: str, member: Mapping[str, Any]) -> str | None:
    """Why a choice or a default cannot be given, or a range reaches below nothing; None where neither is so."""
    choices, given, low = member.get("enum"), member.get("default"), member.get("minimum")
    if isinstance(choices, list):
        if not choices:
            return "offers no choice at all"
        if strange := [each for each in choices if not _is_of_type(each, member)]:
            return f"offers {display(str(strange[0]))}, which is not of the type {display(str(member['type']))}"
        if given is not None and given not in choices:
            return f"has the default {display(str(given))}, which is none of its choices"
    if not _is_of_type(given, member):
        return f"has the default {display(str(given))}, which is not of the type {display(str(member['type']))}"
    below = isinstance(low, int | float) and low < 0 and bool(set(tokens(name)) & _WHOLE)
    if below and not _DIFFERENCE.search(f"{name} {member.get('description', '')}"):
        return f"reaches {low:g} of what there is no less than none of"
    return None


def _is_of_type(given: Any, member: Mapping[str, Any]) -> bool:
    """Whether a value is of the type that a parameter declares; null stands for none given."""
    kinds = member.get("type")
    wanted = tuple(one for kind in (kinds if isinstance(kinds, list) else [kinds]) for one in _JSON.get(str(kind), ()))
    if given is None or not wanted:
        return True
    whole = isinstance(given, float) and given.is_integer() and int in wanted
    return whole or (isinstance(given, wanted) and (not isinstance(given, bool) or bool in wanted))


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
    kinds = [*_of_another_kind(value, artifacts), *_of_another_device(value, artifacts)]
    return [*kinds, *_of_no_reading(value, artifacts), *_of_no_answer(value, artifacts)]


_GENERAL = frozenset(
    {"on", "off", "state", "value", "level", "percent", "percentage", "number", "index", "id", "device", "unit", "mode"}
    | {"seconds", "timeout", "wait", "duration", "enabled", "direction", "power", "count", "name", "amount", "ms"}
    | {"position", "angle", "steps", "degrees", "distance", "x", "y", "z"}
)
"""Words for what anything that acts may take."""
_ALIKE = frozenset({"channel", "output", "line", "port", "relay", "outlet"})
_SEVERAL = regex(
    r"(?i)\b(?:relays?|channels?|outputs?|outlets?|sockets?)\b|\b(?:\d+|two|three|four|six|eight)[ -][a-z]+s\b"
)


def _of_no_answer(value: JsonObject, artifacts: Artifacts) -> Iterator[Diagnostic]:
    """Where a tool acts on a raw line by an answer, each parameter has a word of the answer or of its capability."""
    answered = lines_answered(artifacts.identify, artifacts)
    known = {
        device["id"]: word_set([answered[device["id"]], str(device)])
        for device in (artifacts.identify or {"devices": []})["devices"]
        if device["id"] in answered
    }
    for index, tool in enumerate(value["tools"] if known else ()):
        device = next((each for each in tool["devices"] if each in known), None)
        properties = tool["input_schema"].get("properties")
        if device is None or tool["effect"] == "read" or not isinstance(properties, dict):
            continue
        for name in properties:
            own = set(tokens(name)) - _GENERAL
            several = own <= _ALIKE and _SEVERAL.search(answered[device])
            if own and known[device].isdisjoint(own) and not several:
                where = pointer("tools", index, "input_schema", "properties", name)
                summary = f"{display(name)} of {display(tool['name'])} is in no word of the owner's answer about "
                summary += f"{display(device)}: {display(answered[device])}"
                hint = f'take it out; for its owner alone: `octoform answer {device} "..."` records more'
                yield error("INTERFACE-PARAMETER-FOREIGN", summary, pointer=where, hint=hint)


_GOALS = frozenset({"setpoint", "goal"})
_SECRETS = frozenset({"password", "passwd", "passphrase", "secret", "credential", "credentials", "sudo", "superuser"})
_NOUNS = frozenset({"zero", "home", "press", "lower", "print", "program", "feed", "fire", "play", "format", "mount"})
"""Verbs that are nouns or adjectives in the name of a switch: `home_only`, `zero_based`."""
_HOSTED = frozenset({"camera", "webcam", "video", "card", "device"})
_NUMBERED = frozenset({"index", "number", "idx", "no", "nr"})


def _of_no_reading(value: JsonObject, artifacts: Artifacts) -> Iterator[Diagnostic]:
    """A parameter of a reading that a reading has no use for, and a number in the place of `device`."""
    unknown = lines_without_knowledge(artifacts)  # of which INTERFACE-READ-MOVES reports a goal
    for index, tool in enumerate(value["tools"]):
        properties = tool["input_schema"].get("properties")
        for name, member in properties.items() if isinstance(properties, dict) else ():
            spoken, reads = set(tokens(name)), tool["effect"] == "read"
            switch = isinstance(member, dict) and member.get("type") == "boolean"
            if reads and spoken & _GOALS and unknown.isdisjoint(tool["devices"]):
                why, hint = "is a goal, and the tool reads", "what sets a goal acts, in a tool of that effect"
            elif reads and (spoken & _SECRETS or {"as", "root"} <= spoken):
                why, hint = (
                    "is a credential or a right",
                    "the server reads with its own rights",
                )
            elif reads and switch and (verb := changes(name, "")) and verb not in _NOUNS:
                why, hint = (
                    f"switches something by {display(verb)}",
                    "what changes something acts, in a tool of that effect",
                )
            elif spoken & _HOSTED and spoken & _NUMBERED and len(spoken) == 2:
                why, hint = "chooses a device of the host by a number", "a device is chosen by `device`, by its id"
            else:
                continue
            where = pointer("tools", index, "input_schema", "properties", name)
            summary = f"{display(name)} of {display(tool['name'])} {why}"
            yield error("INTERFACE-PARAMETER-FOREIGN", summary, pointer=where, hint=f"take it out: {hint}")


_LASTED = frozenset({"waited", "elapsed", "recorded", "lasted", "took"})
_LASTS = frozenset({"seconds", "duration", "timeout", "wait"})


def result_narrow(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A result holds each value that a call can ask for: its choices, its range, its number of parts, its devices."""
    out = []
    for index, tool in enumerate(value["tools"]):
        schema = tool.get("output_schema")
        members = schema.get("properties") if isinstance(schema, dict) else None
        for name, member in members.items() if isinstance(members, dict) else ():
            if isinstance(member, dict) and (why := _narrower(str(name), member, tool)):
                summary = f"the result's {display(name)} of {display(tool['name'])} {why}"
                where = pointer("tools", index, "output_schema", "properties", name)
                hint = "let the result hold each value that a call can ask for, or narrow the parameter to it"
                out.append(error("INTERFACE-RESULT-NARROW", summary, pointer=where, hint=hint))
    return out


def _narrower(name: str, member: JsonObject, tool: JsonObject) -> str | None:
    """What a member of a result cannot hold of what the parameter of its name takes; None where it holds all."""
    properties = tool["input_schema"].get("properties")
    given = properties.get(name) if isinstance(properties, dict) else None
    has, asked = set(_choices(member)), set(_choices(given)) if isinstance(given, dict) else set()
    lacks = sorted((set(tool["devices"]) if name == "device" else asked) - has) if has else []
    most, least = member.get("maximum"), member.get("minimum")
    lacks = [each for each in lacks if not each.isdecimal()]  # a number is another word for a part with a name
    if lacks:
        return f"does not hold {listed(lacks)}"
    if member.get("maxItems") == 0:
        return "holds nothing"
    if set(tokens(name)) & _LASTED and isinstance(properties, dict):
        waits = [each for key, each in properties.items() if isinstance(each, dict) and set(tokens(key)) & _LASTS]
        given = max(waits, key=lambda each: _plain(each.get("maximum"), 0.0), default=None)
    if not isinstance(given, dict):
        return None
    asked_most, asked_least = _plain(given.get("maximum"), -math.inf), _plain(given.get("minimum"), math.inf)
    if asked_most > _plain(most, math.inf) or asked_most > _plain(member.get("maxItems"), math.inf):
        return f"does not hold {asked_most:g}, for which a call may ask"
    if asked_least < _plain(least, -math.inf) and not set(tokens(name)) & _LASTED:
        return f"does not hold {asked_least:g}, for which a call may ask"
    return None


def _plain(number: Any, other: float) -> float:
    return float(number) if isinstance(number, int | float) and not isinstance(number, bool) else other


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


RULES = (Rule("INTERFACE-PARAMETER-FOREIGN", foreign), Rule("INTERFACE-RESULT-NARROW", result_narrow))
