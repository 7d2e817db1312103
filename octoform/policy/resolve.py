"""The rules of the endpoint: policy, profiles and INTERFACE combined, for each tool by its name. Pure, light.

The process that holds the devices only enforces; it knows no globs, no defaults and no profiles. Here they are
resolved, once for each publishing. Where several sources speak of one bound the tighter one is taken and named, so no
source can widen what another one set.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from octoform.policy import Claim, Limit
from octoform.policy.kinds import STATED, Goal, values
from octoform.records import dataclass

if TYPE_CHECKING:
    from typing import Protocol

    class Source(Protocol):
        """A profile, as far as it is about calls."""

        @property
        def name(self) -> str: ...
        @property
        def limits(self) -> Sequence[Mapping[str, Any]]: ...
        @property
        def stop(self) -> Sequence[Any]: ...


# What a manifest lets the endpoint's tools do, as frozen values: decisions, limits, times.
#
# It speaks of tools by globs, since which tools there will be is only known once INTERFACE is accepted.

MODES = ("enforce", "shadow", "dry_run")
EFFECTS = ("read", "actuate", "irreversible")
DECISIONS = ("allow", "confirm", "deny")
TIMEOUT = "30s"
RESULT_BYTES = 10_000_000


@dataclass(frozen=True, slots=True)
class Rule:
    """``decision`` (``allow``, ``confirm``, ``deny``) for every tool whose name one of the globs matches."""

    tools: tuple[str, ...]
    decision: str

    def matches(self, name: str) -> bool:
        """True for a tool of that name."""
        return any(fnmatchcase(name, glob) for glob in self.tools)


@dataclass(frozen=True, slots=True)
class Policy:
    """Decisions by effect class and by rules (the first that matches decides), limits, seconds and bytes.

    ``timeouts`` are (glob, seconds).
    """

    mode: str = "enforce"
    read: str = "allow"
    actuate: str = "confirm"
    irreversible: str = "confirm"
    rules: tuple[Rule, ...] = ()
    limits: tuple[Limit, ...] = ()
    timeout: float = 30
    timeouts: tuple[tuple[str, float], ...] = ()
    result_bytes: int = RESULT_BYTES

    def decision_for(self, effect: str) -> str:
        """The decision for tools of an effect class that no rule names."""
        return {"read": self.read, "actuate": self.actuate, "irreversible": self.irreversible}[effect]

    def timeout_for(self, name: str) -> float:
        """Seconds that one call of a tool may take.

        A mapping has no order, so of several globs the most specific one decides: a name in full, then the one with
        the most fixed characters; of equal ones the shortest time.
        """
        found = [(_weight(glob), -length) for glob, length in self.timeouts if fnmatchcase(name, glob)]
        return -max(found)[1] if found else self.timeout


def _weight(glob: str) -> tuple[bool, int]:
    fixed = sum(1 for sign in glob if sign not in "*?")
    return fixed == len(glob), fixed


# Ranges of places on the units of a device, brought to every tool that moves these units. Pure, light.
#
# A range is written for the parameter of one tool; what it protects is a joint or an axis, which other tools move too,
# one by one or in a pose. So each range of a place is collected by device, quantity and unit, and then holds for the
# goals of every tool, whichever parameter of that tool is the goal.

Tool = Mapping[str, Any]
Place = tuple[str, str, str]
"""(device, quantity, unit of the device)"""


@dataclass(frozen=True, slots=True)
class Bound:
    """One range of a source: of the value of ``parameter`` in calls of ``tool``, for ``units`` alone where some are."""

    tool: Tool
    parameter: str
    minimum: float | None
    maximum: float | None
    source: str
    units: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Range:
    """The tightest ends so far, each with who set it."""

    minimum: float | None = None
    maximum: float | None = None
    low: str = ""
    high: str = ""

    def within(self, bound: Bound) -> "Range":
        """This range, narrowed by a bound."""
        found = self
        if bound.minimum is not None and (found.minimum is None or bound.minimum > found.minimum):
            found = Range(bound.minimum, found.maximum, bound.source, found.high)
        if bound.maximum is not None and (found.maximum is None or bound.maximum < found.maximum):
            found = Range(found.minimum, bound.maximum, found.low, bound.source)
        return found


def ranges(bounds: Iterable[Bound]) -> dict[Place, Range]:
    """The tightest range of each unit's place."""
    found: dict[Place, Range] = {}
    for bound in bounds:
        of = (bound.tool.get("units") or {}).get("goal", {}).get("of")
        for unit in _bounded(bound) if of else ():
            for device in bound.tool["devices"]:
                place = (device, of, unit)
                found[place] = found.get(place, Range()).within(bound)
    return found


def limits(tool: Tool, known: Mapping[Place, Range]) -> Iterator[dict[str, Any]]:
    """The limits on the goals of a tool: those that are tighter than what the tool keeps to anyway."""
    fields = tool.get("units") or {}
    goal = fields.get("goal") or {}
    for unit in fields.get("names", ()) if goal else ():
        found = _of_all(tool, known, goal["of"], unit)
        if _is_tighter(found, _inherent(goal, unit)):
            yield _limit(found, goal, unit)


def reported(tool: Tool, known: Mapping[Place, Range]) -> Iterator[dict[str, Any]]:
    """The ranges against which the places are held that the device reports after a call of a tool."""
    fields = tool.get("units") or {}
    goal = fields.get("goal") or {}
    for unit in fields.get("names", ()) if goal else ():
        if (found := _of_all(tool, known, goal["of"], unit)) != Range():
            yield _limit(found, goal, unit)


def fixed_outside(tool: Tool, known: Mapping[Place, Range]) -> Iterator[tuple[str, float, str]]:
    """(unit, place, who limits it) of each fixed place of a tool that is outside of its range: no call will pass."""
    fixed = ((tool.get("units") or {}).get("goal") or {}).get("fixed") or {}
    for limit in limits(tool, known):
        place = fixed.get(limit["of"])
        low, high = limit.get("minimum"), limit.get("maximum")
        if place is not None and ((low is not None and place < low) or (high is not None and place > high)):
            yield limit["of"], place, limit["source"]


def _of_all(tool: Tool, known: Mapping[Place, Range], quantity: str, unit: str) -> Range:
    """The tightest range of a unit's place over all devices of a tool."""
    found = Range()
    for device in tool["devices"]:
        each = known.get((device, quantity, unit), Range())
        found = found.within(Bound(tool, "", each.minimum, None, each.low))
        found = found.within(Bound(tool, "", None, each.maximum, each.high))
    return found


def _limit(found: Range, goal: Mapping[str, Any], unit: str) -> dict[str, Any]:
    ends = {"minimum": found.minimum, "maximum": found.maximum}
    return {
        "kind": Goal.name,
        "of": unit,
        **{name: value for name, value in ends.items() if value is not None},
        **({"unit": goal["unit"]} if goal.get("unit") else {}),
        "source": _range_source(found),
    }


def _bounded(bound: Bound) -> tuple[str, ...]:
    """The units whose place the parameter of a bound is."""
    result = bound.tool["units"]
    if bound.parameter == result["goal"].get("parameter"):
        found = tuple(result["names"])
    else:
        found = tuple(unit for name, unit in result.get("parameters", {}).items() if name == bound.parameter)
    return tuple(unit for unit in found if not bound.units or unit in bound.units)


def _inherent(goal: Mapping[str, Any], unit: str) -> tuple[float | None, float | None]:
    """Where the tool itself never leaves: its one place, or the range that INTERFACE states."""
    if unit in goal.get("fixed", {}):
        return goal["fixed"][unit], goal["fixed"][unit]
    return goal.get("minimum"), goal.get("maximum")


def _is_tighter(found: Range, inherent: tuple[float | None, float | None]) -> bool:
    low, high = inherent
    below = found.minimum is not None and (low is None or low < found.minimum)
    return below or (found.maximum is not None and (high is None or high > found.maximum))


def _range_source(found: Range) -> str:
    if found.low == found.high or not (found.low and found.high):
        return found.low or found.high
    return f"{found.low} (minimum), {found.high} (maximum)"


FORMAT = 1
INTERFACE = "the interface of the tool"
LINE = "it can write to a line without a profile"
"""The origin of a rule that asks a person whatever the effect: the device's behaviour is unknown."""


Holding = Sequence["tuple[Source, Collection[str]]"]
"""Profiles, each with the ids of the devices that it holds for."""
Places = Mapping[Place, Range]


def resolve(policy: Policy, tools: Iterable[Tool], holding: Holding, writing: Collection[str] = ()) -> dict[str, Any]:
    """The content of the endpoint's policy file, JSON-able; ``tools`` are those of an accepted INTERFACE artifact.

    ``writing`` are those whose code can write to a line that neither a profile nor the owner describes.
    """
    listed = list(tools)
    places = places_of(policy, listed, holding)
    return {
        "format": FORMAT,
        "mode": policy.mode,
        "tools": {
            tool["name"]: _tool(policy, tool, holding, places) | _asked(policy, tool, writing) for tool in listed
        },
        "stop": [action for profile, ids in holding for action in _stop(profile, ids)],
    }


def places_of(policy: Policy, tools: Iterable[Tool], holding: Holding) -> Places:
    """The range of each unit's place, no matter who limits it and for whichever tool."""
    return ranges(
        Bound(tool, limit.parameter, *_ends(claim), f"{claim.source}, for {tool['name']}", limit.units)
        for tool in tools
        for claim in claims(policy, tool, holding)
        if (limit := claim.limit).parameter is not None
    )


def _tool(policy: Policy, tool: Tool, holding: Holding, places: Places) -> dict[str, Any]:
    decision, source = _decision(policy, tool)
    return {
        "effect": tool["effect"],
        "decision": decision,
        "source": source,
        "timeout": float(policy.timeout_for(tool["name"])),
        "result_bytes": policy.result_bytes,
        "buses": sorted(tool["devices"]),
        **({"stops": True} if tool.get("stops") else {}),  # then it does not wait for the devices
        **({"units": tool["units"]} if tool.get("units") else {}),
        "limits": [*_limits(tool, list(claims(policy, tool, holding))), *limits(tool, places)],
        **({"places": held} if (held := list(reported(tool, places))) else {}),
    }


def _asked(policy: Policy, tool: Tool, writing: Collection[str]) -> dict[str, str]:
    """A person is asked about what writes to such a line; only a rule of the manifest that names the tool allows it."""
    if tool["name"] not in writing or any(rule.matches(tool["name"]) for rule in policy.rules):
        return {}
    return {} if policy.decision_for(tool["effect"]) == "deny" else {"decision": "confirm", "source": LINE}


def _decision(policy: Policy, tool: Tool) -> tuple[str, str]:
    """The decision on a call, with its rule: the first rule that names the tool, else its effect class."""
    for index, rule in enumerate(policy.rules):
        if rule.matches(tool["name"]):
            return rule.decision, f"policy.rules[{index}]"
    effect = tool["effect"]
    if tool.get("stops") and policy.decision_for(effect) == "confirm":
        return "allow", "what stops a movement waits for no one"
    chosen = policy.decision_for(effect)
    is_default = chosen == Policy().decision_for(effect)
    return chosen, f"default for {effect} tools" if is_default else f"policy.{effect}"


def _stop(profile: "Source", ids: Collection[str]) -> Iterator[dict[str, Any]]:
    for device in sorted(ids):
        for action in profile.stop:
            speed = {} if action.baud is None else {"baud": action.baud}
            place = {"device": device, "class": action.kind, **speed}
            yield {**place, "write": action.write.hex(), "source": f"profile {profile.name}"}


def claims(policy: Policy, tool: Tool, holding: Holding) -> Iterator[Claim]:
    """Every limit that concerns a tool: of profiles that hold for one of its devices, of the policy, of INTERFACE.

    A limit that names a parameter is for the tools that have it.
    """
    for profile, ids in holding:
        if set(ids).isdisjoint(tool["devices"]):
            continue
        for item in profile.limits:
            if is_meant(item, tool) and _has_parameter(item.get("parameter"), tool):
                # One sum stands for all devices of a tool, and another tool brings back only one of them.
                zero = item.get("zero", "") if len(tool["devices"]) == 1 else ""
                yield Claim(f"profile {profile.name}", _limit_of(item, zero))
    for index, limit in enumerate(policy.limits):
        if fnmatchcase(tool["name"], limit.tool) and _has_parameter(limit.parameter, tool):
            yield Claim(f"policy.limits[{index}]", limit)
    for item in tool.get("limits", ()):
        yield Claim(INTERFACE, _limit_of(item))


def is_meant(item: Mapping[str, Any], tool: Tool) -> bool:
    """Whether a profile's limit speaks of a tool, by its name or its capability; without ``tool`` it does of all."""
    glob = item.get("tool")
    return glob is None or any(fnmatchcase(name, glob) for name in (tool["name"], tool["capability"]))


def parameters(tool: Tool) -> Mapping[str, Any]:
    """The parameters of a tool, each with its schema."""
    found = tool["input_schema"].get("properties")
    return found if isinstance(found, Mapping) else {}


def _has_parameter(name: str | None, tool: Tool) -> bool:
    return name is None or name in parameters(tool)


def _limit_of(item: Mapping[str, Any], zero: str = "") -> Limit:
    of, unit = item.get("tool", "*"), item.get("unit", "")
    return Limit(of, item.get("parameter"), unit=unit, zero=zero, **values(item))


def _ends(claim: Claim) -> tuple[float | None, float | None]:
    """The minimum and the maximum of a claim."""
    return claim.value("minimum"), claim.value("maximum")


def _limits(tool: Tool, found: list[Claim]) -> Iterator[dict[str, Any]]:
    """The limits in force: for each parameter, then for calls."""
    found = [claim for claim in found if not claim.limit.units]  # those are of single units, and become limits of goals
    for name in dict.fromkeys(claim.limit.parameter for claim in found if claim.limit.parameter is not None):
        of_it = [claim for claim in found if claim.limit.parameter == name]
        default = default_of(parameters(tool).get(name))
        more = {"parameter": name} if default is None else {"parameter": name, "default": default}
        for kind in STATED:
            if kind.is_of_value:
                yield from kind.resolve(of_it, more)
    for kind in STATED:
        if not kind.is_of_value:
            yield from kind.resolve(found, {})


def default_of(schema: Any) -> float | None:
    """The default of a parameter that is a number; None for another, or without one."""
    default = schema.get("default") if isinstance(schema, Mapping) else None
    return default if isinstance(default, int | float) and not isinstance(default, bool) else None
