"""What every kind of protocol definition has in common: values, tools, and the problems met while it is read. Pure."""

import keyword
import math
from collections.abc import Collection, Mapping
from typing import Any

from octoform.base import durations
from octoform.diagnostics import did_you_mean
from octoform.frontmatter import Place
from octoform.patterns import regex
from octoform.records import dataclass, field

MAX_CHARS = 200
MAX_UNIT = 40
MAX_BAUD = 100_000_000
LARGEST = 2**53
PRINTABLE = regex(r"[ -~]+")
NAME = regex(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_TOOL = regex(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)+")
_RAW_VERBS = frozenset({"send", "write", "transmit", "execute", "run", "put", "forward", "query"})
_RAW_NOUNS = frozenset(
    {
        "command",
        "commands",
        "cmd",
        "line",
        "lines",
        "serial",
        "bytes",
        "data",
        "text",
        "string",
        "register",
        "registers",
    }
)
_RAW = frozenset({"raw", "passthrough", "exec", "eval", "shell", "gcode", "scpi"})

Problem = tuple[Place, str, str | None]


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of a command or a field of its answer: integer, number, boolean, or (with ``choices``) a word.

    A parameter with a ``default`` may be omitted from a call. ``words`` are what a line reports for false and for true.
    """

    name: str
    type: str
    about: str = ""
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    default: float | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Tool:
    """The tool of a command of any kind of definition: its name, its effect and its parameters.

    ``do`` is the action of the device where no line of a protocol definition has it. ``stop`` ends a movement.
    """

    tool: str
    about: str
    effect: str
    parameters: tuple[Value, ...] = ()
    do: str = ""

    @property
    def stops(self) -> bool:
        return self.do == "stop"


def plain_value(value: Value) -> dict[str, Any]:
    """A value as JSON; members without a value are omitted."""
    bounds = {"minimum": value.minimum, "maximum": value.maximum, "enum": list(value.choices) or None}
    fields = {"about": value.about or None, "unit": value.unit or None, "words": list(value.words) or None}
    return present({"type": value.type, **fields, **bounds, "default": value.default})


def plain_values(values: tuple[Value, ...]) -> dict[str, Any]:
    """Values as JSON, by their names."""
    return {item.name: plain_value(item) for item in values}


def present(members: Mapping[str, Any]) -> dict[str, Any]:
    """The members that have a value."""
    return {name: value for name, value in members.items() if value is not None}


@dataclass
class Found:
    """The problems so far. Each reader gives something usable back, whatever it was given."""

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
                self.add((*place, name), f"{name!r} is no field here", near(str(name), known, "known fields: "))
        return value

    def text(self, given: Mapping[str, Any], name: str, place: Place, default: str | None = None) -> str:
        """A short text of printable ASCII; with ``default`` None it must be there."""
        value = given.get(name, default)
        if isinstance(value, str) and value.strip() and len(value) <= MAX_CHARS and PRINTABLE.fullmatch(value):
            return value
        if value == default == "":
            return ""
        if name not in given:
            self.add((*place, name), f"{name!r} is missing", f'write {name}: "..."')
            return ""
        hint = "a line's end and control characters do not belong in it; the field `ending` ends a line"
        self.add((*place, name), f"{name!r} is not a string of 1 to {MAX_CHARS} printable ASCII characters", hint)
        return ""

    def whole(
        self, given: Mapping[str, Any], name: str, place: Place, span: tuple[int, int], default: int | None = None
    ) -> int:
        """An integer within ``span``, both ends included; with ``default`` None it must be there."""
        value = given.get(name, default)
        if isinstance(value, int) and not isinstance(value, bool) and span[0] <= value <= span[1]:
            return value
        self.add((*place, name), f"{name!r} is not an integer from {span[0]} to {span[1]}")
        return span[0]

    def number(self, given: Mapping[str, Any], name: str, place: Place) -> float:
        """A number that is there; integers stay whole."""
        value = given.get(name)
        if isinstance(value, int | float) and is_number(value):
            return value
        self.add((*place, name), f"{name!r} is no number")
        return 0

    def seconds(
        self, given: Mapping[str, Any], name: str, place: Place, span: tuple[int, int], default: int | None = None
    ) -> float:
        """A duration within ``span`` seconds; with ``default`` None it must be there."""
        value = given.get(name)
        seconds = durations.seconds(value) if isinstance(value, str) else default if value is None else None
        if seconds is None or not span[0] <= seconds <= span[1]:
            summary = f"{name!r} is no duration from {span[0]}s to {span[1]}s"
            self.add((*place, name), summary, durations.HINT)
            return span[0]
        return seconds

    def unit(self, given: Mapping[str, Any], place: Place) -> str:
        """The unit of a number: a short text, or nothing."""
        value = given.get("unit", "")
        if isinstance(value, str) and len(value) <= MAX_UNIT and (not value or PRINTABLE.fullmatch(value)):
            return value
        self.add((*place, "unit"), f"'unit' is not a string of at most {MAX_UNIT} characters", "write for example V")
        return ""

    def named(self, name: object, known: Collection[str], place: Place, what: str) -> str:
        """A name that is among ``known``."""
        if isinstance(name, str) and name in known:
            return name
        self.add(place, f"{name!r} is no {what}", near(str(name), known, "known: ") if known else None)
        return ""

    def tool(self, name: object, place: Place) -> str:
        """The name of a tool that does not promise to pass on whatever it is given."""
        if not (isinstance(name, str) and _TOOL.fullmatch(name) and len(name) <= 64):
            hint = "write two words or more in lower case with underscores: rail_home"
            self.add(place, "the command has no usable tool name", hint)
            return ""
        words = set(name.split("_"))
        if words & _RAW or (words & _RAW_VERBS and words & _RAW_NOUNS):
            hint = "name what the product does: a tool for each thing, never one that passes on its input unchanged"
            self.add(place, f"the tool {name!r} would be a raw pipe to the device", hint)
        return name

    def distinct(self, tools: list[tuple[str, Place]]) -> None:
        """Each tool stands once; ``tools`` are names and where they stand."""
        seen: set[str] = set()
        for name, place in tools:
            if name and name in seen:
                self.add(place, f"the tool {name!r} occurs twice", "give each command its own tool")
            seen.add(name)

    def items(self, given: object, place: Place, most: int, hint: str) -> list[Any]:
        """The commands of a protocol definition, as they are."""
        if isinstance(given, list) and 1 <= len(given) <= most:
            return given
        self.add(place, f"the protocol definition has no list of 1 to {most} commands", hint)
        return []


def near(name: str, known: Collection[str], otherwise: str) -> str:
    """The hint for a name that is not known."""
    guess = did_you_mean(name, list(known))
    return f"did you mean {guess!r}?" if guess else f"{otherwise}{', '.join(known)}"


def is_number(value: object) -> bool:
    """Whether it is a finite number that every reader of JSON keeps as it is."""
    return (
        not isinstance(value, bool)
        and isinstance(value, int | float)
        and math.isfinite(value)
        and abs(value) <= LARGEST
    )


def is_value_name(name: str, taken: Collection[str] = ()) -> bool:
    """Whether a parameter or a field can be called so."""
    reserved = name in ("device", "self", *taken) or keyword.iskeyword(name)
    return bool(NAME.fullmatch(name)) and len(name) <= 40 and not reserved
