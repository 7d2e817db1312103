"""What the endpoint may do, as the core resolved it: read once at the start, enforced by everything beside this module.

The launcher decides nothing about policy. Manifest, profiles and interface were brought together when the endpoint was
published, so that the process that holds the devices needs to know none of them. A policy that is damaged, of another
format or says something unforeseen is refused whole: half a policy would be a gate with a hole that nobody sees.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from octoform.base.files import read_json

from .units import Goal, Reports, Units

Mode = Literal["enforce", "shadow", "dry_run"]
Effect = Literal["read", "actuate", "irreversible"]
Decision = Literal["allow", "confirm", "deny"]
Kind = Literal["range", "step", "cumulative", "rate", "cooldown", "quiet_hours", "goal"]

FORMAT = 1
_DAY = 24 * 60


class PolicyInvalid(ValueError):
    """The policy file cannot be used; the text says where and why, in a sentence for a person."""


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit of a tool; which fields count depends on ``kind``, the others keep their defaults.

    range: parameter, minimum, maximum (either may be None). step, cumulative: parameter, most. rate: calls, seconds.
    cooldown: seconds. quiet_hours: begin, end (minutes after midnight, local time; end before begin passes midnight,
    equal ones are the whole day). goal: of (a unit of the device), minimum, maximum of the place to which a call moves
    it, whatever parameter says so. ``default`` is what an absent parameter counts as; None: its call is not judged.
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
    """What holds for one tool. ``timeout`` in seconds, ``result_bytes`` in bytes.

    ``buses`` are the ids of the devices whose calls it waits for: none for a tool that stops a movement, which would
    come too late behind it. Its code takes the lock of a device itself, between two steps of the movement. ``ends``
    are the devices that such a tool stops. ``units`` tells which units of a device a call acts on; None: not known.
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
    """The policy of this file; PolicyInvalid when it cannot be read or says anything that is not foreseen."""
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
    if whole.get("format") != FORMAT:
        raise PolicyInvalid(f"format {whole.get('format')!r} is not known; this launcher reads format {FORMAT}")
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
    """A finite number or null; whole numbers stay whole, so that a refusal shows them as they were written."""
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
        raise PolicyInvalid(f"{place}.{name} is {value!r}, which is no whole number")
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
