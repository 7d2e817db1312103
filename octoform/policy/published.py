"""The endpoint's policy as the core resolved it: read once at the start, enforced by the other modules.

The launcher decides nothing about policy. Manifest, profiles and interface were brought together when the endpoint was
published, so that the process that holds the devices needs to know none of them. A policy that is damaged, of another
format or states something unforeseen is refused whole: half a policy would be a gate with a hole that no one sees.
"""

import enum
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from pathlib import Path
from typing import Any, Literal, cast, get_args

from octoform.base.files import read_json, record
from octoform.base.shape import Fields, string
from octoform.policy import Kind, kinds
from octoform.records import dataclass, field

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

FORMAT = 1


class PolicyInvalid(ValueError):
    """The policy file cannot be used; the text states where and why, in a sentence for a person."""


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
    limits: tuple[Kind, ...] = ()
    ends: tuple[str, ...] = ()
    units: Units | None = None
    places: tuple[kinds.Goal, ...] = ()


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
    try:
        whole = Fields(document, "the policy")
        record(document, FORMAT)
        mode = cast(Mode, whole.one_of("mode", get_args(Mode)))
        tools, stop = Fields(document.get("tools"), "tools"), Fields(document, "").all("stop")
        return Policy(
            mode,
            {name: _tool(tools.fields(name)) for name in tools.items},
            tuple(_stop(Fields(*item)) for item in stop),
        )
    except ValueError as problem:
        raise PolicyInvalid(str(problem)) from None


def stop_actions(path: Path) -> tuple[tuple[StopAction, ...], tuple[str, ...]]:
    """The stop actions of a policy file and what is wrong with it: an emergency stop does all that can be done.

    Nothing else of the file is looked at, and an action that cannot be understood hinders no other.
    """
    try:
        items = list(Fields(read_json(path), "").all("stop"))
    except (OSError, ValueError) as problem:
        return (), (f"{path}: the stop actions cannot be read: {problem}",)
    found, problems = [], []
    for item in items:
        try:
            found.append(_stop(Fields(*item)))
        except ValueError as problem:
            problems.append(f"{path}: {problem}")
    return tuple(found), tuple(problems)


def _tool(item: Fields) -> ToolPolicy:
    buses = tuple(sorted(set(item.strings("buses"))))
    stops = item.flag("stops")
    return ToolPolicy(
        effect=cast(Effect, item.one_of("effect", get_args(Effect))),
        decision=cast(Decision, item.one_of("decision", get_args(Decision))),
        source=item.text("source"),
        timeout=item.positive("timeout"),
        result_bytes=item.whole("result_bytes"),
        buses=() if stops else buses,
        ends=buses if stops else (),
        limits=tuple(kinds.entry(*limit) for limit in item.all("limits")),
        units=_units(item.fields("units")) if item.has("units") else None,
        places=tuple(kinds.Goal.read(Fields(*limit)) for limit in item.all("places")),
    )


def _units(item: Fields) -> Units:
    names, stands = item.fields("names"), item.fields("parameters", {})
    return Units(
        {name: names.strings(name) for name in names.items},
        item.string("parameter"),
        {name: string(unit, stands.place) for name, unit in stands.items.items()},
        _goal(item.fields("goal")) if item.has("goal") else None,
        _reports(item.fields("reports")) if item.has("reports") else None,
    )


def _reports(item: Fields) -> Reports:
    return Reports(item.text("field"), item.string("records"), item.string("unit"), item.number("within") or 0.0)


def _goal(item: Fields) -> Goal:
    fixed = item.fields("fixed", {})
    places = {name: value for name in fixed.items if (value := fixed.number(name)) is not None}
    return Goal(item.text("of"), item.string("parameter"), places, item.string("unit"))


def _stop(item: Fields) -> StopAction:
    written = item.text("write")
    try:
        data = bytes.fromhex(written)
    except ValueError as problem:
        raise ValueError(f"{item.at('write')} is not hexadecimal") from problem
    baud = item.whole("baud") if item.has("baud") else None
    return StopAction(item.text("device"), item.text("class"), baud, data, item.text("source"))
