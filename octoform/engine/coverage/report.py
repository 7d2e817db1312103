"""How much of a host's hardware can be used, as a pure function of the accepted artifacts.

Every device that PROBE listed stands in the report exactly once, with what became of it, so that the figures can be
counted after. What a figure rests on and is not there yet is None, never 0.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

UNKNOWN = "unknown"
INFRASTRUCTURE = "infrastructure"
BESIDE = frozenset(
    {"bus_infrastructure", "no_function", "virtual", "duplicate_path", "out_of_scope", "network_neighbour"}
)
"""Reasons that say: there is nothing here that could be used, or it is counted elsewhere, or it is not this host's."""


OFFERED = "profile_offered"
"""Why a device that could be used has no tool although a profile that comes with octoform matches it."""


class Standing(StrEnum):
    """What became of a device that PROBE listed."""

    USABLE = "usable"
    NAMED = "named"
    UNKNOWN = "unknown"
    LEFT_OUT = "left_out"
    WAITING = "waiting"


class Counted(StrEnum):
    """Where a device counts: among the onboardable ones, as infrastructure, or beside both; ``open`` is not decided."""

    ONBOARDABLE = "onboardable"
    INFRASTRUCTURE = "infrastructure"
    BESIDE = "beside"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class Device:
    """One device of PROBE. Texts are foreign.

    ``identified_as`` to ``tier`` are IDENTIFY's, empty or None where it does not annotate the device. ``reason`` and
    ``detail`` say why it has no tool; ``question`` is the one sentence that an unknown device misses. ``offer`` names a
    profile that comes with octoform and matches, and the line of the manifest that uses it.
    """

    id: str
    seen_as: str
    bus: str
    standing: Standing
    counted: Counted
    identified_as: str = ""
    category: str = ""
    kind: str = ""
    confidence: float | None = None
    method: str = ""
    profile: str = ""
    tier: int | None = None
    answered: bool = False
    capabilities: tuple[str, ...] = ()
    tools: tuple[str, ...] = ()
    reason: str = ""
    detail: str = ""
    question: str = ""
    offer: str = ""

    @property
    def usable(self) -> bool:
        """True for a device that a tool serves and that this user may use."""
        return self.standing is Standing.USABLE


@dataclass(frozen=True, slots=True)
class Share:
    """``usable`` of ``of`` devices."""

    usable: int
    of: int

    @property
    def percent(self) -> float | None:
        """0 to 100; None where there is nothing to be a share of."""
        return 100 * self.usable / self.of if self.of else None


@dataclass(frozen=True, slots=True)
class Group:
    """The annotated devices of one category or class, how many of them have tools, and how many tools those are."""

    name: str
    annotated: int
    usable: int
    tools: int


@dataclass(frozen=True, slots=True)
class Funnel:
    """From all that the operating system shows to tools."""

    enumerated: int
    annotated: int | None
    with_tools: int | None
    tools: int | None


@dataclass(frozen=True, slots=True)
class Coverage:
    """What the artifacts say of one host."""

    devices: tuple[Device, ...]
    funnel: Funnel
    onboardable: Share | None
    with_infrastructure: Share | None
    categories: tuple[Group, ...]
    kinds: tuple[Group, ...]
    denied: tuple[str, ...] = ()

    def of(self, *standings: Standing) -> tuple[Device, ...]:
        """The devices of some standings, in PROBE's order."""
        return tuple(item for item in self.devices if item.standing in standings)

    def left_out(self) -> dict[str, tuple[Device, ...]]:
        """The devices without annotation by the reason, the most frequent first."""
        found: dict[str, list[Device]] = {}
        for item in self.of(Standing.LEFT_OUT):
            found.setdefault(item.reason, []).append(item)
        order = sorted(found, key=lambda reason: (-len(found[reason]), reason))
        return {reason: tuple(found[reason]) for reason in order}


@dataclass(frozen=True, slots=True)
class Ground:
    """What coverage rests on: accepted artifacts by stage, answers and tiers by device, tools denied to all.

    ``closed`` are devices that this user may not use now, each with the sentence that says why; ``offers`` are devices
    that a profile matches which the manifest does not name, each with the profile and the line that names it.
    """

    artifacts: Mapping[str, Any]
    answers: Mapping[str, str] = field(default_factory=dict)
    tiers: Mapping[str, int] = field(default_factory=dict)
    denied: frozenset[str] = frozenset()
    closed: Mapping[str, str] = field(default_factory=dict)
    offers: Mapping[str, str] = field(default_factory=dict)


def coverage(ground: Ground) -> Coverage:
    """The coverage; PROBE's artifact has to be there."""
    devices = tuple(_offered(item, ground.offers.get(item.id, "")) for item in _devices(ground))
    identified, decided = "identify" in ground.artifacts, "interface" in ground.artifacts
    annotated = [item for item in devices if item.category]
    usable = [item for item in annotated if item.tools]
    names = {name for item in usable for name in item.tools}
    return Coverage(
        devices=devices,
        funnel=Funnel(
            enumerated=len(devices),
            annotated=len(annotated) if identified else None,
            with_tools=len(usable) if decided else None,
            tools=len(names) if decided else None,
        ),
        onboardable=_share(devices, Counted.ONBOARDABLE) if decided else None,
        with_infrastructure=_share(devices, Counted.ONBOARDABLE, Counted.INFRASTRUCTURE) if decided else None,
        categories=_groups((item.category, item) for item in annotated),
        kinds=_groups((item.kind or "(none)", item) for item in annotated),
        denied=tuple(sorted(names & ground.denied)),
    )


def _share(devices: Sequence[Device], *counted: Counted) -> Share:
    chosen = [item for item in devices if item.counted in counted]
    return Share(sum(1 for item in chosen if item.usable), len(chosen))


def _groups(named: Iterable[tuple[str, Device]]) -> tuple[Group, ...]:
    """The largest first."""
    members: dict[str, list[Device]] = {}
    for name, item in named:
        members.setdefault(name, []).append(item)
    groups = [
        Group(
            name=name,
            annotated=len(items),
            usable=sum(1 for item in items if item.usable),
            tools=len({tool for item in items for tool in item.tools}),
        )
        for name, items in members.items()
    ]
    return tuple(sorted(groups, key=lambda group: (-group.annotated, group.name)))


def _devices(ground: Ground) -> Iterable[Device]:
    identify, interface = ground.artifacts.get("identify"), ground.artifacts.get("interface")
    annotated = {item["id"]: item for item in (identify or {"devices": []})["devices"]}
    # INTERFACE speaks last: it also says why a device that was annotated has no tool.
    left = {item["id"]: item for stage in (identify, interface) if stage for item in stage["left_out"]}
    tools = tools_by_device(interface)
    for seen in ground.artifacts["probe"]["devices"]:
        name = seen["id"]
        base = {"id": name, "seen_as": seen["name"], "bus": seen["interface"], "answered": name in ground.answers}
        if name in annotated:
            told = _annotated(annotated[name], tools.get(name, ()), left.get(name, {}))
            if told["tools"] and name in ground.closed:
                told |= {"standing": Standing.NAMED, "reason": "not_permitted", "detail": ground.closed[name]}
            yield Device(**base, tier=ground.tiers.get(name), **told)
        else:
            yield Device(**base, **_unannotated(left.get(name)))


def _offered(item: Device, offer: str) -> Device:
    """The device with what is offered for it; where that would help, it is the reason that the device has no tool."""
    if not offer or item.tools or item.counted is not Counted.ONBOARDABLE:
        return replace(item, offer=offer)
    return replace(item, offer=offer, reason=OFFERED, detail=offer)


def tools_by_device(interface: Mapping[str, Any] | None) -> dict[str, tuple[str, ...]]:
    """The names of each device's tools, in INTERFACE's order."""
    found: dict[str, list[str]] = {}
    for tool in (interface or {"tools": []})["tools"]:
        for name in tool["devices"]:
            found.setdefault(name, []).append(tool["name"])
    return {name: tuple(names) for name, names in found.items()}


def _annotated(item: Mapping[str, Any], tools: tuple[str, ...], left: Mapping[str, Any]) -> dict[str, Any]:
    category, question = item["category"], item.get("missing", "")
    without = Standing.UNKNOWN if category == UNKNOWN else Standing.NAMED
    detail = left.get("detail", "")
    return {
        "standing": Standing.USABLE if tools else without,
        "counted": Counted.INFRASTRUCTURE if category == INFRASTRUCTURE else Counted.ONBOARDABLE,
        "identified_as": item["identified_as"],
        "category": category,
        "kind": item.get("class", ""),
        "confidence": item["confidence"],
        "method": item["method"],
        "profile": item.get("profile", ""),
        "capabilities": tuple(one["name"] for one in item["capabilities"]),
        "tools": tools,
        "reason": "" if tools else left.get("reason", ""),
        "detail": "" if tools or detail == question else detail,
        "question": question if category == UNKNOWN else "",
    }


def _unannotated(left: Mapping[str, Any] | None) -> dict[str, Any]:
    if left is None:
        return {"standing": Standing.WAITING, "counted": Counted.OPEN}
    reason = left["reason"]
    return {
        "standing": Standing.LEFT_OUT,
        "counted": Counted.BESIDE if reason in BESIDE else Counted.ONBOARDABLE,
        "reason": reason,
        "detail": left.get("detail", ""),
    }
