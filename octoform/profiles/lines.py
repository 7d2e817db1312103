"""The protocol definition of a line protocol, as data: which lines a product understands and what it answers. Pure.

A protocol definition is a closed list of typed commands, so an agent can make one tool for each of them and nothing
else: no line reaches the device that is not here, with parameters that keep to what is here.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.diagnostics import did_you_mean
from octoform.frontmatter import Place
from octoform.patterns import regex
from octoform.profiles.definition_forms import (
    MAX_BAUD,
    PRINTABLE,
    Found,
    Tool,
    Value,
    is_number,
    is_value_name,
    plain_values,
    present,
)
from octoform.records import dataclass


@dataclass(frozen=True, slots=True)
class Line:
    """How the product talks: one command a line over the device node of class ``kind``.

    ``ending`` ends a line in both directions, ``ok`` is the answer of a command that was done (None: the product
    acknowledges nothing), ``error`` the pattern of one that was refused (``ERR {message}``; None: it has none).
    ``timeout`` is the longest time until the answer and ``settle`` the pause after the line was opened, in seconds.
    """

    kind: str
    baud: int
    ending: str
    ok: str | None
    error: str | None
    timeout: float
    settle: float = 0.0


@dataclass(frozen=True, slots=True)
class Command:
    """One command and the tool that it becomes; ``send`` and ``reply`` are patterns with ``{name}`` for each value.

    ``send`` empty: nothing is sent, the product speaks by itself. ``reply`` has a pattern for each line of the answer;
    empty: the answer is the protocol definition's ``ok``, and there are no ``fields``.
    """

    tool: str
    send: str
    about: str
    effect: str
    parameters: tuple[Value, ...] = ()
    reply: tuple[str, ...] = ()
    fields: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a counted position: the command that moves it, and the parameter for the distance."""

    name: str
    tool: str
    parameter: str


@dataclass(frozen=True, slots=True)
class Position:
    """A tool that shows where a product without a measurement must be, by what it acknowledged since ``zero``."""

    tool: str
    about: str
    axes: tuple[Axis, ...]
    zero: str


@dataclass(frozen=True, slots=True)
class Halt:
    """A tool after which nothing more is sent to the product, until the command ``until`` went well."""

    tool: str
    about: str
    until: str


@dataclass(frozen=True, slots=True)
class LineDefinition:
    """All that may be sent to a product that is driven by lines of text."""

    line: Line
    commands: tuple[Command, ...]
    position: Position | None = None
    stop: Halt | None = None

    def tools(self) -> tuple[Tool, ...]:
        """One tool for each command, then those that say nothing to the product."""
        found = [Tool(item.tool, item.about, item.effect, item.parameters) for item in self.commands]
        if self.position is not None:
            found.append(Tool(self.position.tool, self.position.about, "read", do="position"))
        if self.stop is not None:
            found.append(Tool(self.stop.tool, self.stop.about, "actuate", do="stop"))
        return tuple(found)


def plain(grammar: LineDefinition) -> dict[str, Any]:
    """The protocol definition as JSON; members without a value are omitted."""
    line, position, stop = grammar.line, grammar.position, grammar.stop
    fields = {"class": line.kind, "baud": line.baud, "ending": line.ending, "ok": line.ok, "error": line.error}
    times = {"timeout": line.timeout, "settle": line.settle or None}
    more: dict[str, Any] = {}
    if position is not None:
        axes = {axis.name: {"tool": axis.tool, "parameter": axis.parameter} for axis in position.axes}
        more["position"] = {"tool": position.tool, "about": position.about, "axes": axes, "zero": position.zero}
    if stop is not None:
        more["stop"] = {"tool": stop.tool, "about": stop.about, "until": stop.until}
    commands = [_present_command(item) for item in grammar.commands]
    commands += [
        {"tool": item.tool, "do": item.do, "about": item.about, "effect": item.effect, "parameters": {}}
        for item in grammar.tools()
        if item.do
    ]
    return {"line": present({**fields, **times}), **more, "commands": commands}


def _present_command(command: Command) -> dict[str, Any]:
    document = {"tool": command.tool, "send": command.send or None, "about": command.about, "effect": command.effect}
    fields = plain_values(command.fields) or None
    parameters = plain_values(command.parameters)
    # One line stands as it was written; several are a list.
    reply = command.reply[0] if len(command.reply) == 1 else list(command.reply) or None
    return present({**document, "parameters": parameters, "reply": reply, "fields": fields})


# Read the definition of a line protocol: every problem of it with its place, or the definition. Pure.
#
# What is refused here is what could make a tool a raw pipe: text that a caller chooses freely, control characters and
# line ends inside a command, a number without bounds that moves something.

FIELDS = ("line", "position", "stop", "commands")
LINE_FIELDS = ("class", "baud", "ending", "ok", "error", "timeout", "settle")
COMMAND_FIELDS = ("tool", "send", "about", "effect", "parameters", "reply", "fields")
VALUE_FIELDS = ("type", "about", "unit", "minimum", "maximum", "enum", "words")
POSITION_FIELDS = ("tool", "about", "axes", "zero")
AXIS_FIELDS = ("tool", "parameter")
STOP_FIELDS = ("tool", "about", "until")
LINE_CLASS = "tty"
ENDINGS = ("\n", "\r", "\r\n")
EFFECTS = ("read", "actuate", "irreversible")
TYPES = ("integer", "number", "string", "boolean")
FALSE_AND_TRUE = ("0", "1")
MAX_COMMANDS, MAX_VALUES, MAX_CHOICES, MAX_AXES, MAX_LINES = 40, 12, 50, 12, 12
_PLACEHOLDER = regex(r"\{([a-z][a-z0-9_]*)\}")
# What stands between quotes in the server's own code, on one line.
_WORD = regex(r"[ -~]{1,40}")
_NO_WORD = frozenset("'\"\\{}")
_EXAMPLE = '{class: tty, baud: 115200, ok: "OK", error: "ERR {message}", timeout: 10s}'
_COMMANDS = 'write commands: [{tool: lamp_off, send: "OFF", about: "switch the lamp off", effect: actuate}]'


def read(found: Found, whole: Mapping[str, Any], place: Place) -> LineDefinition:
    """The protocol definition of a front-matter value, with every problem of it in ``found``."""
    found.mapping(whole, place, "the protocol definition", FIELDS)
    line = _line(found, whole.get("line"), (*place, "line"))
    items = found.items(whole.get("commands"), (*place, "commands"), MAX_COMMANDS, _COMMANDS)
    commands = [_command(found, item, (*place, "commands", index)) for index, item in enumerate(items)]
    # Where nothing is acknowledged, what was done is unknown: it is not counted, and it ends no stop.
    known = [command for command in commands if line.ok is not None or command.reply]
    by_tool = {command.tool: command for command in known if command.tool}
    position = _position(found, whole["position"], (*place, "position"), by_tool) if "position" in whole else None
    stop = _halt(found, whole["stop"], (*place, "stop"), by_tool) if "stop" in whole else None
    tools = [(item.tool, (*place, "commands", index, "tool")) for index, item in enumerate(commands)]
    tools += [(position.tool, (*place, "position", "tool"))] if position is not None else []
    tools += [(stop.tool, (*place, "stop", "tool"))] if stop is not None else []
    found.distinct(tools)
    return LineDefinition(line, tuple(commands), position, stop)


def _position(found: Found, given: object, place: Place, commands: Mapping[str, Command]) -> Position:
    item = found.mapping(given, place, "the position", POSITION_FIELDS)
    tool, about = found.tool(item.get("tool"), (*place, "tool")), found.text(item, "about", place)
    zero = _mover(found, item.get("zero"), (*place, "zero"), commands)
    if zero and commands[zero].parameters:
        hint = "name the command that drives every axis to its origin"
        found.add((*place, "zero"), f"the command {zero!r} takes parameters, so it is no origin", hint)
    axes = item.get("axes")
    if not isinstance(axes, Mapping) or not 1 <= len(axes) <= MAX_AXES:
        hint = "write axes: {x: {tool: rail_move_x, parameter: steps}}"
        found.add((*place, "axes"), f"'axes' is no mapping of 1 to {MAX_AXES} axes", hint)
        axes = {}
    read = [_axis(found, str(name), value, (*place, "axes", name), commands) for name, value in axes.items()]
    moved = [(axis.tool, axis.parameter) for axis in read if axis.tool]
    if len(set(moved)) < len(moved):
        found.add((*place, "axes"), "two axes count the same parameter of one command", None)
    return Position(tool, about, tuple(read), zero)


def _axis(found: Found, name: str, given: object, place: Place, commands: Mapping[str, Command]) -> Axis:
    item = found.mapping(given, place, "an axis", AXIS_FIELDS)
    if not is_value_name(name):
        found.add(place, f"{name!r} is no usable name of an axis", "write a short word in lower case: x")
    tool = _mover(found, item.get("tool"), (*place, "tool"), commands)
    values = {value.name: value for value in commands[tool].parameters} if tool else {}
    parameter = found.named(item.get("parameter"), values, (*place, "parameter"), "parameter of it") if tool else ""
    if parameter and values[parameter].type not in ("integer", "number"):
        found.add((*place, "parameter"), f"the parameter {parameter!r} is no number that could be added up")
    return Axis(name, tool, parameter)


def _halt(found: Found, given: object, place: Place, commands: Mapping[str, Command]) -> Halt:
    item = found.mapping(given, place, "the stop", STOP_FIELDS)
    tool, about = found.tool(item.get("tool"), (*place, "tool")), found.text(item, "about", place)
    return Halt(tool, about, _mover(found, item.get("until"), (*place, "until"), commands))


def _mover(found: Found, name: object, place: Place, commands: Mapping[str, Command]) -> str:
    """The name of a command that moves something: the effect of a read is no movement."""
    tool = found.named(name, commands, place, "command of this protocol definition that is acknowledged")
    if tool and commands[tool].effect == "read":
        found.add(place, f"the command {tool!r} is a read and moves nothing")
    return tool


def _line(found: Found, given: object, place: Place) -> Line:
    line = found.mapping(given, place, "the line of the protocol definition", LINE_FIELDS)
    baud, ending = line.get("baud"), line.get("ending", "\n")
    if line.get("class") != LINE_CLASS:
        found.add((*place, "class"), f"the class of the line is not {LINE_CLASS}", f"write line: {_EXAMPLE}")
    if isinstance(baud, bool) or not isinstance(baud, int) or not 1 <= baud <= MAX_BAUD:
        hint = "write for example 115200, also where the product is a USB device that does not care"
        found.add((*place, "baud"), "the baud of the line is not a positive integer", hint)
        baud = 1
    if ending not in ENDINGS:
        found.add((*place, "ending"), "the ending of a line is none that is known", r'write "\n", "\r" or "\r\n"')
    ok = found.text(line, "ok", place) if "ok" in line else None
    if set(ok or "") & set("{}"):
        found.add((*place, "ok"), "`ok` has a placeholder", "the content of an answer is in the `reply` of a command")
    error = found.text(line, "error", place) if "error" in line else None
    if error and (set(_names(error)) - {"message"} or not _well_formed(error)):
        found.add(
            (*place, "error"), "`error` has another placeholder than {message}", 'write for example "ERR {message}"'
        )
    timeout = found.seconds(line, "timeout", place, (1, 60), 5)
    settle = found.seconds(line, "settle", place, (0, 10), 0)
    return Line(LINE_CLASS, baud, str(ending), ok, error, float(timeout), float(settle))


def _command(found: Found, given: object, place: Place) -> Command:
    item = found.mapping(given, place, "a command", COMMAND_FIELDS)
    tool, effect = found.tool(item.get("tool"), (*place, "tool")), item.get("effect")
    if effect not in EFFECTS:
        found.add((*place, "effect"), "the command has no effect", f"write one of {', '.join(EFFECTS)}")
    about = found.text(item, "about", place)
    send = found.text(item, "send", place) if "send" in item else ""
    reply = _reply(found, item, place)
    parameters = _values(found, item, "parameters", place)
    fields = _values(found, item, "fields", place)
    if "send" not in item and (not reply or parameters or effect != "read"):
        hint = "write what is sent; a product that speaks by itself is heard with effect: read and a `reply`"
        found.add((*place, "send"), "the command sends nothing, and does not only listen", hint)
    else:
        _agree(found, [send], parameters, (*place, "send"), "parameters")
    if reply:
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
            hint = "bounds are for parameters; no one keeps a product to what it answers"
            found.add((*place, "fields", value.name), f"the field {value.name!r} has bounds", hint)
    return Command(tool, send, about, str(effect), parameters, tuple(reply), fields)


def _reply(found: Found, item: Mapping[str, Any], place: Place) -> list[str]:
    """The pattern of each line of the answer: one text, or a list of them in the order in which they come."""
    given = item.get("reply")
    if not isinstance(given, list):
        return [found.text(item, "reply", place)] if "reply" in item else []
    if not 1 <= len(given) <= MAX_LINES:
        summary = f"'reply' is no list of 1 to {MAX_LINES} lines"
        found.add((*place, "reply"), summary, 'write for example reply: ["T {celsius}", "H {percent}"]')
        return []
    return [found.text({"reply": line}, "reply", place) for line in given]


def _values(found: Found, item: Mapping[str, Any], name: str, place: Place) -> tuple[Value, ...]:
    given, where = item.get(name, {}), (*place, name)
    if not isinstance(given, Mapping) or len(given) > MAX_VALUES:
        hint = "write {steps: {type: integer, minimum: -2000, maximum: 2000}}"
        found.add(where, f"{name!r} is no mapping of at most {MAX_VALUES} values", hint)
        return ()
    return tuple(_value(found, str(key), value, (*where, key)) for key, value in given.items())


def _value(found: Found, name: str, given: object, place: Place) -> Value:
    value = found.mapping(given, place, f"the value {name!r}", VALUE_FIELDS)
    if not is_value_name(name):
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
    return Value(name, str(kind), about, unit, low, high, choices, words=_words(found, value, kind, place))


def _words(found: Found, value: Mapping[str, Any], kind: object, place: Place) -> tuple[str, ...]:
    """The words of a line for false and for true."""
    if "words" not in value:
        return FALSE_AND_TRUE if kind == "boolean" else ()
    given = value["words"] if isinstance(value["words"], list) else []
    sound = [word for word in given if isinstance(word, str) and _WORD.fullmatch(word) and not set(word) & _NO_WORD]
    if kind != "boolean" or len(given) != 2 or len(set(sound)) != 2:
        hint = 'write the words for false, then for true: words: ["OFF", "ON"]; no quotes or braces in them'
        found.add((*place, "words"), "`words` are no two different words of a boolean", hint)
        return ()
    return tuple(sound)


def _fits(bound: object, kind: object) -> bool:
    return is_number(bound) and (kind == "number" or (kind == "integer" and isinstance(bound, int)))


def _choices(found: Found, value: Mapping[str, Any], kind: object, place: Place) -> tuple[str, ...]:
    if "enum" not in value:
        return ()
    given = value["enum"]
    words = given if isinstance(given, list) else []
    sound = [word for word in words if isinstance(word, str) and PRINTABLE.fullmatch(word) and len(word) <= 40]
    if kind != "string" or not 1 <= len(words) <= MAX_CHOICES or len(set(sound)) < len(words):
        summary = f"`enum` is no list of 1 to {MAX_CHOICES} different short words of a string"
        found.add((*place, "enum"), summary, "put the words in quotes")
        return ()
    return tuple(sound)


def _closed(found: Found, value: Value, effect: object, place: Place) -> None:
    """A caller chooses only among what is here."""
    if value.type == "string" and not value.choices:
        hint = "list the words with enum: [...]; a string that a caller chooses freely would be a raw pipe"
        found.add(place, f"the parameter {value.name!r} takes any string", hint)
    given = sum(bound is not None for bound in (value.minimum, value.maximum))
    if value.type in ("integer", "number") and given < 2 and (effect != "read" or given):
        hint = "give it a minimum and a maximum; nothing is moved by a number without bounds"
        found.add(place, f"the parameter {value.name!r} is not bounded on both sides", hint)


def _agree(found: Found, patterns: list[str], values: tuple[Value, ...], place: Place, what: str) -> None:
    """Each placeholder is declared, each declared value is used."""
    if not all(map(_well_formed, patterns)):
        found.add(place, "a brace here is no placeholder", "write {name}, in lower case")
        return
    used = {name for pattern in patterns for name in _names(pattern)}
    declared = {value.name for value in values}
    for name in sorted(used - declared):
        guess = did_you_mean(name, sorted(declared))
        hint = f"did you mean {guess!r}?" if guess else f"declare it under {what}"
        found.add(place, f"the placeholder {{{name}}} is not among the {what}", hint)
    for name in sorted(declared - used):
        found.add(
            (*place[:-1], what, name), f"{name!r} is declared and not used", f"write {{{name}}} into {place[-1]!r}"
        )


def _apart(found: Found, reply: list[str], place: Place) -> None:
    names = [name for line in reply for name in _names(line)]
    if len(set(names)) < len(names) or any("}{" in line for line in reply):
        found.add(place, "two values of the reply cannot be separated", "write each once, with fixed text between them")


def _names(pattern: str) -> Iterator[str]:
    return (match[1] for match in _PLACEHOLDER.finditer(pattern))


def _well_formed(pattern: str) -> bool:
    return not set(_PLACEHOLDER.sub("", pattern)) & set("{}")
