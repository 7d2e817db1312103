"""Read the ``grammar`` of a profile: every problem of it with its place, or the grammar. Pure.

What is refused here is what could make a tool a raw pipe: text that a caller chooses freely, control characters and
line ends inside a command, a number without bounds that moves something.
"""

import keyword
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from octoform import durations
from octoform.diagnostics import did_you_mean
from octoform.frontmatter import Place
from octoform.profiles.grammar import Command, Grammar, Line, Value

LINE_FIELDS = ("class", "baud", "ending", "ok", "error", "timeout", "settle")
COMMAND_FIELDS = ("tool", "send", "about", "effect", "parameters", "reply", "fields")
VALUE_FIELDS = ("type", "about", "unit", "minimum", "maximum", "enum")
LINE_CLASS = "tty"
ENDINGS = ("\n", "\r", "\r\n")
EFFECTS = ("read", "actuate", "irreversible")
TYPES = ("integer", "number", "string")
MOST_COMMANDS, MOST_VALUES, MOST_CHOICES = 40, 12, 50
MOST_CHARS = 200
LARGEST = 2**53
_TOOL = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)+")
_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_PRINTABLE = re.compile(r"[ -~]+")
_PLACEHOLDER = re.compile(r"\{([a-z][a-z0-9_]*)\}")
_RAW_VERBS = frozenset({"send", "write", "transmit", "execute", "run", "put", "forward", "query"})
_RAW_NOUNS = frozenset({"command", "commands", "cmd", "line", "lines", "serial", "bytes", "data", "text", "string"})
_RAW = frozenset({"raw", "passthrough", "exec", "eval", "shell", "gcode", "scpi"})
_EXAMPLE = '{class: tty, baud: 115200, ok: "OK", error: "ERR {message}", timeout: 10s}'

Problem = tuple[Place, str, str | None]


@dataclass
class _Found:
    """The problems so far."""

    problems: list[Problem] = field(default_factory=list)

    def add(self, place: Place, summary: str, hint: str | None = None) -> None:
        self.problems.append((place, summary, hint))

    def mapping(self, value: object, place: Place, what: str, known: tuple[str, ...]) -> Mapping[str, Any]:
        """The value as a mapping of known fields; empty, with a problem, when it is none."""
        if not isinstance(value, Mapping):
            self.add(place, f"{what} is no mapping", f"its fields are {', '.join(known)}")
            return {}
        for name in value:
            if name not in known:
                near = did_you_mean(str(name), known)
                hint = f"did you mean {near!r}?" if near else f"known fields: {', '.join(known)}"
                self.add((*place, name), f"{name!r} is no field here", hint)
        return value

    def text(self, given: Mapping[str, Any], name: str, place: Place, default: str | None = None) -> str:
        """A short text of printable ASCII; with ``default`` None it must be there."""
        value = given.get(name, default)
        if isinstance(value, str) and value.strip() and len(value) <= MOST_CHARS and _PRINTABLE.fullmatch(value):
            return value
        if value == default == "":
            return ""
        hint = "a line's end and control characters do not belong into it; the field `ending` ends a line"
        self.add((*place, name), f"{name!r} is no text of 1 to {MOST_CHARS} printable ASCII characters", hint)
        return ""


def read(given: object) -> tuple[Grammar | None, list[Problem]]:
    """The grammar that a front-matter value says, and every problem of it as (place, summary, hint)."""
    found, place = _Found(), ("grammar",)
    whole = found.mapping(given, place, "the grammar", ("line", "commands"))
    line = _line(found, whole.get("line"), (*place, "line"))
    items = whole.get("commands")
    if not isinstance(items, list) or not 1 <= len(items) <= MOST_COMMANDS:
        hint = 'write commands: [{tool: lamp_off, send: "OFF", about: "switch the lamp off", effect: actuate}]'
        found.add((*place, "commands"), f"the grammar has no list of 1 to {MOST_COMMANDS} commands", hint)
        items = []
    commands = [_command(found, item, (*place, "commands", index)) for index, item in enumerate(items)]
    _distinct(found, commands)
    return (None if found.problems else Grammar(line, tuple(commands))), found.problems


def _distinct(found: _Found, commands: list[Command]) -> None:
    seen: dict[str, int] = {}
    for index, command in enumerate(commands):
        before = seen.setdefault(command.tool, index)
        if command.tool and before != index:
            where = ("grammar", "commands", index, "tool")
            found.add(where, f"the tool {command.tool!r} stands twice", "give each command a tool of its own")


def _line(found: _Found, given: object, place: Place) -> Line:
    line = found.mapping(given, place, "the line of the grammar", LINE_FIELDS)
    baud, ending = line.get("baud"), line.get("ending", "\n")
    if line.get("class") != LINE_CLASS:
        found.add((*place, "class"), f"the class of the line is not {LINE_CLASS}", f"write line: {_EXAMPLE}")
    if isinstance(baud, bool) or not isinstance(baud, int) or not 1 <= baud <= 100_000_000:
        hint = "write for example 115200, also where the product is a USB device that does not care"
        found.add((*place, "baud"), "the baud of the line is no positive whole number", hint)
        baud = 1
    if ending not in ENDINGS:
        found.add((*place, "ending"), "the ending of a line is none that is known", r'write "\n", "\r" or "\r\n"')
    ok = found.text(line, "ok", place)
    if "{" in ok or "}" in ok:
        found.add((*place, "ok"), "`ok` has a placeholder", "what an answer says stands in the `reply` of a command")
    error = found.text(line, "error", place) if "error" in line else None
    if error and (set(_names(error)) - {"message"} or not _well_formed(error)):
        found.add(
            (*place, "error"), "`error` has another placeholder than {message}", 'write for example "ERR {message}"'
        )
    timeout = _seconds(found, line, "timeout", place, (1, 60), 5)
    settle = _seconds(found, line, "settle", place, (0, 10), 0)
    return Line(LINE_CLASS, baud, str(ending), ok, error, float(timeout), float(settle))


def _seconds(
    found: _Found, line: Mapping[str, Any], name: str, place: Place, span: tuple[int, int], default: int
) -> int:
    value = line.get(name)
    seconds = durations.seconds(value) if isinstance(value, str) else default if value is None else None
    if seconds is None or not span[0] <= seconds <= span[1]:
        found.add((*place, name), f"{name!r} is no duration from {span[0]}s to {span[1]}s", "write for example 5s")
        return default
    return seconds


def _command(found: _Found, given: object, place: Place) -> Command:
    item = found.mapping(given, place, "a command", COMMAND_FIELDS)
    tool, effect = _tool(found, item.get("tool"), (*place, "tool")), item.get("effect")
    if effect not in EFFECTS:
        found.add((*place, "effect"), "the command does not say its effect", f"write one of {', '.join(EFFECTS)}")
    about = found.text(item, "about", place)
    send = found.text(item, "send", place)
    reply = found.text(item, "reply", place) if "reply" in item else None
    parameters = _values(found, item, "parameters", place)
    fields = _values(found, item, "fields", place)
    _agree(found, send, parameters, (*place, "send"), "parameters")
    if reply is not None:
        _agree(found, reply, fields, (*place, "reply"), "fields")
        _apart(found, reply, (*place, "reply"))
    elif fields:
        found.add(
            (*place, "fields"), "fields without a `reply` that shows them", 'write for example reply: "TEMP {celsius}"'
        )
    for value in parameters:
        _closed(found, value, effect, (*place, "parameters", value.name))
    for value in fields:
        if value.minimum is not None or value.maximum is not None:
            hint = "bounds are for parameters; nobody keeps a product to what it answers"
            found.add((*place, "fields", value.name), f"the field {value.name!r} has bounds", hint)
    return Command(tool, send, about, str(effect), parameters, reply, fields)


def _tool(found: _Found, name: object, place: Place) -> str:
    if not (isinstance(name, str) and _TOOL.fullmatch(name) and len(name) <= 64):
        hint = "write two words or more in lower case with underscores: rail_home"
        found.add(place, "the command has no usable tool name", hint)
        return ""
    words = set(name.split("_"))
    if words & _RAW or (words & _RAW_VERBS and words & _RAW_NOUNS):
        hint = "name what the product does: a tool for each thing, never one that passes on whatever it is given"
        found.add(place, f"the tool {name!r} would be a raw pipe to the device", hint)
    return name


def _values(found: _Found, item: Mapping[str, Any], name: str, place: Place) -> tuple[Value, ...]:
    given, where = item.get(name, {}), (*place, name)
    if not isinstance(given, Mapping) or len(given) > MOST_VALUES:
        hint = "write {steps: {type: integer, minimum: -2000, maximum: 2000}}"
        found.add(where, f"{name!r} is no mapping of at most {MOST_VALUES} values", hint)
        return ()
    return tuple(_value(found, str(key), value, (*where, key)) for key, value in given.items())


def _value(found: _Found, name: str, given: object, place: Place) -> Value:
    value = found.mapping(given, place, f"the value {name!r}", VALUE_FIELDS)
    reserved = name in ("device", "self") or keyword.iskeyword(name)
    if not _NAME.fullmatch(name) or len(name) > 40 or reserved:
        found.add(place, f"{name!r} is no usable name of a value", "write a short word in lower case, not `device`")
    kind = value.get("type")
    if kind not in TYPES:
        found.add((*place, "type"), f"the value {name!r} has no type", f"write one of {', '.join(TYPES)}")
    for bound in ("minimum", "maximum"):
        if bound in value and not _fits(value[bound], kind):
            found.add((*place, bound), f"{bound!r} of {name!r} is no {kind if kind in TYPES else 'number'}")
    low, high = (value.get(bound) if _fits(value.get(bound), kind) else None for bound in ("minimum", "maximum"))
    if low is not None and high is not None and low > high:
        found.add(place, f"the minimum of {name!r} is above its maximum")
    choices = _choices(found, value, kind, place)
    about, unit = (found.text(value, member, place, "") for member in ("about", "unit"))
    return Value(name, str(kind), about, unit, low, high, choices)


def _fits(bound: object, kind: object) -> bool:
    if isinstance(bound, bool) or kind not in ("integer", "number"):
        return False
    if not isinstance(bound, int) and not (kind == "number" and isinstance(bound, float)):
        return False
    return math.isfinite(bound) and abs(bound) <= LARGEST


def _choices(found: _Found, value: Mapping[str, Any], kind: object, place: Place) -> tuple[str, ...]:
    if "enum" not in value:
        return ()
    given = value["enum"]
    words = given if isinstance(given, list) else []
    sound = [word for word in words if isinstance(word, str) and _PRINTABLE.fullmatch(word) and len(word) <= 40]
    if kind != "string" or not 1 <= len(words) <= MOST_CHOICES or len(set(sound)) < len(words):
        summary = f"`enum` is no list of 1 to {MOST_CHOICES} different short words of a string"
        found.add((*place, "enum"), summary, "put the words in quotes")
        return ()
    return tuple(sound)


def _closed(found: _Found, value: Value, effect: object, place: Place) -> None:
    """A caller chooses only among what stands here."""
    if value.type == "string" and not value.choices:
        hint = "list the words with enum: [...]; a text that a caller chooses freely would be a raw pipe"
        found.add(place, f"the parameter {value.name!r} takes any text", hint)
    given = sum(bound is not None for bound in (value.minimum, value.maximum))
    if value.type in ("integer", "number") and given < 2 and (effect != "read" or given):
        hint = "give it a minimum and a maximum; nothing is moved by a number without bounds"
        found.add(place, f"the parameter {value.name!r} is not bounded on both sides", hint)


def _agree(found: _Found, pattern: str, values: tuple[Value, ...], place: Place, what: str) -> None:
    """Each placeholder is declared, each declared value is used."""
    if not _well_formed(pattern):
        found.add(place, "a brace here is no placeholder", "write {name}, in lower case")
        return
    used, declared = set(_names(pattern)), {value.name for value in values}
    for name in sorted(used - declared):
        near = did_you_mean(name, sorted(declared))
        hint = f"did you mean {near!r}?" if near else f"declare it under {what}"
        found.add(place, f"the placeholder {{{name}}} is not among the {what}", hint)
    for name in sorted(declared - used):
        found.add(
            (*place[:-1], what, name), f"{name!r} is declared and not used", f"write {{{name}}} into {place[-1]!r}"
        )


def _apart(found: _Found, reply: str, place: Place) -> None:
    names = list(_names(reply))
    if len(set(names)) < len(names) or "}{" in reply:
        found.add(
            place, "two values of the reply cannot be told apart", "each stands once, with fixed text between them"
        )


def _names(pattern: str) -> Iterator[str]:
    return (match[1] for match in _PLACEHOLDER.finditer(pattern))


def _well_formed(pattern: str) -> bool:
    return not set(_PLACEHOLDER.sub("", pattern)) & set("{}")
