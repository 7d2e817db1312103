"""Which units of a device a call acts on: joints of an arm, axes of a rail. Restrictions and ranges are about units.

A tool is only a way to reach a unit, and most units can be reached in several. So what is forbidden or bounded is
resolved here for each call, from what INTERFACE says of the tool. What cannot be resolved counts as all of them: a
restriction that is too wide is noticed, one that is too narrow is not.
"""

import enum
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import Any


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
    """Where a tool's result says where its units are: in ``field`` of the result, or of each of its ``records``.

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
        """Each unit that the call moves, with its goal as it is given; None where the call does not tell it."""
        if self.goal is None:
            return {}
        if self.goal.fixed:
            return {name: self.goal.fixed.get(name) for name in self.of_call(arguments) if name in self.goal.fixed}
        if self.goal.parameter:
            return dict.fromkeys(self.of_call(arguments), arguments.get(self.goal.parameter))
        stands = {unit: name for name, unit in self.parameters.items()}
        return {unit: arguments.get(stands.get(unit, "")) for unit in self.of_call(arguments)}


def _words(given: Any) -> Iterator[str]:
    """What an argument says, as words: a value, the members of a list, the names of an object."""
    if isinstance(given, enum.Enum):
        given = given.value
    if isinstance(given, Mapping):
        given = list(given)
    if isinstance(given, list | tuple | set | frozenset):
        for each in given:
            yield from _words(each)
    else:
        yield str(given)
