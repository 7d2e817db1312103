"""Which members of a tool's result are quantities, and whether the schema states in which unit they are.

A number is held against what can be measured in its unit. Without one, 53125 may be a temperature as well as a count.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, escaped
from octoform.base.quantities import unit_in, unit_of_name, unit_of_text
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, effects_of
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.interface.subject_rules import known_text
from octoform.diagnostics import Diagnostic, error, warning
from octoform.patterns import regex

_QUANTITIES = frozenset(
    {"temperature", "temp", "humidity", "pressure", "voltage", "illuminance", "lux", "distance", "altitude"}
    | {"acceleration", "velocity", "frequency", "weight", "mass", "energy", "latitude", "longitude", "resistance"}
    | {"capacitance", "amperage", "wattage", "dewpoint", "speed", "angle", "heading", "duration", "elapsed"}
)
_LAST = frozenset({"size", "power", "current", "acceleration", "flow", "torque", "force"})
"""Words that are a quantity where a name ends in them: `current_frame` is none."""
_ASIDE = frozenset(
    {"index", "count", "counts", "id", "channel", "channels", "number", "raw", "samples", "step", "steps", "ticks"}
    | {"ratio", "scale", "factor", "code", "level", "levels", "class", "mode", "grade", "time", "timestamp", "errors"}
)
"""Words of a name that make something else of a quantity, or say that it has no unit."""
_FLAGS = frozenset(
    {"ok", "success", "successful", "succeeded", "message", "msg", "error", "errors", "detail", "device", "device_id"}
    | {"requested_device", "requested", "timestamp", "time", "note", "info"}
)
"""Members about a call, and not about what was read."""
_ELSEWHERE = frozenset({"base64", "b64", "path", "filepath", "filename", "url", "uri"})
_RECORDED = frozenset({"image", "picture", "photo", "frame", "snapshot", "audio", "sound", "video", "clip"})
_UNIT_WORDS = """
    c f k v mv uv kv a ma ua w mw kw hz khz mhz ghz s ms us ns m mm cm km um nm g kg mg n pa hpa kpa mpa bar
    mbar psi lx lm cd db dbm dbi rh ppm ppb ohm pf nf uf h j wh kwh mah ah cel deg rad rpm rps mps kmh mph kn
    dps pct degc degf celsius fahrenheit kelvin volt volts millivolts amp amps ampere amperes milliamperes watt
    watts hertz second seconds milliseconds minutes hours meter meters metre metres millimeters millimetres
    centimeters centimetres kilometers feet inch inches gram grams kilogram kilograms newton newtons pascal
    pascals hectopascal hectopascals kilopascal kilopascals lux lumen decibel decibels percent percentage degree
    degrees radian radians joule joules ohms farad picofarads microseconds nanoseconds knots bits bytes
    microtesla gauss tesla ut mt millig micrometers milligrams microamperes microvolts megahertz kilohertz
    gigahertz milliwatts kilowatts ticks raw counts steps unitless dimensionless fraction ratio unit units lsb
    baud mbps kbps gbps mbit rev revolutions turns millidegrees permille ppt pixel pixels px lb lbs oz
"""
_UNITS = frozenset(_UNIT_WORDS.split())
_SIGNS = regex(
    r"[°%‰Ωµμ²³]|\b(?:m/s|rad/s|km/h|1/s|m/s\^2|n·m|w/m|kg/m)|\b0(?:\.0)? (?:to|\.\.) ?1(?:\.0)?\b", re.IGNORECASE
)
_LETTER = regex(r"(?:\bin|[,(\[/:;])\s*(?:[CFKVAWNgmshJ])(?![\w-])")
_BESIDE = frozenset({"unit", "units"})


def read_nothing(capability: str, schema: Any) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, why) of what makes a result of a reading none: no member that was read, or one that cannot be used."""
    members = schema.get("properties") if isinstance(schema, Mapping) else None
    if not isinstance(members, Mapping):
        return
    spoken = set(tokens(capability))
    flags = _FLAGS if spoken & _ABOUT_FLAGS else _FLAGS | _ONLY_THERE
    if {str(name).casefold() for name in members} <= flags and members:
        yield (), "reports how the call went, and nothing that was read"
    for place, name in _as_text(schema):
        yield place, f"has the quantity {name} as a string"
    for name, member in members.items():
        kinds = _kinds(member)
        quantity = bool(set(tokens(str(name))) & _QUANTITIES) and not _ASIDE & set(tokens(str(name)))
        place = ("properties", str(name))
        if isinstance(member, Mapping) and not member.keys() - {"description", "title", "default", "examples"}:
            yield place, f"has the member {name} of any type"
        elif kinds and kinds <= {"integer", "number", "boolean"} and str(name) in _LISTED and name in spoken:
            yield place, f"reports how many {name} there are, and not which"
        elif kinds == {"string"} and quantity and "enum" not in member and not _has_unit(str(name)):
            yield place, f"has the quantity {name} as a string"
        elif "string" in kinds and set(tokens(str(name))[-1:]) & _ELSEWHERE and set(tokens(capability)) & _RECORDED:
            yield place, f"has a picture or a sound as {name}, and not as content"


_ONLY_THERE = frozenset({"count", "total", "attached", "present", "available", "connected"})
_ABOUT_FLAGS = frozenset({"presence", "present", "attached", "availability", "connected", "connection", "count"})
_ABOUT_FLAGS |= {"counts", "counter", "number", "total", "status", "state", "available", "pulses"}
"""Words of a capability that asks for no more than such a member."""
_LISTED = frozenset({"events", "formats", "devices", "files", "partitions", "networks", "interfaces", "channels"})
_LISTED |= {"ports", "lines", "sensors", "disks", "displays", "connectors", "modes", "inputs"}
_WRITTEN = frozenset({"bytes", "seconds", "hz", "px", "pixels"})


def _has_unit(name: str) -> bool:
    return unit_of_name(name) is not None or name.casefold().rpartition("_")[2] in _WRITTEN


def _as_text(schema: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, name) of each string that is a number by the unit in its name or beside it, at any depth."""
    members = schema.get("properties") if isinstance(schema, Mapping) else None
    if not isinstance(members, Mapping):
        members = {}
    for name, member in members.items():
        place = (*where, "properties", str(name))
        number = _has_unit(str(name)) or (name == "value" and not _BESIDE.isdisjoint(members))
        if number and _kinds(member) == {"string"} and not {"enum", "const"} & member.keys():
            yield place, str(name)
        yield from _as_text(member, place)
    if isinstance(schema, Mapping):
        yield from _as_text(schema.get("items"), (*where, "items"))


_HEAT = frozenset({"temperature", "temp", "dewpoint"})
_LETTERS: dict[str, tuple[str, frozenset[str]]] = {
    "c": ("degC", _HEAT),
    "f": ("degF", _HEAT),
    "k": ("K", _HEAT),
    "v": ("V", frozenset({"voltage", "supply"}) | _HEAT),
    "mv": ("mV", frozenset({"voltage", "supply"}) | _HEAT),
    "ma": ("mA", frozenset({"current"})),
    "mw": ("mW", frozenset({"power"})),
    "mc": ("mdegC", _HEAT),
    "mdegc": ("mdegC", _HEAT),
}
"""Short units at the end of a name, each with the quantities beside which they are one: `phase_c` is none."""
_SCALED: dict[str, str] = {
    **dict.fromkeys(("millivolt", "millivolts"), "mV"),
    **dict.fromkeys(("microvolt", "microvolts"), "uV"),
    **dict.fromkeys(("milliamp", "milliamps", "milliampere", "milliamperes"), "mA"),
    **dict.fromkeys(("milliwatt", "milliwatts"), "mW"),
    **dict.fromkeys(("microwatt", "microwatts"), "uW"),
    **dict.fromkeys(("millidegree", "millidegrees"), "mdegC"),
    **dict.fromkeys(("kilovolt", "kilovolts"), "kV"),
}
"""Units of which a whole one is in `octoform.base.quantities`."""
_SIZES = {
    f"{prefix}byte{plural}": f"{prefix}byte" for prefix in ("", "kilo", "mega", "giga", "tera") for plural in ("", "s")
}
_TIMES = {
    f"{prefix}second{plural}": f"{prefix}second" for prefix in ("", "milli", "micro", "nano") for plural in ("", "s")
}
_SHORT_TIMES = {"s": "second", "sec": "second", "secs": "second", "ms": "millisecond", "us": "microsecond"}
_MILLI_OF = regex(r"(?:millidegrees?|thousandths? of (?:a )?degrees?) (?:c|celsius)\b")


def _disagree(name: str, description: Any) -> bool:
    """Whether the description gives the number units, and that of its name is none of them."""
    text = _MILLI_OF.sub("millidegrees", description.casefold()) if isinstance(description, str) else ""
    lines = [each[1] for each in re.finditer(r"(?<![\d.])(?<!\d )([a-z]+)", text)]
    parts, last = tokens(name), name.casefold().rpartition("_")[2]
    for table in (_SIZES, _TIMES):
        own_size = table.get(last) or (_SHORT_TIMES.get(last) if table is _TIMES and len(parts) > 1 else None)
        if own_size is not None:
            other = {table[word] for word in lines if word in table}
            return bool(other) and own_size not in other
    letter = _LETTERS.get(last)
    own = _SCALED.get(last) or (letter[0] if letter and letter[1].intersection(parts) else unit_of_name(name))
    whole = unit_in(text)
    names = {_SCALED[word] for word in lines if word in _SCALED} | ({whole} if whole is not None else set())
    names |= {each[1] for each in _STATED.finditer(description if isinstance(description, str) else "")}
    return own is not None and bool(names) and own not in names


_STATED = regex(r"\b[Ii]n ((?:[mµuk]?[VAW]))\b(?!-)")
_SHARE = regex(r"(?<![\d.])0(?:\.0+)? ?(?:to|\.\.+|-|–) ?1(?:\.0+)?(?![\d.]\d|\d|%| percent)|\bfraction\b")
_ENDS_OF_BITS = frozenset({255, 1023, 4095, 65535})
"""Where a raw value ends, and no percentage."""
_PERCENT = frozenset({"percent", "percentage", "pct"})
_OFF, _ON = frozenset({"off", "disable", "disabled"}), frozenset({"on", "enable", "enabled"})


def _is_other_share(name: str, member: Mapping[str, Any]) -> bool:
    """Whether a percentage is a fraction by its words or its range, or a fraction a percentage."""
    spoken, words, most = set(tokens(name)), str(member.get("description", "")).casefold(), member.get("maximum")
    number = most if isinstance(most, int | float) and not isinstance(most, bool) else None
    if spoken & _PERCENT:
        wide = number is None or number > 1
        return (
            bool(_SHARE.search(words))
            or number in _ENDS_OF_BITS
            or (not wide and member.get("minimum") == 0 and not _states_a_bound(words))
        )
    return "fraction" in spoken and number is not None and number > 1


def _states_a_bound(words: str) -> bool:
    """Whether a percentage of at most one is meant, since the words state how far it goes."""
    return "at most" in words or "up to" in words


def _is_reversed(name: str, description: Any) -> bool:
    """Whether a switch is called off and its words call it on where it is true, or the other way round."""
    found = re.search(r"\btrue\b[^.;,]{0,30}?\b(on|enables?|off|disables?)\b", str(description or "").casefold())
    spoken = set(tokens(name))
    if found is None or re.search(r"\b(?:not|no|never)\b", found[0]) or bool(spoken & _OFF) is bool(spoken & _ON):
        return False
    return bool(spoken & _OFF) is found[1].startswith(("on", "enable"))


def _contradicted(name: str, member: Any) -> str | None:
    """What the name of a member contradicts: "unit" for a number, "sense" for a switch, None for nothing."""
    description = member.get("description") if isinstance(member, Mapping) else None
    if _is_number(member):
        whole = unit_of_text(description)  # a description that is a unit and nothing else, however short
        other = whole is not None and (own := unit_of_name(name)) is not None and own != whole
        return "unit" if other or _disagree(name, description) or _is_other_share(name, member) else None
    switch = isinstance(member, Mapping) and member.get("type") == "boolean"
    return "sense" if switch and _is_reversed(name, description) else None


def unit_against_name(schema: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """(place, name, unit or sense) of each member whose description or range contradicts its name, at any depth."""
    if not isinstance(schema, Mapping):
        return
    members = schema.get("properties")
    for name, member in members.items() if isinstance(members, Mapping) else ():
        place = (*where, "properties", str(name))
        if what := _contradicted(str(name), member):
            yield place, str(name), what
        yield from unit_against_name(member, place)
    for part in ("items", "additionalProperties"):
        yield from unit_against_name(schema.get(part), (*where, part))


_UNITS_OF: dict[str, frozenset[str]] = {
    **dict.fromkeys(_HEAT, frozenset({"degC", "degF", "K"})),
    **dict.fromkeys(("humidity",), frozenset({"%"})),
    **dict.fromkeys(("voltage",), frozenset({"V"})),
    **dict.fromkeys(("amperage",), frozenset({"A"})),
    **dict.fromkeys(("wattage",), frozenset({"W"})),
    **dict.fromkeys(("pressure",), frozenset({"kPa", "hPa"})),
    **dict.fromkeys(("illuminance",), frozenset({"lux"})),
    **dict.fromkeys(("brightness",), frozenset({"%", "lux"})),
}
"""The units of `octoform.base.quantities` in which a quantity can be."""


def is_unit(word: str) -> bool:
    """Whether a word is a unit of some quantity."""
    return word in _UNITS


def units_of_quantity(capability: str) -> frozenset[str]:
    """The units in which what a capability names last can be; empty where it names no quantity of one kind."""
    return _UNITS_OF.get((tokens(capability) or [""])[-1], frozenset())


def unit_of_another(name: str, description: Any) -> str | None:
    """The one unit of a description in which the quantity that a name ends in cannot be; None where there is none."""
    possible, found = _UNITS_OF.get((tokens(name) or [""])[-1]), unit_in(description)
    return found if possible is not None and found is not None and found not in possible else None


def _kinds(member: Any) -> set[str]:
    forms = [member, *member.get("anyOf", ())] if isinstance(member, Mapping) else []
    kinds = [each.get("type") for each in forms if isinstance(each, Mapping)]
    return {str(one) for kind in kinds if kind for one in (kind if isinstance(kind, list) else [kind])} - {"null"}


def measured_without_unit(
    schema: Any, where: tuple[str, ...] = (), said: str = ""
) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, name) of each number that is a quantity by its name and has no unit, at any depth."""
    if not isinstance(schema, Mapping):
        return
    text = f"{said} {schema.get('description', '')}"
    members = schema.get("properties")
    if isinstance(members, Mapping):
        beside = any(set(tokens(str(name))) & _BESIDE for name in members)
        for name, member in members.items():
            place = (*where, "properties", str(name))
            if (
                not beside
                and _is_number(member)
                and _is_quantity(str(name))
                and not _names_unit(str(name), member, text)
            ):
                yield place, str(name)
            yield from measured_without_unit(member, place, text)
    for part in ("items", "additionalProperties"):
        yield from measured_without_unit(schema.get(part), (*where, part), text)
    for name, each in (schema.get("$defs") or {}).items() if isinstance(schema.get("$defs"), Mapping) else ():
        yield from measured_without_unit(each, (*where, "$defs", str(name)), text)


def _is_number(member: Any) -> bool:
    if not isinstance(member, Mapping) or {"enum", "const"} & member.keys():
        return False
    forms = [member, *(each for each in member.get("anyOf", ()) if isinstance(each, Mapping))]
    kinds = [each.get("type") for each in forms]
    return any(kind in ("number", "integer") or (isinstance(kind, list) and "number" in kind) for kind in kinds)


def _is_quantity(name: str) -> bool:
    spoken = tokens(name)
    if not spoken or _ASIDE & set(spoken):
        return False
    return bool(_QUANTITIES & set(spoken)) or spoken[-1] in _LAST


def _names_unit(name: str, member: Mapping[str, Any], around: str) -> bool:
    forms = " ".join(str(each.get("description", "")) for each in member.get("anyOf", ()) if isinstance(each, Mapping))
    text = f"{around} {member.get('description', '')} {member.get('title', '')} {forms}"
    if set(tokens(name)) & _UNITS or member.keys() & {"unit", "units", "x-unit"}:
        return True
    spoken = {word for word in re.findall(r"[a-z]+", text.casefold()) if len(word) > 1}
    return bool(spoken & _UNITS - _BESIDE or _SIGNS.search(text) or _LETTER.search(text))


def result_bare(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading has members with units; a bare text may have to be parsed by anyone who calls it."""
    effects, out = effects_of(artifacts), []
    hint = 'describe each reading as a member with its unit: {"temperature_celsius": {"type": "number"}}'
    for index, tool in enumerate(value["tools"]):
        if tool["effect"] != "read" or effects.get(tool["capability"], "read") != "read":
            continue  # another rule reports the understated effect, which is the cause
        where = pointer("tools", index, "output_schema")
        if why := _bare(tool.get("output_schema")):
            summary = f"the result of {display(tool['name'])} {why}"
            out.append(error("INTERFACE-RESULT-BARE", summary, pointer=where, hint=hint))
        elif _is_text(tool["output_schema"]):
            summary = f"the result of {display(tool['name'])} is one text"
            report = warning if _READS_TEXT.intersection(tokens(tool["capability"])) else error
            out.append(report("INTERFACE-RESULT-BARE", summary, pointer=where, hint=hint))
        else:
            for place, why in read_nothing(tool["capability"], tool["output_schema"]):
                summary = f"the result of {display(tool['name'])} {escaped(why)}"
                at = pointer("tools", index, "output_schema", *place)
                out.append(error("INTERFACE-RESULT-BARE", summary, pointer=at, hint=hint))
    return out


def _bare(schema: Any) -> str:
    """The missing part of a schema for a result; empty without one."""
    if schema is None:
        return "is not described: there is no output_schema"
    if not isinstance(schema, dict) or {"$ref", "anyOf", "oneOf", "allOf"} & schema.keys():
        return ""
    members = schema.get("properties")
    return "" if isinstance(members, dict) and members else "has no members that are described"


def _is_text(schema: Any) -> bool:
    members = schema.get("properties") if isinstance(schema, dict) else None
    if not isinstance(members, dict) or len(members) != 1:
        return False
    only = next(iter(members.values()))
    free = isinstance(only, dict) and only.get("type") == "string" and "enum" not in only
    return free and bool(set(members) & _BARE or _ALL_IN_ONE.search(str(only.get("description", ""))))


_RAW = regex(r"(?i)\b(?:raw|counts?|ticks|steps?|unscaled|unitless|without a unit)\b")
_HUNDRED = regex(r"(?<![\d.])100(?![\d.])")


def _raw_in_percent(schema: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, name) of each number that is called raw and bound like a percentage, at any depth."""
    if not isinstance(schema, Mapping):
        return
    members = schema.get("properties")
    for name, member in members.items() if isinstance(members, Mapping) else ():
        place = (*where, "properties", str(name))
        if isinstance(member, Mapping) and (member.get("minimum"), member.get("maximum")) == (0, 100):
            text = f"{name} {member.get('description', '')}".replace("_", " ")
            if _RAW.search(text) and not re.search(r"(?i)percent|%|100", text):
                yield place, str(name)
        yield from _raw_in_percent(member, place)
    for part in ("items", "additionalProperties"):
        yield from _raw_in_percent(schema.get(part), (*where, part))


def result_without_unit(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A member that is a quantity has its unit in its name or description: results are judged by it."""
    out = []
    for index, tool in enumerate(value["tools"]):
        schema = tool.get("output_schema") if tool["effect"] == "read" else None
        if (unit := unit_of_another(tool["capability"], tool["description"])) is not None:
            summary = f"the description of {display(tool['name'])} is about {unit}, which is no unit of what it reads"
            place = pointer("tools", index, "description")
            out.append(error("INTERFACE-RESULT-UNIT", summary, pointer=place, hint="describe what this tool reads"))
        for where, name in measured_without_unit(schema):
            summary = f"the result's {display(name)} of {display(tool['name'])} is a quantity, and no unit is given"
            hint = f"put the unit into the description of {display(name)} or at the end of its name, or a member "
            hint += "`unit` beside it; what a device gives without one is called raw"
            place = pointer("tools", index, "output_schema", *where)
            out.append(error("INTERFACE-RESULT-UNIT", summary, pointer=place, hint=hint))
        for where, name in _raw_in_percent(tool.get("output_schema")):
            if _HUNDRED.search(known_text(tool, artifacts)):
                break
            summary = f"the raw {display(name)} of {display(tool['name'])} is bound to 0 to 100, as a percentage is"
            hint = "write the bounds of the attribute, or none where neither IDENTIFY nor PROBE shows them"
            place = pointer("tools", index, "output_schema", *where)
            out.append(error("INTERFACE-RESULT-UNIT", summary, pointer=place, hint=hint))
    return out + unit_contradicted(value)


_ONE = {
    "unit": "give one unit, the one of the value",
    "sense": "describe a switch as its name has it: one that is called off is true where it is off",
}


def unit_contradicted(value: JsonObject) -> list[Diagnostic]:
    """A number, taken or returned, has one unit by its name, its words and its range, and a switch one sense."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for part in ("input_schema", "output_schema"):
            for where, name, what in unit_against_name(tool.get(part)):
                summary = f"the {display(name)} of {display(tool['name'])} has one {what} by its name and another "
                summary += "by its words or its range"
                place = pointer("tools", index, part, *where)
                out.append(error("INTERFACE-RESULT-UNIT", summary, pointer=place, hint=_ONE[what]))
    return out


_BARE = frozenset({"result", "text", "output", "value", "response", "answer", "stdout", "reply", "data", "content"})
_ALL_IN_ONE = regex(r"(?i)\b(?:as|in|one|whole|plain) text\b|\boutput of\b|\bto be parsed\b|\beverything\b")
_READS_TEXT = frozenset(
    {"text", "barcode", "barcodes", "code", "label", "message", "ocr", "card", "tag", "badge", "page"}
    | {"listen", "console", "log", "line", "lines", "sentence", "sentences"}
)
"""Words of a capability whose reading is text: that on a label."""
RULES = (
    Rule("INTERFACE-RESULT-BARE", result_bare),
    Rule("INTERFACE-RESULT-UNIT", result_without_unit),
)
