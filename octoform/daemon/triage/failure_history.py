"""The memory of triage between looks: a tool that failed is broken until it works, called again or not.

A value that `remember` carries on; `as_json` and `from_json` let it survive a restart of the daemon. (Light.)
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.escaping import escaped
from octoform.daemon.model import Facts
from octoform.endpoint.logs import LoggedCall
from octoform.patterns import regex
from octoform.records import dataclass, field, replace

MAX_TOOLS = 200
MAX_ENDS = 20
CRASH_WINDOW = 300.0
"""Seconds of uptime in which ends of the endpoint's process are counted together."""
SHORT_LIFE = 10.0
"""Seconds: a process that ended sooner crashed rather than was ended by something once."""
MESSAGE_CHARS = 160
OVERDUE = "Overdue"
"""Stands for the class of an exception where a call did not end at all."""
ABSENT, AMBIGUOUS = "DeviceAbsent", "AmbiguousDevice"
_OF_DEVICES = frozenset({ABSENT, AMBIGUOUS})
"""Failures that say where a device is not; once all of them are where they should be, they say nothing any more."""
_CHANGING = regex(r"0x[0-9a-fA-F]+|\b[0-9a-f]{8,}\b|\d+(?:\.\d+)?")


@dataclass(frozen=True, slots=True)
class Failing:
    """A tool that failed and has not worked since: ``times`` in a row, ``said`` is the message without numbers.

    ``first`` and ``last`` are the times of the first and the last of these failures (RFC 3339; empty: not known).
    """

    error: str
    said: str
    message: str
    times: int
    first: str = ""
    last: str = ""


@dataclass(frozen=True, slots=True)
class Recall:
    """``failing`` by tool; ``ends`` are uptimes of short lives that ended; ``instance`` is the process last seen.

    ``instance`` is None when none ran, and empty before the first look: how long a process lived that ran already is
    not known, so its end is no short life.
    ``applied``: there was an endpoint, and no one destroyed it or was at work since who may have.
    ``seen`` is the uptime at which that process was first seen, ``places`` where each device was last seen, in sysfs.
    """

    failing: Mapping[str, Failing] = field(default_factory=dict)
    ends: tuple[float, ...] = ()
    instance: str | None = ""
    seen: float = 0.0
    places: Mapping[str, str] = field(default_factory=dict)
    applied: bool = False


def remember(recall: Recall, facts: Facts) -> Recall:
    """The memory after these facts; call it once for each look, before `judge`."""
    ends, instance, seen = _lives(recall, facts)
    places = {
        **recall.places,
        **{name: each.place for name, each in facts.devices.items() if each.there and each.place},
    }
    applied = facts.busy is None and not facts.destroyed and (facts.applied or recall.applied)
    return Recall(_failing(recall, facts), ends, instance, seen, places, applied)


def as_json(recall: Recall) -> dict[str, Any]:
    """A JSON object of it, without what a restart makes worthless."""
    failing = {
        name: [each.error, each.said, each.message, each.times, each.first, each.last]
        for name, each in recall.failing.items()
    }
    return {
        "failing": failing,
        "ends": list(recall.ends),
        "instance": recall.instance,
        "seen": recall.seen,
        "places": dict(recall.places),
        "applied": recall.applied,
    }


def from_json(value: Mapping[str, Any]) -> Recall:
    """The opposite; LookupError, TypeError or ValueError for what is none."""
    failing = {
        str(name): Failing(str(error), str(text), str(message), int(times), *map(str, stamps[:2]))
        for name, (error, text, message, times, *stamps) in value["failing"].items()
    }
    instance = value["instance"]
    return Recall(
        failing,
        tuple(float(each) for each in value["ends"]),
        None if instance is None else str(instance),
        float(value["seen"]),
        {str(name): str(place) for name, place in value["places"].items()},
        bool(value["applied"]),
    )


def _lives(recall: Recall, facts: Facts) -> tuple[tuple[float, ...], str | None, float]:
    """The short lives that ended, by the process that is seen now against the one before."""
    ends = tuple(each for each in recall.ends if 0 <= facts.uptime - each <= CRASH_WINDOW)
    now = facts.process.instance if facts.process is not None else None
    if now == recall.instance:
        return ends, recall.instance, recall.seen
    if facts.stopped_by is not None or facts.busy is not None:  # it was ended by somebody who meant to
        return ends, now, facts.uptime
    if recall.instance == "":
        return ends, now, 0.0
    if recall.instance is not None and facts.uptime - recall.seen < SHORT_LIFE:
        ends = (*ends, facts.uptime)[-MAX_ENDS:]
    return ends, now, facts.uptime


def _failing(recall: Recall, facts: Facts) -> dict[str, Failing]:
    # A tool that moves something is never called as a test; its devices' readings show that it may work again.
    over = _OF_DEVICES if _found(facts) else frozenset[str]()
    failing = {
        name: each for name, each in recall.failing.items() if name not in facts.worked and each.error not in over
    }
    for call in facts.failures:
        if not call.ok:
            failing[call.tool] = _once_more(failing.get(call.tool), call, facts.stamp)
    # A tool that an apply removed is not missed, and no call could ever show that it works again.
    there = {name: each for name, each in failing.items() if not facts.offered or name in facts.offered}
    return dict(list(there.items())[-MAX_TOOLS:])


def _found(facts: Facts) -> bool:
    """Whether every device of the endpoint is known to be there, and none of them in doubt."""
    return bool(facts.devices) and all(each.there and each.doubt is None for each in facts.devices.values())


def _once_more(before: Failing | None, call: LoggedCall, stamp: str) -> Failing:
    kind = call.error or ("Error" if call.ended else OVERDUE)
    error, message = escaped(kind)[:80], escaped(str(call.message or ""))[:MESSAGE_CHARS]
    found = _CHANGING.sub("#", message)
    if before is None:
        return Failing(error, found, message, 1, stamp, stamp)
    return replace(before, error=error, said=found, message=message, times=before.times + 1, last=stamp)
