"""The endpoint's policy as the core resolved it: read once at the start, enforced by the other modules.

The launcher decides nothing about policy. Manifest, profiles and interface were brought together when the endpoint was
published, so that the process that holds the devices needs to know none of them. A policy that is damaged, of another
format or states something unforeseen is refused whole: half a policy would be a gate with a hole that no one sees.
"""

import enum
import math
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast, get_args

from octoform.base.files import read_json, record

# Which units of a device a call acts on: joints of an arm, axes of a rail. Restrictions and ranges are about units.
#
# A tool is only a way to reach a unit, and most units can be reached in several. So what is forbidden or bounded is
# resolved here for each call, from the tool's entry in INTERFACE. What cannot be resolved counts as all of them: a
# restriction that is too wide is noticed, one that is too narrow is not.


@dataclass(frozen=True, slots=True)
class Goal:
    """Where a call moves its units: in ``of`` (a quantity) by the value of ``parameter``, or to ``fixed`` places.

    With neither, the parameter that stands for a unit holds its goal; where none does, the goal is not known.
    """

    of: str
    parameter: str = ""
    fixed: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Reports:
    """Where a tool's result states where its units are: in ``field`` of the result, or of each of its ``records``.

    ``unit`` is the member that names the unit; a place may be ``within`` this beyond a range, as devices stop.
    """

    field: str
    records: str = ""
    unit: str = ""
    within: float = 0.0


@dataclass(frozen=True, slots=True)
class Units:
    """The units that a tool can act on.

    ``names`` has the other words for each. ``parameter`` names the unit of a call, ``parameters`` are parameters that
    stand for one unit each; a call that names none acts on all.
    """

    names: Mapping[str, tuple[str, ...]]
    parameter: str = ""
    parameters: Mapping[str, str] = field(default_factory=dict)
    goal: Goal | None = None
    reports: Reports | None = None

    def of_call(self, arguments: Mapping[str, Any]) -> frozenset[str]:
        """The units that a call with these effective arguments acts on."""
        given = arguments.get(self.parameter) if self.parameter else None
        if given is not None:
            found = [self.called(word) for word in _words(given)]
            known = frozenset(name for name in found if name is not None)
            return known if known and len(known) == len(set(found)) else frozenset(self.names)
        named = {unit for name, unit in self.parameters.items() if arguments.get(name) is not None}
        return frozenset(named or self.names)

    def acts_on(self, words: AbstractSet[str], arguments: Mapping[str, Any]) -> bool:
        """Whether a call with these effective arguments acts on the unit that these words mean."""
        return any({name, *self.names[name]} & words for name in self.of_call(arguments))

    def called(self, word: str) -> str | None:
        """The unit that a word means; None for no unit of this tool."""
        return next((name for name, others in self.names.items() if word == name or word in others), None)

    def goals(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Each unit that the call moves, with its goal as it is given; None where the call does not give it."""
        if self.goal is None:
            return {}
        if self.goal.fixed:
            return {name: self.goal.fixed.get(name) for name in self.of_call(arguments) if name in self.goal.fixed}
        if self.goal.parameter:
            return dict.fromkeys(self.of_call(arguments), arguments.get(self.goal.parameter))
        stands = {unit: name for name, unit in self.parameters.items()}
        return {unit: arguments.get(stands.get(unit, "")) for unit in self.of_call(arguments)}


def _words(given: Any) -> Iterator[str]:
    """The words of an argument: a value, the members of a list, the names of an object."""
    if isinstance(given, enum.Enum):
        given = given.value
    if isinstance(given, Mapping):
        given = list(given)
    if isinstance(given, list | tuple | set | frozenset):
        for each in given:
            yield from _words(each)
    else:
        yield str(given)


Mode = Literal["enforce", "shadow", "dry_run"]
Effect = Literal["read", "actuate", "irreversible"]
Decision = Literal["allow", "confirm", "deny"]
Kind = Literal["range", "step", "cumulative", "rate", "cooldown", "quiet_hours", "goal"]

FORMAT = 1
_DAY = 24 * 60


class PolicyInvalid(ValueError):
    """The policy file cannot be used; the text states where and why, in a sentence for a person."""


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit of a tool; which fields count depends on ``kind``, the others keep their defaults.

    range: parameter, minimum, maximum (either may be None). step, cumulative: parameter, most. rate: calls, seconds.
    cooldown: seconds. quiet_hours: begin, end (minutes after midnight, local time; end before begin passes midnight,
    equal ones are the whole day). goal: of (a unit of the device), minimum, maximum of the place to which a call moves
    it, whatever parameter states that. ``default`` is what an absent parameter counts as; None: its call is not judged.
    ``zero`` of a cumulative one is the tool after whose call the sum begins again at zero.
    """

    kind: Kind
    source: str
    parameter: str = ""
    minimum: float | None = None
    maximum: float | None = None
    most: float = 0.0
    calls: int = 0
    seconds: float = 0.0
    begin: int = 0
    end: int = 0
    unit: str = ""
    default: float | None = None
    zero: str = ""
    of: str = ""

    @property
    def sum(self) -> str:
        """The name under which a cumulative limit counts."""
        return f"{self.parameter} since {self.zero}" if self.zero else self.parameter


@dataclass(frozen=True, slots=True)
class ToolPolicy:
    """The policy of one tool. ``timeout`` in seconds, ``result_bytes`` in bytes.

    ``buses`` are the ids of the devices whose calls it waits for: none for a tool that stops a movement, which would
    come too late behind it. Its code takes the lock of a device itself, between two steps of the movement. ``ends``
    are the devices that such a tool stops. ``units`` shows which units of a device a call acts on; None: not known.
    ``places`` are the ranges that hold for what the device reports of the units that it moves.
    """

    effect: Effect
    decision: Decision
    source: str
    timeout: float
    result_bytes: int
    buses: tuple[str, ...] = ()
    limits: tuple[Limit, ...] = ()
    ends: tuple[str, ...] = ()
    units: Units | None = None
    places: tuple[Limit, ...] = ()


@dataclass(frozen=True, slots=True)
class StopAction:
    """Bytes that the emergency stop writes to the node of a device; ``baud`` None leaves the line as it is."""

    device: str
    kind: str
    baud: int | None
    write: bytes
    source: str


@dataclass(frozen=True, slots=True)
class Policy:
    """The whole of it. A tool that is not in ``tools`` is not to be called."""

    mode: Mode
    tools: Mapping[str, ToolPolicy]
    stop: tuple[StopAction, ...] = ()


def read(path: Path) -> Policy:
    """The policy of this file; PolicyInvalid when it cannot be read or states anything that is not foreseen."""
    try:
        document = read_json(path)
    except (OSError, ValueError) as problem:
        raise PolicyInvalid(f"{path}: the policy cannot be read: {problem}") from problem
    try:
        return parse(document)
    except PolicyInvalid as problem:
        raise PolicyInvalid(f"{path}: {problem}") from problem


def parse(document: Any) -> Policy:
    """The policy in an object as JSON gives it; PolicyInvalid names the place that is wrong."""
    whole = _object(document, "the policy")
    try:
        record(whole, FORMAT)
    except ValueError as problem:
        raise PolicyInvalid(str(problem)) from None
    mode = cast(Mode, _one_of(whole, "mode", get_args(Mode), "the policy"))
    tools = {name: _tool(item, f"tools.{name}") for name, item in _object(whole.get("tools"), "tools").items()}
    stop = tuple(_stop(item, f"stop[{index}]") for index, item in enumerate(_array(whole.get("stop", []), "stop")))
    return Policy(mode, tools, stop)


def stop_actions(path: Path) -> tuple[tuple[StopAction, ...], tuple[str, ...]]:
    """The stop actions of a policy file and what is wrong with it: an emergency stop does all that can be done.

    Nothing else of the file is looked at, and an action that cannot be understood hinders no other.
    """
    try:
        items = _array(_object(read_json(path), "the policy").get("stop", []), "stop")
    except (OSError, ValueError) as problem:
        return (), (f"{path}: the stop actions cannot be read: {problem}",)
    found, problems = [], []
    for index, item in enumerate(items):
        try:
            found.append(_stop(item, f"stop[{index}]"))
        except PolicyInvalid as problem:
            problems.append(f"{path}: {problem}")
    return tuple(found), tuple(problems)


def _tool(document: Any, place: str) -> ToolPolicy:
    item = _object(document, place)
    limits = _array(item.get("limits", []), f"{place}.limits")
    named = _array(item.get("buses", []), f"{place}.buses")
    buses = tuple(sorted({_string(bus, f"{place}.buses") for bus in named}))
    stops = _flag(item, "stops", place)
    units = None if item.get("units") is None else _units(item["units"], f"{place}.units")
    return ToolPolicy(
        effect=cast(Effect, _one_of(item, "effect", get_args(Effect), place)),
        decision=cast(Decision, _one_of(item, "decision", get_args(Decision), place)),
        source=_text(item, "source", place),
        timeout=_positive(item, "timeout", place),
        result_bytes=_whole(item, "result_bytes", place),
        buses=() if stops else buses,
        ends=buses if stops else (),
        limits=tuple(_limit(limit, f"{place}.limits[{index}]") for index, limit in enumerate(limits)),
        units=units,
        places=tuple(
            _numeric("goal", _object(limit, f"{place}.places[{index}]"), f"{place}.places[{index}]")
            for index, limit in enumerate(_array(item.get("places", []), f"{place}.places"))
        ),
    )


def _units(document: Any, place: str) -> Units:
    item = _object(document, place)
    names = {
        name: tuple(_string(word, f"{place}.names") for word in _array(words, f"{place}.names"))
        for name, words in _object(item.get("names"), f"{place}.names").items()
    }
    stands = _object(item.get("parameters", {}), f"{place}.parameters")
    goal = None if item.get("goal") is None else _goal(item["goal"], f"{place}.goal")
    return Units(
        names,
        _string(item.get("parameter") or "", f"{place}.parameter"),
        {name: _string(unit, f"{place}.parameters") for name, unit in stands.items()},
        goal,
        None if item.get("reports") is None else _reports(item["reports"], f"{place}.reports"),
    )


def _reports(document: Any, place: str) -> Reports:
    item = _object(document, place)
    records, unit = (_string(item.get(name) or "", f"{place}.{name}") for name in ("records", "unit"))
    return Reports(_text(item, "field", place), records, unit, _bound(item, "within", place) or 0.0)


def _goal(document: Any, place: str) -> Goal:
    item = _object(document, place)
    fixed = _object(item.get("fixed", {}), f"{place}.fixed")
    return Goal(
        _text(item, "of", place),
        _string(item.get("parameter") or "", f"{place}.parameter"),
        {name: value for name in fixed if (value := _bound(fixed, name, f"{place}.fixed")) is not None},
        _string(item.get("unit") or "", f"{place}.unit"),
    )


def _limit(document: Any, place: str) -> Limit:
    item = _object(document, place)
    kind = cast(Kind, _one_of(item, "kind", get_args(Kind), place))
    source = _text(item, "source", place)
    if kind == "rate":
        return Limit(kind, source, calls=_whole(item, "calls", place), seconds=_positive(item, "seconds", place))
    if kind == "cooldown":
        return Limit(kind, source, seconds=_positive(item, "seconds", place))
    if kind == "quiet_hours":
        return Limit(kind, source, begin=_clock(item, "from", place), end=_clock(item, "to", place))
    return _numeric(kind, item, place)


def _numeric(kind: Kind, item: Mapping[str, Any], place: str) -> Limit:
    """A limit on the value of a parameter."""
    minimum, maximum = _bound(item, "minimum", place), _bound(item, "maximum", place)
    bounds = kind in ("range", "goal")
    if bounds and minimum is None and maximum is None:
        raise PolicyInvalid(f"{place}: a range needs minimum or maximum")
    return Limit(
        kind,
        _text(item, "source", place),
        parameter="" if kind == "goal" else _text(item, "parameter", place),
        minimum=minimum,
        maximum=maximum,
        most=0.0 if bounds else _not_negative(item, "most", place),
        unit=_string(item.get("unit") or "", f"{place}.unit"),
        default=_bound(item, "default", place),
        zero=_string(item.get("zero") or "", f"{place}.zero"),
        of=_text(item, "of", place) if kind == "goal" else "",
    )


def _stop(document: Any, place: str) -> StopAction:
    item = _object(document, place)
    try:
        data = bytes.fromhex(_text(item, "write", place))
    except ValueError as problem:
        raise PolicyInvalid(f"{place}.write is not hexadecimal") from problem
    baud = None if item.get("baud") is None else _whole(item, "baud", place)
    device, kind = _text(item, "device", place), _text(item, "class", place)
    return StopAction(device, kind, baud, data, _text(item, "source", place))


def _object(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise PolicyInvalid(f"{place} is no object")
    return value


def _array(value: Any, place: str) -> list[Any]:
    if not isinstance(value, list):
        raise PolicyInvalid(f"{place} is no array")
    return value


def _string(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise PolicyInvalid(f"{place} is no text")
    return value


def _text(item: Mapping[str, Any], name: str, place: str) -> str:
    text = _string(item.get(name), f"{place}.{name}")
    if not text:
        raise PolicyInvalid(f"{place}.{name} is empty")
    return text


def _flag(item: Mapping[str, Any], name: str, place: str) -> bool:
    value = item.get(name, False)
    if not isinstance(value, bool):
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is neither true nor false")
    return value


def _one_of(item: Mapping[str, Any], name: str, allowed: tuple[str, ...], place: str) -> str:
    value = item.get(name)
    if value not in allowed:
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is none of {', '.join(allowed)}")
    return cast(str, value)


def _bound(item: Mapping[str, Any], name: str, place: str) -> float | None:
    """A finite number or null; integers stay whole, so that a refusal shows them as they were written."""
    value = item.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value or abs(value) == math.inf:
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is no finite number")
    return value


def _not_negative(item: Mapping[str, Any], name: str, place: str) -> float:
    value = _bound(item, name, place)
    if value is None or value < 0:
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is no number of 0 or more")
    return value


def _positive(item: Mapping[str, Any], name: str, place: str) -> float:
    value = _not_negative(item, name, place)
    if value == 0:
        raise PolicyInvalid(f"{place}.{name} is 0; it has to be more")
    return value


def _whole(item: Mapping[str, Any], name: str, place: str) -> int:
    value = _positive(item, name, place)
    if not isinstance(value, int):
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is no integer")
    return value


def _clock(item: Mapping[str, Any], name: str, place: str) -> int:
    """Minutes after midnight of ``HH:MM``; 24:00 is midnight."""
    hours, colon, minutes = _text(item, name, place).partition(":")
    if not (colon and hours.isascii() and hours.isdigit() and minutes.isascii() and minutes.isdigit()):
        raise PolicyInvalid(f"{place}.{name} is no time of day such as 22:00")
    moment = int(hours) * 60 + int(minutes)
    if int(minutes) > 59 or moment > _DAY:
        raise PolicyInvalid(f"{place}.{name} is no time of day such as 22:00")
    return moment % _DAY
