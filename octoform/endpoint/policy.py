"""The rules of the endpoint: policy, profiles and INTERFACE combined, for each tool by its name. Pure, light.

The process that holds the devices only enforces; it knows no globs, no defaults and no profiles. Here they are
resolved, once for each publishing. Where several sources speak of one bound the tighter one is taken and named, so no
source can widen what another one set.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from octoform.base import durations
from octoform.manifest.model import Limit, Policy
from octoform.records import dataclass

if TYPE_CHECKING:
    from octoform.profiles.model import Profile


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
        "kind": "goal",
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
Holding = Sequence["tuple[Profile, Collection[str]]"]
"""Profiles, each with the ids of the devices that it holds for."""
Places = Mapping[Place, Range]


@dataclass(frozen=True, slots=True)
class Claim:
    """One limit of one source, as it concerns one tool; texts of times are numbers here."""

    source: str
    limit: Limit
    unit: str = ""
    zero: str = ""
    """The tool whose call brings what is summed up back to where the sum began."""


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
        Bound(tool, limit.parameter, limit.minimum, limit.maximum, f"{claim.source}, for {tool['name']}", limit.units)
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


def _stop(profile: "Profile", ids: Collection[str]) -> Iterator[dict[str, Any]]:
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
                yield Claim(f"profile {profile.name}", _of_profile(item), item.get("unit", ""), zero)
    for index, limit in enumerate(policy.limits):
        if fnmatchcase(tool["name"], limit.tool) and _has_parameter(limit.parameter, tool):
            yield Claim(f"policy.limits[{index}]", limit)
    for item in tool.get("limits", ()):
        own = Limit(tool["name"], item["parameter"], item.get("minimum"), item.get("maximum"))
        yield Claim(INTERFACE, own, item.get("unit", ""))


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


def _of_profile(item: Mapping[str, Any]) -> Limit:
    return Limit(
        tool=item.get("tool", "*"),
        parameter=item.get("parameter"),
        minimum=item.get("minimum"),
        maximum=item.get("maximum"),
        step=item.get("step"),
        cumulative=item.get("cumulative"),
        rate=durations.rate(item["rate"]) if "rate" in item else None,
        cooldown=durations.seconds(item["cooldown"]) if "cooldown" in item else None,
        quiet_hours=durations.hours(item["quiet_hours"]) if "quiet_hours" in item else None,
    )


def _limits(tool: Tool, found: list[Claim]) -> Iterator[dict[str, Any]]:
    """The limits in force: for each parameter, then for calls."""
    found = [claim for claim in found if not claim.limit.units]  # those are of single units, and become limits of goals
    named = dict.fromkeys(claim.limit.parameter for claim in found if claim.limit.parameter is not None)
    for name in named:
        of_it = [claim for claim in found if claim.limit.parameter == name]
        yield from _of_parameter(name, of_it, parameters(tool).get(name))
    yield from _rates(found)
    longest = max((claim for claim in found if claim.limit.cooldown), key=_cooldown, default=None)
    if longest is not None:
        yield {"kind": "cooldown", "seconds": float(_cooldown(longest)), "source": longest.source}
    quiet: dict[tuple[str, str], str] = {}
    for claim in found:
        if claim.limit.quiet_hours is not None:
            quiet.setdefault(claim.limit.quiet_hours, claim.source)
    for (begin, end), source in quiet.items():
        yield {"kind": "quiet_hours", "from": begin, "to": end, "source": source}


def _cooldown(claim: Claim) -> float:
    return claim.limit.cooldown or 0


def _of_parameter(name: str, found: list[Claim], schema: Any) -> Iterator[dict[str, Any]]:
    default = schema.get("default") if isinstance(schema, Mapping) else None
    is_number = isinstance(default, int | float) and not isinstance(default, bool)
    more = {"default": default} if is_number else {}
    low, high = tightest(found, "minimum"), tightest(found, "maximum")
    if low is not None or high is not None:
        ends = {"minimum": low, "maximum": high}
        values = {end: getattr(claim.limit, end) for end, claim in ends.items() if claim is not None}
        yield {
            "kind": "range",
            "parameter": name,
            **values,
            **_unit(low, high, *found),
            **more,
            "source": _source(low, high),
        }
    summed = [("cumulative", [claim for claim in found if claim.zero == zero]) for zero in _zeros(found)]
    for kind, of_it in (("step", found), *summed):
        claim = tightest(of_it, kind)
        if claim is not None:
            most = getattr(claim.limit, kind)
            zero = {"zero": claim.zero} if kind == "cumulative" and claim.zero else {}
            yield {
                "kind": kind,
                "parameter": name,
                "most": most,
                **zero,
                **_unit(claim, *found),
                **more,
                "source": claim.source,
            }


def _zeros(found: Iterable[Claim]) -> list[str]:
    """Sums that begin again at different moments are different sums, and each has its own tightest limit."""
    return list(dict.fromkeys(claim.zero for claim in found if claim.limit.cumulative is not None))


def tightest(found: Iterable[Claim], bound: str) -> Claim | None:
    """The claim with the tightest value of a bound, the first of equal ones; None when no one speaks of it."""
    given = [claim for claim in found if getattr(claim.limit, bound) is not None]
    sign = -1 if bound == "minimum" else 1
    return min(given, key=lambda claim: sign * getattr(claim.limit, bound), default=None)


def _unit(*chosen: Claim | None) -> dict[str, str]:
    units = [claim.unit for claim in chosen if claim is not None and claim.unit]
    return {"unit": units[0]} if units else {}


def _source(low: Claim | None, high: Claim | None) -> str:
    sources = [claim.source for claim in (low, high) if claim is not None]
    if len(set(sources)) == 1:
        return sources[0]
    return f"{sources[0]} (minimum), {sources[1]} (maximum)"


def _rates(found: list[Claim]) -> Iterator[dict[str, Any]]:
    """Rates of several times hold side by side, save those that another one is tighter than in both numbers."""
    first: dict[tuple[int, float], Claim] = {}
    for claim in found:
        if claim.limit.rate is not None:
            first.setdefault(claim.limit.rate, claim)
    for rate, claim in first.items():
        if not any(_is_within(other, rate) for other in first if other != rate):
            yield {"kind": "rate", "calls": rate[0], "seconds": float(rate[1]), "source": claim.source}


def _is_within(other: tuple[int, float], rate: tuple[int, float]) -> bool:
    """Whether the other rate lets no more pass than this one: no more calls in no less time."""
    return other[0] <= rate[0] and other[1] >= rate[1]
