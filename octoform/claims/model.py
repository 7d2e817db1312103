"""Readings and claims as values.

A claim is no sentence that one believes: it is a condition on a signal, it cites the readings at which the condition
held, and it is in force only until a fresh reading of that signal contradicts it or its time is over. (Light.)
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from octoform import conditions
from octoform.conditions import is_number
from octoform.records import dataclass, field

Value = bool | int | float | str | None


class Channel(StrEnum):
    """Where a reading comes from; each is evidence of its own."""

    LOG = "log"
    """A call's line in the execution log: source is the tool, path ``/ok`` (bool) or ``/error`` (class name)."""
    FRAME = "frame"
    """A picture: source is the camera's device id, path ``/trouble``, ``/mean``, ``/spread``."""
    SENSOR = "sensor"
    """A read tool's structured result: source is the tool, path a JSON pointer in it."""
    KERNEL = "kernel"
    """Presence of a device: source is the device id, path ``/there``."""
    PROCESS = "process"
    """The endpoint: source ``endpoint``, path ``/running``, ``/answers``."""


@dataclass(frozen=True, slots=True)
class Signal:
    """The measured value. In ``path`` a member of a list has its name if it has one (``/joints/elbow/heat``)."""

    channel: Channel
    source: str
    path: str


@dataclass(frozen=True, slots=True)
class Reading:
    """One value of a signal. ``id`` is unique on the host; ``at`` RFC 3339; ``uptime`` seconds (CLOCK_BOOTTIME).

    ``value`` None: the signal could not be read, and ``why`` states that.
    """

    id: str
    at: str
    uptime: float
    signal: Signal
    value: Value
    why: str = ""


@dataclass(frozen=True, slots=True)
class Condition:
    """``op`` is one of ``>= > <= < == !=``."""

    op: str
    value: Value


class State(StrEnum):
    """A claim's state. ``pending`` waits for a person (`octoform confirm`); the last two are permanent."""

    ACTIVE = "active"
    PENDING = "pending"
    RETIRED = "retired"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class Restriction:
    """The calls that are forbidden while the claim holds.

    ``tool`` is a tool's name; with ``arguments`` only calls that have these values (a joint's name) are concerned.
    ``effect`` is ``deny`` or ``confirm``. Reading and stopping tools can never be restricted.
    """

    tool: str
    arguments: Mapping[str, Value] = field(default_factory=dict)
    effect: str = "deny"


@dataclass(frozen=True, slots=True)
class Claim:
    """``made`` and ``expires`` are seconds of uptime with their stamps beside; ``cites`` are ids of readings.

    ``target`` is as in a finding of the daemon (``device:usb-1a86-55d3/elbow_flex``); ``fault`` a class of the
    playbook. ``by`` is ``watch``, ``heal`` or ``person``. ``irreversible`` names a closed declaration
    (``terminal_lock``, ``disable_unit``, ``fire_risk``) that no one but a person makes true. ``ended`` shows why it is
    retired: ``expired``, ``contradicted``, ``operator``, ``superseded``; ``ended_by`` the readings or the person.
    """

    id: str
    target: str
    fault: str
    statement: str
    signal: Signal
    condition: Condition
    cites: tuple[str, ...]
    by: str
    made_at: str
    made: float
    expires_at: str
    expires: float
    state: State = State.ACTIVE
    restrictions: tuple[Restriction, ...] = ()
    irreversible: str | None = None
    ended: str | None = None
    ended_by: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The kind of the claim in words: temporary, or a permanent restriction (now, or once confirmed)."""
        if self.irreversible is None:
            return "temporary claim"
        return f"permanent restriction {self.irreversible}"


# Whether a condition holds for a value, and which of two conditions is the tighter one.
#
# Nothing is guessed: a value that could not be read, or that is of another kind than the condition's, neither fulfils a
# condition nor contradicts it. Light.

_OTHER_TEXT = "\0"
_FAR = 1e300


def holds(condition: Condition, value: Value) -> bool | None:
    """Whether the condition is fulfilled; None when this value states nothing about it."""
    return conditions.holds(condition.op, condition.value, value)


def tighter(one: Condition, other: Condition) -> bool:
    """Whether ``one`` calls everything a problem that ``other`` does, and more than that."""
    return _covers(one, other) and not _covers(other, one)


def _covers(wide: Condition, narrow: Condition) -> bool:
    points = _points(wide, narrow)
    return all(holds(wide, point) is True for point in points if holds(narrow, point) is True)


def _points(one: Condition, other: Condition) -> list[Value]:
    """Values at which the two can differ: what lies between two of them is like one of them."""
    values = [one.value, other.value]
    if any(isinstance(value, str) for value in values):
        return [*values, _OTHER_TEXT]
    numbers = sorted(float(value) for value in values if is_number(value) and value is not None)
    around = [math.nextafter(number, side) for number in numbers for side in (-math.inf, math.inf)]
    middle = [sum(numbers) / 2] if len(numbers) == 2 else []
    return [True, False, *values, *around, *middle, -_FAR, _FAR]
