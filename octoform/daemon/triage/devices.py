"""Devices that went, came back somewhere else, or may be another one; and hardware that PROBE never saw.

A device that is gone is waited for: its tools stay and say that it is absent. Only hardware that appeared, or that went
without being one of the endpoint's devices, is a reason to discover again.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence

from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair, Sighting

_CLASS = re.compile(r"^class:(?P<name>.+):(?P<count>\d+)$")


def judged(facts: Facts, before: Facts | None) -> Iterator[Finding]:
    """A finding for each device that is not where it was written down to be."""
    for name, now in sorted(facts.devices.items()):
        former = before.devices.get(name) if before is not None else None
        finding = _doubt(name, now) or _gone(name, now) or _moved(name, now, former)
        if finding is not None:
            yield finding


def hardware(facts: Facts, before: Facts | None) -> Iterator[Finding]:
    """Kinds of hardware that appeared, or went and were none of the endpoint's devices.

    What only went must be gone in two looks: a loose plug is out and in again before its device is asked for.
    """
    appeared, gone = changes(facts.appeared, facts.gone)
    absent = any(each.there is False for each in facts.devices.values())
    lasts = before is not None and (before.appeared, before.gone) == (facts.appeared, facts.gone)
    if not appeared and (not gone or absent or not lasts):
        return
    words = [f"{len(appeared)} appeared"] * bool(appeared) + [f"{len(gone)} went"] * bool(gone)
    yield Finding(
        Kind.HARDWARE_CHANGED,
        FaultClass.DEVICE_MOVED,
        "hardware",
        f"hardware is not what PROBE saw: {', '.join(words)}",
        (*(f"+{each}" for each in appeared), *(f"-{each}" for each in gone)),
        Repair.REDISCOVER,
        (Repair.REDISCOVER, Repair.PERSON),
        data={"appeared": list(appeared), "gone": list(gone)},
    )


def changes(appeared: Sequence[str], gone: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(appeared, gone) with counts of classes as what they say: fewer of a class is nothing that appeared."""
    more, fewer = _counts(appeared), _counts(gone)
    up = [f"class:{name}:+{more[name] - fewer[name]}" for name in sorted(more) if more[name] > fewer[name]]
    down = [f"class:{name}:-{fewer[name] - more[name]}" for name in sorted(fewer) if fewer[name] > more[name]]
    plain = [tuple(sorted(each for each in entries if not _CLASS.match(each))) for entries in (appeared, gone)]
    return (*plain[0], *up), (*plain[1], *down)


def _counts(entries: Sequence[str]) -> Counter[str]:
    found: Counter[str] = Counter()
    for match in filter(None, map(_CLASS.match, entries)):
        found[match["name"]] += int(match["count"])
    return found


def _doubt(name: str, now: Sighting) -> Finding | None:
    if now.doubt is None:
        return None
    summary = f"which device {name} is cannot be told for certain, so nothing that moves is called on it"
    kind, fault, target = Kind.DEVICE_DOUBTFUL, FaultClass.DEVICE_MOVED, f"device:{name}"
    return Finding(kind, fault, target, summary, ("in doubt",), Repair.PERSON, detail=now.doubt[:400])


def _gone(name: str, now: Sighting) -> Finding | None:
    if now.there is not False:
        return None
    summary = f"{name} is not there; its tools work again once it is"
    return Finding(Kind.DEVICE_GONE, FaultClass.DEVICE_MOVED, f"device:{name}", summary, ("gone",), Repair.WAIT)


def _moved(name: str, now: Sighting, former: Sighting | None) -> Finding | None:
    written = now.recorded or (former.place if former is not None else None)
    if not now.there or now.place is None or written is None or written == now.place:
        return None
    back = former is not None and former.there is False
    summary = f"{name} {'is back' if back else 'is'} in another place than the one that was written down"
    return Finding(
        Kind.DEVICE_BACK if back else Kind.DEVICE_MOVED,
        FaultClass.DEVICE_MOVED,
        f"device:{name}",
        summary,
        ("moved", now.place),
        Repair.REBIND,
        (Repair.REBIND, Repair.PERSON),
        data={"device": name, "from": written, "to": now.place},
    )
