"""Finds rules of a policy that match no tool: believed to be in force, such a rule is worse than none.

The manifest is written before an agent has named the tools, so this can only be checked afterwards. Pure, light.
"""

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from octoform.diagnostics import Diagnostic, did_you_mean, warning
from octoform.policy import tightest
from octoform.policy.kinds import RANGE
from octoform.policy.resolve import (
    Holding,
    Policy,
    Tool,
    claims,
    default_of,
    fixed_outside,
    is_meant,
    parameters,
    places_of,
    reported,
)

_MAX_NAMED = 8


def doubts(policy: Policy, tools: Sequence[Tool], holding: Holding) -> list[Diagnostic]:
    """Warnings for every part of the policy and of the profiles in force that concerns no tool, or lets none pass."""
    return [
        *_globs(policy, tools),
        *_units(policy, tools),
        *_profiles(tools, holding),
        *_contradictions(policy, tools, holding),
        *_defaults(policy, tools, holding),
        *_poses(policy, tools, holding),
        *_unreported(policy, tools),
    ]


def _globs(policy: Policy, tools: Sequence[Tool]) -> Iterator[Diagnostic]:
    names = [tool["name"] for tool in tools]
    for index, rule in enumerate(policy.rules):
        for glob in rule.tools:
            if not any(fnmatchcase(name, glob) for name in names):
                yield _no_tool(f"policy.rules[{index}]", glob, names)
    for index, limit in enumerate(policy.limits):
        place = f"policy.limits[{index}]"
        meant = [tool for tool in tools if fnmatchcase(tool["name"], limit.tool)]
        if not meant:
            yield _no_tool(place, limit.tool, names)
        elif limit.parameter is not None:
            yield from _no_parameter(place, limit.parameter, meant)
    for glob, _ in policy.timeouts:
        if not any(fnmatchcase(name, glob) for name in names):
            yield _no_tool("policy.timeouts", glob, names)


def _no_tool(place: str, glob: str, names: Sequence[str]) -> Diagnostic:
    near = did_you_mean(glob, names)
    hint = f"did you mean {near}?" if near else f"the tools are {_listed(names)}" if names else None
    return warning("POLICY-UNMATCHED", f"{place} has no effect: no tool is called {glob}", hint=hint)


def _no_parameter(place: str, parameter: str, meant: Sequence[Tool]) -> Iterator[Diagnostic]:
    known = list(dict.fromkeys(name for tool in meant for name in parameters(tool)))
    if parameter in known:
        return
    near = did_you_mean(parameter, known)
    hint = f"did you mean {near}?" if near else f"they have {_listed(known)}" if known else "they have none"
    who = _listed([tool["name"] for tool in meant])
    yield warning("POLICY-UNMATCHED", f"{place} has no effect: {who} has no parameter {parameter}", hint=hint)


def _profiles(tools: Sequence[Tool], holding: Holding) -> Iterator[Diagnostic]:
    """Limits of profiles that hold for a device which is served, and that concern none of its tools."""
    for profile, ids in holding:
        served = [tool for tool in tools if not set(ids).isdisjoint(tool["devices"])]
        for item in profile.limits if served else ():
            place = f"a limit of the profile {profile.name}"
            meant = [tool for tool in served if is_meant(item, tool)]
            if not meant:
                yield _no_tool(place, item["tool"], [tool["name"] for tool in served])
            elif "parameter" in item:
                yield from _no_parameter(place, item["parameter"], meant)


def _contradictions(policy: Policy, tools: Sequence[Tool], holding: Holding) -> Iterator[Diagnostic]:
    """Ranges that have nothing in common; the tool refuses every value then."""
    for tool in tools:
        found = list(claims(policy, tool, holding))
        for name in dict.fromkeys(claim.limit.parameter for claim in found):
            of_it = [claim for claim in found if claim.limit.parameter == name]
            low, high = tightest(of_it, "minimum"), tightest(of_it, "maximum")
            if low is None or high is None:
                continue
            least, most = low.value("minimum"), high.value("maximum")
            if least > most:
                yield warning(
                    "POLICY-CONTRADICTION",
                    f"{tool['name']} will refuse every value of {name}: at least {least} ({low.source}) "
                    f"and at most {most} ({high.source})",
                    hint="change one of the two",
                )


def _units(policy: Policy, tools: Sequence[Tool]) -> Iterator[Diagnostic]:
    """Units that a limit names and no tool of it has."""
    for index, limit in enumerate(policy.limits):
        meant = [tool.get("units") or {} for tool in tools if fnmatchcase(tool["name"], limit.tool)]
        placed = [message for message in meant if _is_goal(limit.parameter, message)]
        known = list(dict.fromkeys(name for message in placed for name in message["names"]))
        for unit in limit.units:
            if unit not in known:
                near = did_you_mean(unit, known)
                hint = f"did you mean {near}?" if near else f"the units are {_listed(known)}" if known else None
                text = f"policy.limits[{index}] does not hold for {unit}: {limit.parameter} moves no such unit"
                yield warning("POLICY-UNMATCHED", text, hint=hint)


def _is_goal(parameter: str | None, units: Mapping[str, Any]) -> bool:
    return parameter is not None and parameter in (
        units.get("goal", {}).get("parameter"),
        *(units.get("parameters", {}) if "goal" in units else ()),
    )


def _defaults(policy: Policy, tools: Sequence[Tool], holding: Holding) -> Iterator[Diagnostic]:
    """Ranges without the default of their parameter: every call that leaves the parameter out is refused."""
    for tool in tools:
        found = [claim for claim in claims(policy, tool, holding) if not claim.limit.units]
        for name, schema in parameters(tool).items():
            default = default_of(schema)
            if default is None:
                continue
            of_it = [claim for claim in found if claim.limit.parameter == name]
            low, high = tightest(of_it, "minimum"), tightest(of_it, "maximum")
            if low is not None and default < low.value("minimum"):
                yield _default(tool, name, default, f"at least {low.value('minimum')} ({low.source})")
            elif high is not None and default > high.value("maximum"):
                yield _default(tool, name, default, f"at most {high.value('maximum')} ({high.source})")


def _default(tool: Tool, name: str, default: float, bound: str) -> Diagnostic:
    return warning(
        "POLICY-DEFAULT",
        f"{tool['name']} will refuse every call without {name}: its default is {default}, allowed is {bound}",
        hint="move the limit, or let every caller give a value",
    )


def _poses(policy: Policy, tools: Sequence[Tool], holding: Holding) -> Iterator[Diagnostic]:
    """Tools that move a unit to a fixed place outside of its range: every call is refused."""
    places = places_of(policy, tools, holding)
    for tool in tools:
        for unit, place, source in fixed_outside(tool, places):
            yield warning(
                "POLICY-POSE",
                f"{tool['name']} will refuse every call: it moves {unit} to {place:g}, outside of its range ({source})",
                hint="move the limit, or change the pose in your copy of the profile",
            )


def _unreported(policy: Policy, tools: Sequence[Tool]) -> Iterator[Diagnostic]:
    """Tools that move a unit whose range a person limits, and whose results do not say where it is then."""
    if not any(name in limit.values for limit in policy.limits for name in RANGE):
        return
    places = places_of(policy, tools, ())
    silent = [
        tool["name"] for tool in tools if "reports" not in (tool.get("units") or {}) and any(reported(tool, places))
    ]
    if silent:
        yield warning(
            "POLICY-UNREPORTED",
            f"it is unknown if the device keeps its range after {_listed(silent)}: no result contains its position",
            hint="only the caller's value is checked; run the stage interface again for tools that report",
        )


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_MAX_NAMED])
    return shown if len(names) <= _MAX_NAMED else f"{shown} and {len(names) - _MAX_NAMED} more"
