"""Keeps the id of each specimen when PROBE runs again, so that no two equal devices change their names unseen.

Ordinals are counted by place: without this, a second PROBE after a re-plug, or after the first of two twins went,
would give one the other's id, and with it its tools and what a person said of it. Pure: values only.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from octoform.base import serials
from octoform.contracts.model import JsonObject

_ORDINAL = re.compile(r"(.+)-([2-9]|[1-9]\d+)")
_CONTENT = ("name", "interface", "raw_descriptor", "vid", "pid")


@dataclass(slots=True)
class Kept:
    """The artifact with its ids as they were, and a sentence for each kind whose specimens could not be told apart."""

    probe: JsonObject
    notices: list[str] = field(default_factory=list)


def judged(probe: JsonObject) -> JsonObject:
    """The artifact with no identity called strong for a serial number that does not tell its unit from its twins.

    Which agent wrote it does not matter: a default number in a ledger would lead an actuator to the wrong twin.
    """
    devices = probe["devices"]
    known = {device["id"] for device in devices}
    numbers: dict[str, list[str]] = {}
    for device in devices:
        numbers.setdefault(_kind(device, known), []).append(str(_instance(device).get("serial") or ""))
    out = []
    for device in devices:
        instance = _instance(device)
        own, others = str(instance.get("serial") or ""), list(numbers[_kind(device, known)])
        others.remove(own)
        said = [device["name"], f"{device.get('vid', '')}{device.get('pid', '')}"]
        if instance.get("strength") == "strong" and own and not serials.tells_apart(own, filter(None, others), said):
            place = "positional" if instance.get("port") else "weak"
            device = {**device, "instance": {**instance, "strength": place}}
        out.append(device)
    return {**probe, "devices": out}


def _kind(device: JsonObject, known: set[str]) -> str:
    return f"{device['vid']}-{device.get('pid')}" if device.get("vid") else _base(device["id"], known)


def keep_ids(probe: JsonObject, shown: JsonObject, before: JsonObject, ledger: Mapping[str, Any]) -> Kept:
    """``probe`` is new, ``shown`` its committed form; ``before`` is what was committed last, ``ledger`` its instances.

    A specimen is the former one by its serial number where that is its identity, else by its path in sysfs with the
    same text. What is left gets the ids that are left, in order. Nothing changes for kinds with one specimen.
    """
    former = {device["id"]: {**device, "instance": ledger.get(device["id"])} for device in before["devices"]}
    ids = [device["id"] for device in probe["devices"]]
    known = {*ids, *former}
    groups: dict[str, list[int]] = {}
    for index, each in enumerate(ids):
        groups.setdefault(_base(each, known), []).append(index)
    kept = Kept({**probe, "devices": list(probe["devices"])})
    for base, places in groups.items():
        old = {name: device for name, device in former.items() if _base(name, known) == base}
        if len(places) > 1 or len(old) > 1:
            _keep(kept, base, [(index, shown["devices"][index]) for index in places], old)
    return kept


def _keep(kept: Kept, base: str, places: list[tuple[int, JsonObject]], old: Mapping[str, JsonObject]) -> None:
    devices = kept.probe["devices"]
    found = [(index, {**said, "instance": devices[index].get("instance")}) for index, said in places]
    given: dict[int, str] = {}
    for same in (_same_number, _same_place):
        for index, device in found:
            free = [name for name, former in old.items() if name not in given.values() and same(device, former)]
            if index not in given and len(free) == 1:
                given[index] = free[0]
    rest = [(index, device) for index, device in found if index not in given]
    missing = [name for name in old if name not in given.values()]
    if len(rest) == len(missing) == 1 and _content(rest[0][1]) == _content(old[missing[0]]):
        given[rest[0][0]] = missing[0]
    elif rest and missing:
        kept.notices.append(_notice(base, missing))
    taken = {*given.values(), *({device["id"] for device in devices} - {devices[index]["id"] for index, _ in found})}
    for index, _ in found:
        if index not in given:
            own = devices[index]["id"]
            given[index] = own if own not in taken else _free(base, taken)
            taken.add(given[index])
    renamed = sorted(({**devices[index], "id": name} for index, name in given.items()), key=_order(base))
    for (index, _), device in zip(found, renamed, strict=True):
        devices[index] = device


def _order(base: str) -> Any:
    return lambda device: int(device["id"].removeprefix(base).removeprefix("-") or 1)


def _free(base: str, taken: set[str]) -> str:
    ordinal = 1
    while (name := base if ordinal == 1 else f"{base}-{ordinal}") in taken:
        ordinal += 1
    return name


def _base(name: str, known: set[str]) -> str:
    """The kind: what stands before an ordinal, where that is an id too."""
    ordinal = _ORDINAL.fullmatch(name)
    return ordinal[1] if ordinal and ordinal[1] in known else name


def _same_number(device: JsonObject, former: JsonObject) -> bool:
    one, other = _instance(device), _instance(former)
    strong = one.get("strength") == other.get("strength") == "strong"
    return strong and bool(one.get("serial")) and one["serial"] == other.get("serial")


def _same_place(device: JsonObject, former: JsonObject) -> bool:
    one, other = _instance(device), _instance(former)
    here = bool(one.get("sysfs")) and one["sysfs"] == other.get("sysfs") and _content(device) == _content(former)
    return here and one.get("serial") == other.get("serial")


def _instance(device: JsonObject) -> Mapping[str, Any]:
    instance = device.get("instance")
    return instance if isinstance(instance, Mapping) else {}


def _content(device: JsonObject) -> tuple[Any, ...]:
    return tuple(device.get(name) for name in _CONTENT)


def _notice(base: str, missing: list[str]) -> str:
    return (
        f"which of the equal devices {', '.join(missing)} is which cannot be told any more: they have no serial number "
        f"of their own and are in other ports; the ids of {base} are counted by port again"
    )
