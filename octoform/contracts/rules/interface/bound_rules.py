"""Rules for INTERFACE about what a caller may give: numbers within bounds, waits that end, no text that is a program.

What is served is called by a model, with arguments that no one has looked at. So each number that reaches an actuator
has both its bounds in the schema (the server's own signature enforces them), each wait ends within a minute, and no
text goes to a device, a shell or a file system as it is.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeGuard

from octoform.base.escaping import display, listed
from octoform.base.quantities import is_possible, unit_in, unit_of_name, unit_of_text
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, effects_of
from octoform.contracts.name_clues import changes, is_passthrough, offers_a_pipe, raw_parameter, tokens
from octoform.contracts.rules.interface.parameter_rules import strings_of, takes_a_program, unfit
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

MAX_WAIT = 60.0
"""Seconds; the bound of protocol/interface.md."""
_SIDES = (("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum"))
_WAITS = frozenset({"timeout", "wait", "waiting", "deadline", "delay"})
_RECORDS = frozenset({"duration", "seconds", "secs", "record", "recording", "listen", "length", "poll"})
_SECONDS = {
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 0.001),
    **dict.fromkeys(("us", "microseconds"), 1e-6),
    **dict.fromkeys(("min", "mins", "minutes"), 60.0),
    **dict.fromkeys(("h", "hours"), 3600.0),
}
_PAUSES = frozenset({"interval", "pause", "period", "spacing", "between", "every"})
_COUNTS = frozenset(
    {"samples", "count", "readings", "repeat", "repeats", "repetitions", "frames", "number", "times", "n"}
)
_AGAIN = frozenset({"repeat", "repeats", "repetitions", "rounds", "tries", "attempts", "retries"})
"""Counts of whole waits: each of them may be the longest."""
_PLACES = frozenset(
    {"path", "paths", "file", "filename", "filepath", "folder", "directory", "dir", "url", "uri", "node"}
    | {"host", "hostname", "port", "socket", "attribute", "args", "argv", "ip"}
    | {"webhook", "callback", "server", "recipient", "email"}
)
_PLACE_SAID = regex(r"(?i)\b(?:ur[il]s?|https?|web ?hook|e-?mail|file ?name|ip address|path|folder|directory)\b")
_PLACES_TOGETHER = ({"output", "to"}, {"device", "node"}, {"save", "as"}, {"save", "to"}, {"dev", "node"})
_NUMBERED = frozenset({"register", "reg", "address", "addr", "opcode", "endpoint"})
_BYTES = frozenset({"hex", "bytes", "payload", "raw", "base64", "packet"})
_LONG = frozenset({"min", "mins", "minutes", "h", "hours"})
_PAST = regex(r"(?i)\b(?:last|past|ago|history|since|previous|recent|logged)\b")
MAX_TRIAL = 10.0
"""Seconds that the test call of a reading may wait, or record."""
_FROM_NOTHING = frozenset(
    {
        "brightness",
        "volume",
        "loudness",
        "charge",
        "battery",
        "fill",
        "duty",
        "humidity",
        "intensity",
        "backlight",
        "led",
    }
    | {"light", "lamp", "dimmer", "opacity", "contrast", "moisture"}
)
"""Words for what has no less than none of it: a percentage of it begins at 0."""
_UP_TO_ALL = _FROM_NOTHING - {"intensity", "contrast", "loudness", "humidity"} | {"pwm"}
"""Words for what has no more than all of it: a percentage of it ends at 100."""
_BEYOND = regex(
    r"(?i)pulse ?audio|pipewire|wireplumber|pactl|wpctl|sound server|amplif|boost|over-?drive|gain|software"
    r"|of (?:the |its )?(?:nominal|rated|design|default|normal)"
)
"""Words by which there may be more than all of something: software amplifies beyond 100 percent."""
_OF_ANOTHER = regex(r"(?i)speed|tempo|rate|zoom|scale|size|length|time|duration|saturation|temperature|pitch")
"""Words of a quantity of which there may be any percentage of the usual."""
_CHANGES = regex(
    r"(?i)change|relative|offset|delta|adjust|differ|shift|trim|correct|step|balance|negative|more or less"
)
_ANY_OF = frozenset(
    {"all", "any", "none", "both", "auto", "default", "first", "every", "each", "off", "on", "mean", "max", "min"}
)
_KERNEL_NAME = regex(r"(?i)[a-z]+[-_:]?\d+|.*[:_].*")
_LARGEST = 1e15
"""A bound beyond this bounds nothing: doubles count no further in ones."""
_ONE_CLASS = regex(r"\^?(\[[^\]]{1,80}\]|\.|\\[wWsSdD])(?:[*+]|\{\d*,\d*\})\$?")
_SIGNS = "aZ09 /;$-.#"
"""The words for parts of lines, commands and paths."""
_TAKES_ALL = frozenset({".*", "^.*$", ".+", "^.+$", "[\\s\\S]*", "^[\\s\\S]*$", "(?s).*", ""})


def number_unbounded(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each number that a tool of effect takes has a minimum and a maximum."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for name, where, member in parameters_of(index, tool) if tool["effect"] != "read" else ():
            lacks = [first for first, other in _SIDES if not any(_bounds(member.get(side)) for side in (first, other))]
            if _is_number(member) and lacks:
                summary = (
                    f"{display(name)} of {display(tool['name'])} reaches what acts and has no {' and no '.join(lacks)}"
                )
                hint = "write both into the schema: the range of the device, its profile's, or one that is safe for any"
                out.append(error("INTERFACE-NUMBER-UNBOUNDED", summary, pointer=where, hint=hint))
    return out


def range_empty(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A range and a choice hold their default and something, and nothing that cannot be in its unit or type."""
    out = []
    hint = "write the lower bound as minimum, the upper one as maximum, and a default that is one of what may be given"
    for index, tool in enumerate(value["tools"]):
        for name, where, member in parameters_of(index, tool):
            if why := _emptiness(tool, name, member) or unfit(name, member):
                summary = f"{display(name)} of {display(tool['name'])} {why}"
                out.append(error("INTERFACE-RANGE-EMPTY", summary, pointer=where, hint=hint))
    return out


def _emptiness(tool: JsonObject, name: str, member: Mapping[str, Any]) -> str | None:
    """What is wrong with the range of a number; None where nothing is."""
    low, high, given = (member.get(word) for word in ("minimum", "maximum", "default"))
    unit = unit_of_name(name) or unit_in(member.get("description"))
    beyond = [side for side in (low, high) if unit is not None and _is_plain(side) and not is_possible(side, unit)]
    if _is_plain(low) and _is_plain(high) and low > high:
        return f"has the minimum {low:g} above the maximum {high:g}"
    if _is_plain(given) and ((_is_plain(low) and given < low) or (_is_plain(high) and given > high)):
        return f"has the default {given:g}, which its own range does not hold"
    if beyond:
        return f"reaches {beyond[0]:g} {unit}, which nothing does"
    if unit == "%" and _is_plain(low) and low < 0 and _is_share(tool, name, member, _FROM_NOTHING):
        return f"reaches {low:g} percent of what there is no less than none of"
    if unit == "%" and _is_plain(high) and high > 100 and _ends_at_all(tool, name, member):
        return f"reaches {high:g} percent of what there is no more than all of"
    return None


def _is_share(tool: JsonObject, name: str, member: Mapping[str, Any], words: frozenset[str]) -> bool:
    """Whether a percentage is one of something, by its own words or the tool's, and no change of it."""
    said = f"{name} {member.get('description', '')}"
    own = {word for word in tokens(name) if word not in ("percent", "percentage", "pct", "value", "level")}
    return bool(words & (own or set(tokens(tool["name"])))) and not _CHANGES.search(f"{said} {tool['name']}")


def _ends_at_all(tool: JsonObject, name: str, member: Mapping[str, Any]) -> bool:
    """Whether there is no more than all of what a percentage is one of."""
    said = f"{name} {tool['name']} {member.get('description', '')}"
    other = _OF_ANOTHER.search(said) or _BEYOND.search(f"{said} {tool['description']}")
    return not other and _is_share(tool, name, member, _UP_TO_ALL)


def choice_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A choice among the channels, the lights or the units of a device is one that IDENTIFY or PROBE has of it."""
    return [*_name_unknown(value, artifacts), *_number_unknown(value, artifacts)]


def _name_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    out = []
    for index, tool in enumerate(value["tools"]):
        known = _parts_of(tool, artifacts)
        text = "\n".join((*known, *strings_of(tool, artifacts))).casefold()
        for name, where, member in parameters_of(index, tool) if known else ():
            given = {str(item) for item in (*_list(member.get("enum")), member.get("const")) if isinstance(item, str)}
            strange = sorted(item for item in given - known - _ANY_OF if item.casefold() not in text)
            if name == "device" or not strange:
                continue
            if given & known or (_is_of(name, tool, artifacts) and all(map(_KERNEL_NAME.fullmatch, strange))):
                summary = (
                    f"{display(name)} of {display(tool['name'])} offers {listed(strange)}, which its device has not"
                )
                hint = f"offer what IDENTIFY lists of it: {listed(sorted(known))}"
                out.append(error("INTERFACE-CHOICE-UNKNOWN", summary, pointer=where, hint=hint))
    return out


_NUMBERS_OF = frozenset({"index", "number", "idx", "no", "nr", "id"})
_ONES = {"channels": frozenset({"channel", "sensor", "input"})}
"""Words for one of what IDENTIFY lists, where it is not the singular of the list's name."""


def _number_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A number that chooses among the channels or the lights of a device reaches no further than there are."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for name, where, member in parameters_of(index, tool):
            given = [item for item in _list(member.get("enum")) if type(item) is int]
            most = max(given) if given else member.get("maximum")
            rows = _numbered(name, tool, artifacts) if "integer" in _types(member) or given else []
            if rows and _is_plain(most) and most > max(len(rows), *map(_largest, rows)):
                has = listed(sorted({str(row.get("channel", row.get("name"))) for row in rows}))
                summary = f"{display(name)} of {display(tool['name'])} reaches {most:g}, and its device has {has}"
                hint = "offer the names that IDENTIFY lists as an enum, or numbers up to how many there are"
                out.append(error("INTERFACE-CHOICE-UNKNOWN", summary, pointer=where, hint=hint))
    return out


def _largest(row: Mapping[str, Any]) -> int:
    """The largest number in what IDENTIFY has of a part, without the bounds of its values."""
    kept = (str(item) for key, item in row.items() if not key.startswith(("max", "min")))
    return max((int(found) for text in kept for found in re.findall(r"\d{1,9}", text)), default=0)


def _numbered(name: str, tool: JsonObject, artifacts: Artifacts) -> list[Mapping[str, Any]]:
    """The parts of a device among which a parameter of this name chooses by a number."""
    spoken, rows = set(tokens(name)) - _NUMBERS_OF, list(listed_of(tool, artifacts))
    kinds = {kind for kind, _ in rows}
    ones = {kind: _ONES.get(kind, frozenset()) | {kind.removesuffix("s")} for kind in kinds}
    alone = len(kinds) == 1 and set(tokens(name)) in ({"index"}, {"idx"})
    meant = {kind for kind in kinds if alone or (spoken and spoken <= ones[kind])}
    return [row for kind, row in rows if kind in meant and {"name", "channel"} & row.keys()]


def endless(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each list and each text that a tool of effect takes has an end."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for name, where, member in parameters_of(index, tool) if tool["effect"] != "read" else ():
            kinds, free = _types(member), not {"enum", "const", "pattern", "format"} & member.keys()
            lacks = ["maxItems"] if "array" in kinds and "maxItems" not in member else []
            lacks += ["maxLength"] if "string" in kinds and free and "maxLength" not in member else []
            # What takes anything is another rule's finding.
            if lacks and name != "device" and not (raw_parameter(tool["input_schema"]) or _place(tool)):
                summary = f"{display(name)} of {display(tool['name'])} may be of any length: there is no {lacks[0]}"
                hint = f"write {lacks[0]} into the schema: what the device takes at once, or what is safe for any"
                out.append(error("INTERFACE-ENDLESS", summary, pointer=where, hint=hint))
    return out


def limit_in_another_unit(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A limit is in the unit of its parameter: 100 is another bound in rpm than in percent."""
    out = []
    for index, tool in enumerate(value["tools"]):
        units = {
            name: unit_of_name(name) or unit_in(member.get("description"))
            for name, _, member in parameters_of(index, tool)
        }
        for at, limit in enumerate(tool.get("limits", ())):
            given, own = unit_of_text(limit.get("unit")), units.get(limit["parameter"])
            if given is not None and own is not None and given != own:
                summary = f"the limit of {display(limit['parameter'])} is in {given}, and the parameter is in {own}"
                where = pointer("tools", index, "limits", at, "unit")
                hint = "give both in one unit, and convert the bounds"
                out.append(error("INTERFACE-LIMIT-UNIT", summary, pointer=where, hint=hint))
    return out


def _series(index: int, tool: JsonObject) -> tuple[str, float, str] | None:
    """(parameter, seconds, pointer) of a count of readings, or of waits, and the pause between them, at its longest."""
    counts, pauses = [], []
    again = any(set(tokens(name)) & _AGAIN for name, _, _ in parameters_of(index, tool))
    for name, where, member in parameters_of(index, tool):
        spoken, most = set(tokens(name)), member.get("maximum", member.get("exclusiveMaximum", math.inf))
        if not _is_number(member) or not _is_plain(most):
            continue
        if spoken & _PAUSES or (again and spoken & (_WAITS | _RECORDS) and _is_time(spoken, member)):
            scale = next((each for word, each in _SECONDS.items() if word in spoken), 1.0)
            pauses.append((most * scale, where, name))
        elif spoken & (_AGAIN if again else _COUNTS):
            counts.append(most)
    if not counts or not pauses:
        return None
    seconds, where, name = max(pauses)
    return name, max(counts) * seconds, where


def wait_too_long(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A wait, or the length of a recording, has an upper bound of at most a minute."""
    out = []
    for tool, name, where, member, unit in _waits(value):
        longest = member.get("maximum", member.get("exclusiveMaximum"))
        if isinstance(longest, int | float) and longest * unit <= MAX_WAIT:
            continue
        bound = f"{longest * unit:g} s" if isinstance(longest, int | float) else "permanently"
        summary = f"{display(name)} of {display(tool['name'])} lets a call last {bound}"
        hint = f"write a maximum of at most {MAX_WAIT / unit:g}"
        out.append(error("INTERFACE-WAIT-TOO-LONG", summary, pointer=where, hint=hint))
    for index, tool in enumerate(value["tools"]):
        series = _series(index, tool)
        if series is not None and series[1] > MAX_WAIT:
            length = "without end" if math.isinf(series[1]) else f"{series[1]:g} s"
            summary = f"{display(series[0])} of {display(tool['name'])} lets a series last {length}"
            hint = f"write maxima whose product is at most {MAX_WAIT:g} s: of the readings and of the pause"
            out.append(error("INTERFACE-WAIT-TOO-LONG", summary, pointer=series[2], hint=hint))
    return out


def sample_too_long(value: JsonObject) -> list[Diagnostic]:
    """The test call of a reading, which is really made, waits and records as briefly as it may."""
    out = []
    for tool, name, where, member, unit in _waits(value):
        given = tool.get("smoke", {}).get("arguments", {}).get(name, member.get("default"))
        if tool["effect"] == "read" and _is_plain(given) and given * unit > MAX_TRIAL:
            summary = f"the test call of {display(tool['name'])} may last {given * unit:g} s by its {display(name)}"
            hint = f"write into `smoke.arguments` the shortest one, at most {MAX_TRIAL / unit:g}"
            out.append(error("INTERFACE-SMOKE", summary, pointer=where, hint=hint))
    return out


def _waits(value: JsonObject) -> Iterator[tuple[JsonObject, str, str, Mapping[str, Any], float]]:
    """(tool, parameter, pointer, schema, seconds of its unit) of each number that states how long a call lasts."""
    for index, tool in enumerate(value["tools"]):
        for name, where, member in parameters_of(index, tool):
            spoken = set(tokens(name))
            reads = tool["effect"] == "read"
            waits = spoken & _WAITS or (reads and spoken & _RECORDS and _is_time(spoken, member))
            waits = waits or (reads and spoken <= _LONG and not _PAST.search(str(member.get("description", ""))))
            if waits and _is_number(member):
                yield tool, name, where, member, next((each for word, each in _SECONDS.items() if word in spoken), 1.0)


def effect_understated(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that changes or destroys something by its own words is no tool that reads."""
    wanted = effects_of(artifacts)
    return [
        error(
            "INTERFACE-EFFECT-UNDERSTATED",
            f"{display(tool['name'])} is declared read, and {display(verb)} changes something",
            pointer=pointer("tools", index, "name"),
            hint="name what it reads, as its capability does",
        )
        for index, tool in enumerate(value["tools"])
        if tool["effect"] == "read" == wanted.get(tool["capability"], "read")
        and not is_passthrough(tool["name"])
        and (verb := changes(tool["name"], tool["description"]))
    ]


def passthrough(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No tool is a raw pipe, by its name, its description or a parameter that takes anything."""
    out = []
    for index, tool in enumerate(value["tools"]):
        raw = takes_a_program(tool) or raw_parameter(tool["input_schema"]) or _place(tool) or _anything(tool)
        lines = [
            name for name, _, member in parameters_of(index, tool) if offers_a_pipe(str(member.get("description", "")))
        ]
        if is_passthrough(tool["name"]):
            summary, where = f"the tool {display(tool['name'])} is a raw pipe", pointer("tools", index, "name")
        elif raw or lines:
            summary = f"the parameter {display(raw or lines[0])} of {display(tool['name'])} takes anything"
            where = pointer("tools", index, "input_schema", "properties", raw or lines[0])
        elif tool["input_schema"].get("additionalProperties") is True:
            summary = f"{display(tool['name'])} takes parameters of any name"
            where = pointer("tools", index, "input_schema", "additionalProperties")
        elif offers_a_pipe(tool["description"].partition("Through:")[0]):
            summary = f"the tool {display(tool['name'])} is a raw pipe by its description"
            where = pointer("tools", index, "description")
        else:
            continue
        hint = "offer what the device does, with typed and bounded parameters (an enum or a pattern bounds a string)"
        out.append(error("INTERFACE-PASSTHROUGH", summary, pointer=where, hint=hint))
    return out


def _bounds(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) < _LARGEST


def _is_plain(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _takes_all(pattern: object) -> bool:
    """Whether a pattern lets any line pass. Only one that repeats a single class of signs is tried."""
    if not isinstance(pattern, str) or pattern in _TAKES_ALL:
        return pattern in _TAKES_ALL if isinstance(pattern, str) else False
    found = _ONE_CLASS.fullmatch(pattern)
    try:
        return found is not None and all(re.fullmatch(found[1], sign) for sign in _SIGNS)
    except re.error:
        return False


def _anything(tool: JsonObject) -> str | None:
    """A parameter that is a register's number, bytes, or an object of whatever members; None where there is none."""
    for name, _, member in parameters_of(0, tool):
        spoken, kinds = set(tokens(name)), _types(member)
        chosen = {"enum", "const"} & member.keys()
        if kinds & {"integer", "number"} and spoken & _NUMBERED and not chosen:
            return name
        if "string" in kinds and not chosen and (spoken <= _BYTES or member.get("contentEncoding") == "base64"):
            return name
        if "object" in kinds and not member.get("properties") and member.get("additionalProperties", True) is True:
            return name
    return None


def _place(tool: JsonObject) -> str | None:
    """A parameter that takes a path, an address or a device node, or None: the server knows its own places."""
    for name, _, member in parameters_of(0, tool):
        spoken = set(tokens(name))
        places = _PLACE_SAID.search(str(member.get("description", "")))
        if places or spoken & _PLACES or any(words <= spoken for words in _PLACES_TOGETHER):
            if _types(member) & {"string", "array"} and not {"enum", "const"} & member.keys():
                return name
        elif (
            "string" in _types(member) and _takes_all(member.get("pattern")) and len(spoken & {"text", "message"}) == 0
        ):
            return name
    return None


def parameters_of(index: int, tool: JsonObject) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """(name, pointer, schema) of each parameter, of the items of an array, of each form that it may have."""
    properties = tool["input_schema"].get("properties")
    for name, member in properties.items() if isinstance(properties, dict) else ():
        where = pointer("tools", index, "input_schema", "properties", name)
        for form in _forms(_referred(member, tool["input_schema"])):
            yield name, where, form


def _referred(member: Any, root: JsonObject) -> Any:
    """A parameter as it reads where its definition stands elsewhere in the schema."""
    reference = member.get("$ref") if isinstance(member, dict) else None
    name = reference.removeprefix("#/$defs/") if isinstance(reference, str) else ""
    target = root.get("$defs", {}).get(name)
    return (
        {**target, **{key: item for key, item in member.items() if key != "$ref"}}
        if isinstance(target, dict)
        else member
    )


def _forms(member: object) -> Iterator[Mapping[str, Any]]:
    if not isinstance(member, dict):
        return
    parts = [each for key in ("anyOf", "oneOf", "allOf") if isinstance(member.get(key), list) for each in member[key]]
    yield from ({**form} for part in parts for form in _forms(part))
    if not parts:
        yield member
    inner = [member.get("items"), member.get("additionalProperties"), *_list(member.get("prefixItems"))]
    inner += member["properties"].values() if isinstance(member.get("properties"), dict) else []
    for each in inner:
        yield from _forms(each)


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _types(member: Mapping[str, Any]) -> set[str]:
    given = member.get("type")
    return {given} if isinstance(given, str) else set(given) if isinstance(given, list) else set()


def _is_number(member: Mapping[str, Any]) -> bool:
    return bool(_types(member) & {"number", "integer"}) and not {"enum", "const"} & member.keys()


def _is_time(spoken: set[str], member: Mapping[str, Any]) -> bool:
    """True for a length of time; of a length in millimetres the words speak otherwise."""
    names = set(tokens(str(member.get("description", ""))))
    return bool(spoken & {"seconds", "secs", "duration", *_SECONDS} or names & {"seconds", "second", "s", "ms"})


def listed_of(tool: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """(member, record) of each channel, light or port that IDENTIFY lists of a tool's capability."""
    for device in (artifacts.identify or {"devices": []})["devices"]:
        abilities = device["capabilities"] if device["id"] in tool["devices"] else ()
        for ability in (each for each in abilities if each["name"] == tool["capability"]):
            for member, rows in (ability.get("parameters") or {}).items():
                yield from ((member, row) for row in _list(rows) if isinstance(row, dict))


def _parts_of(tool: JsonObject, artifacts: Artifacts) -> set[str]:
    rows = (row for _, row in listed_of(tool, artifacts))
    return {row[key] for row in rows for key in ("name", "channel", "label") if isinstance(row.get(key), str)}


def _is_of(name: str, tool: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a parameter is called like what IDENTIFY lists: `led` of `leds`."""
    return any(member.removesuffix("s") in tokens(name) for member, _ in listed_of(tool, artifacts))


RULES = (
    Rule("INTERFACE-NUMBER-UNBOUNDED", number_unbounded),
    Rule("INTERFACE-ENDLESS", endless),
    Rule("INTERFACE-LIMIT-UNIT", limit_in_another_unit),
    Rule("INTERFACE-RANGE-EMPTY", range_empty),
    Rule("INTERFACE-CHOICE-UNKNOWN", choice_unknown),
    Rule("INTERFACE-WAIT-TOO-LONG", wait_too_long),
    Rule("INTERFACE-EFFECT-UNDERSTATED", effect_understated),
    Rule("INTERFACE-PASSTHROUGH", passthrough),
)
