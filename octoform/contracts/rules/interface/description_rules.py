"""Rules for INTERFACE about descriptions: they are about kinds, name no unit and no place, and order nothing.

A description goes to every model that uses the endpoint and, as part of the artifact, into git.
"""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import speaks_bytes
from octoform.contracts.model import Artifacts, JsonObject, ProfileFacts, Rule
from octoform.contracts.movement_words import unknown_units
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.interface import subject_rules
from octoform.contracts.rules.interface.bound_rules import listed_of
from octoform.contracts.rules.interface.member_units import is_unit
from octoform.contracts.rules.interface.subject_rules import known_text
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

_INSTANCE = {
    "a hardware address": regex(r"\b[0-9a-f]{2}(?:[:-][0-9a-f]{2}){5}\b", re.IGNORECASE),
    "a place of a device": regex(r"(?<![\w/])/(?:dev|sys)/\w[\w/.:-]*"),
    "a port of a bus": regex(r"\b(?:usb|port|bus)\s+\d+-\d+(?:\.\d+)*\b", re.IGNORECASE),
    "a serial number": regex(
        r"\bserial (?:number|no\.?)\s*[:=]?\s*(?=[A-Z0-9-]*\d)[A-Z0-9][A-Z0-9-]{4,}\b", re.IGNORECASE
    ),
}
_ORDERS = regex(
    r"\b(?:ignore|disregard|forget|override)\s+(?:\w+\s+){0,3}?(?:instructions?|prompts?|rules)\b"
    r"|<\s*/?\s*(?:system|assistant|user|instructions?|important)\s*>|(?:^|\n)\s*(?:system|assistant)\s*:"
    r"|\balways (?:call|use|run|invoke) (?:this|it)\b|\b(?:before|instead of) (?:any|every|all) others?\b"
    r"|\byou are now\b|\breveal (?:your|the) (?:system )?prompt\b|\bdo not (?:tell|inform) the user\b",
    re.IGNORECASE,
)
_OPEN = regex(r"\b(?:TODO|FIXME|TBD|TBA|lorem ipsum)\b|\bdescribe this tool\b")
_DEMANDS = regex(
    r"\byou (?:must|have to|need to) (?:(?:always|first|then|also|never|again|please) ){0,2}"
    r"(?:call|use|run|execute|invoke)\b",
    re.IGNORECASE,
)
_CALLS = regex(
    r"\b(?:(?:[Cc]all|[Ii]nvoke|[Ee]xecute|[Rr]un)\s+(?:the\s+)?(?:tool\s+)?|[Uu]se\s+the\s+tool\s+)"
    r"[`'\"]?([a-zA-Z][a-zA-Z0-9]*(?:[_.][a-zA-Z0-9]+)+)\b"
)
"""An order to call something whose name can only be that of a tool."""
_SENDS_AWAY = regex(
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
        problems = (
            *subject_rules.problems(tool, artifacts),
            *_promised(tool, artifacts),
            *_contradicted(tool, artifacts),
        )
        for what, hint in problems:
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
_NEGATED = regex(r"\b(?:no|not|nor|neither|never|without|unlike|nothing|only|cannot|except|instead)\b", re.IGNORECASE)
_ACCURATE = regex(
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


# What a description contradicts: the schema of its tool, its effect and the numbers of its devices.

_RANGE = regex(
    r"(?<![\w.,-])([-\u2212]?\d+(?:\.\d+)?) ?(?:%|percent)? ?(?:to|and|\.\.+|\u2013|-) ?"
    r"([-\u2212+]?\d+(?:\.\d+)?)(?![\w-]*\d)(?: ?(%|[a-zA-Z]+))?"
)
_UP_TO = regex(
    r"(?i)\b(?:at most|up to|no (?:more|longer) than|not more than|maximum(?: of| is)?|max\.?)\s+"
    r"(\d+(?:\.\d+)?)(?: ?([a-z]+))?"
)
_DEFAULT = regex(r"(?i)\bdefaults?\b(?:\s+(?:is|to|of|value))*\W{0,3}(-?\d+(?:\.\d+)?)(?![\w.]*\d)")
_ASIDE = regex(
    r"(?i)\b(?:raw|levels?|kernel|counts?|ticks|driver|hardware|internal\w*|nominal\w*|usual\w*|typical\w*|normal\w*"
    r"|recommended|such as|e\.g|for example|comfort\w*|safe\w*|takes|lasts|about|roughly|scaled?|mapped|means?|some)\b"
)
"""Words by which a number is no bound of an argument."""
_DURATIONS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "milliseconds"), 0.001),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
}
_WAITS = frozenset({"seconds", "timeout", "wait", "duration", "ms", "milliseconds", "minutes", "s", "max", "longest"})
"""Words of a parameter that is how long a whole call lasts; `tone_seconds` is a part of one."""
_NUMBER_WORDS = ("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_COUNTED = {word: number for number, word in enumerate(_NUMBER_WORDS, 2)}
_PARTS = regex(
    rf"(?i)\b(\d+|{'|'.join(_COUNTED)}) (?:joints|axes|channels|relays|fans|motors|servos|zones|cores|megapixels?"
    r"|mp|fps|frames per second|dpi|lumens|[mg]hz)\b"
)
_ONLY_READS = regex(
    r"(?i)(?:^|[.;]\s*|\bit |\bthis |\btool )(?:is |it |this |tool )*(?:read-only\b|only reads\b|reads only\b"
    r"|(?:changes nothing|(?:does not|never) changes? anything)\b(?! (?:else|further|more|other|of|in|on)\b)"
    r"|(?:is )?without (?:any )?effect)"
)
_READS_FIRST = regex(r"(?i)^\W*(?:reads?|measures?|lists?|monitors?)\s+(?:the|an?|its|one|all|each|every)\b")
_FOR_GOOD = regex(
    r"(?i)\b(?:cannot|can not|can't|can never) be (?:undone|restored|recovered|reversed|brought back)\b"
    r"|\birreversibl[ey]\b|\b(?:lost|gone|erased|destroyed) (?:for good|for ever|permanently)\b"
)
_BY_STEPS = regex(
    r"(?i)^\W*(?:raise|lower|increase|decrease|add|advance|step|turn|move|shift)s?\b[^.;\n]*"
    r"\b(?:each|every) (?:time|call)\b"
)
_ANY_UNIT = regex(r'"units?": \{"type": "string"(?:, "(?:title|description)": "[^"]*")*\}')
"""A member of the result that states the unit of each value."""
_FROM = regex(r"(?i)\b(?:from|between)\s$")
_BAUD = regex(r"(?i)(?<![\d.,])(\d{3,7}) ?(?:baud|bd)\b")
_BARE_NUMBER = regex(r"-?\d+(?:\.\d+)?")


def _contradicted(tool: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, str]]:
    """(what is wrong, the cure) of a description that its own tool contradicts."""
    held = [facts for facts in artifacts.profiles.values() if not facts.holds.isdisjoint(tool["devices"])]
    text = tool["description"].partition("Through:")[0]
    own = json.dumps([tool["input_schema"], tool.get("output_schema"), tool.get("limits"), tool.get("units")])
    known = f"{own.casefold()}\n{known_text(tool, artifacts)}"
    if (units := unknown_units(text, known)) and not _ANY_UNIT.search(own):
        yield f"has {listed(units)}, which is no unit of its arguments, its result or its devices", _SAME_UNIT
    if found := _effect_denied(tool, text, held):
        yield f"has {display(found[0])}, and its effect is {tool['effect']}", found[1]
    for found_at in _PARTS.finditer(text):
        number = _COUNTED.get(found_at[1].casefold(), found_at[1])
        if not re.search(rf"(?<![\d.]){number}(?![\d]|\.\d)", known):
            yield f"has {display(found_at[0])}, which no text of its devices has", "describe what IDENTIFY has of them"
            break
    described = held or not artifacts.answers.keys().isdisjoint(tool["devices"])
    for rate in _BAUD.findall(tool["description"]) if described else ():
        if rate not in known and not any(rate in str(facts.grammar) for facts in held):
            yield f"has {rate} baud, which neither IDENTIFY nor a profile nor an answer has", "write IDENTIFY's speed"
    numbers = {float(each) for each in _BARE_NUMBER.findall(own)}
    yield from _beyond_schema(tool, text, numbers, own)
    for name, member in _numbers_of(tool):
        if what := _bound_differs(str(member.get("description", "")), member):
            yield f"is about {display(name)}, whose own description has {what}", _SAME_BOUND


_SAME_UNIT = "write the unit of the schema: the caller gives and gets its numbers"
_SAME_BOUND = "write minimum, maximum and default of the schema, or leave the numbers to it"


def _numbers_of(tool: JsonObject) -> list[tuple[str, JsonObject]]:
    properties = tool["input_schema"].get("properties")
    found = properties.items() if isinstance(properties, dict) else ()
    return [
        (name, each) for name, each in found if isinstance(each, dict) and each.get("type") in ("number", "integer")
    ]


def _bound_differs(text: str, member: JsonObject) -> str | None:
    """The number in the description of a parameter that its schema does not take, or takes otherwise."""
    low, high, given = member.get("minimum"), member.get("maximum"), member.get("default")
    default = _DEFAULT.search(text)
    if default and isinstance(given, int | float) and float(default[1]) != given:
        return f"the default {default[1]}, and {given:g} is its default"
    if not isinstance(low, int | float) or not isinstance(high, int | float) or _ASIDE.search(text):
        return None
    ranges = [each for each in _RANGE.finditer(text) if (each[3] or "").casefold() not in _DURATIONS]
    wide = [each for each in ranges if _float(each[1]) < low or _float(each[2]) > high]
    if wide and len(wide) == len(ranges):
        return f"{display(wide[0][0])}, and its schema {low:g} to {high:g}"
    most = next((each for each in _UP_TO.finditer(text) if (each[2] or "").casefold() not in _DURATIONS), None)
    return f"{display(most[0])}, and its schema at most {high:g}" if most and float(most[1]) > high else None


def _beyond_schema(tool: JsonObject, text: str, numbers: set[float], own: str) -> Iterator[tuple[str, str]]:
    """A range of what acts, a wait and a number of things that the arguments of a tool do not take."""
    members = _numbers_of(tool)
    for sentence in re.split(r"(?<=[.;])\s|\n", text) if members else ():
        for most in _UP_TO.finditer(sentence):
            number, unit = float(most[1]), (most[2] or "").casefold()
            scale = _DURATIONS.get(unit)
            asked = [
                _plain(each.get("maximum")) * (0.001 if {"ms", "milliseconds"} & set(tokens(name)) else 1)
                for name, each in members
                if (set(tokens(name)) <= _WAITS if scale else unit in tokens(name))
            ]
            if asked and number * (scale or 1) > max(asked) and not _ASIDE.search(sentence):
                yield f"has {display(most[0])}, and its arguments take no more than {max(asked):g}", _SAME_BOUND
        for found in _RANGE.finditer(sentence) if tool["effect"] != "read" and not _ASIDE.search(sentence) else ():
            unit = (found[3] or "").casefold()
            other = unit in _DURATIONS or (is_unit(unit) and unit not in own.casefold())
            low, high = _float(found[1]), _float(found[2])
            part = not _FROM.search(sentence[: found.start()]) and any(_holds(each, low, high) for _, each in members)
            if low < high and not other and not part and not {low, high} <= numbers:
                yield f"has {display(found[0])}, which is no range of its schema", _SAME_BOUND
                return


def _effect_denied(tool: JsonObject, text: str, held: list[ProfileFacts]) -> tuple[str, str] | None:
    """(the words, the cure) by which a description has another effect than its tool."""
    acts = tool["effect"] != "read"
    if acts and (found := _ONLY_READS.search(text) or _READS_FIRST.search(text)):
        return found[0].strip(" .;"), "describe what it changes"
    final = None if held or tool["effect"] != "actuate" else _FOR_GOOD.search(text)  # a profile states its effects
    if (found := final) and not _NEGATED.search(text[: found.start()]):
        return found[0], "what a second call cannot undo is irreversible, in IDENTIFY first (`identify_errors`)"
    if acts and tool["annotations"]["idempotentHint"] and (found := _BY_STEPS.search(text)):
        return found[0].strip(" .;"), "idempotentHint is false where a second identical call changes something further"
    return None


def _holds(member: JsonObject, low: float, high: float) -> bool:
    """Whether a range is a part of that of a parameter: "1 to 10 is hardly seen"."""
    least, most = member.get("minimum"), member.get("maximum")
    return isinstance(least, int | float) and isinstance(most, int | float) and least <= low and high <= most


def _plain(number: Any) -> float:
    return float(number) if isinstance(number, int | float) else math.inf


def _float(text: str) -> float:
    return float(text.replace("\u2212", "-"))


RULES = (Rule("INTERFACE-DESCRIPTION", description),)
