"""The stage: capabilities to tools, within the budget, and every other device with the reason why it has none.

The budget is the task's number of tools, and the length that the protocol allows a server: what SERVE could not write
must not be promised here. Heavy: renders the server to see how long it gets (jinja2).
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import Any

from octoform.builtin.grammars import Profiles
from octoform.builtin.interface import grammar
from octoform.builtin.interface.catalog import KINDS
from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.legend import legend
from octoform.builtin.interface.reasons import why_left_out
from octoform.builtin.interface.schemas import Schema, one_of
from octoform.builtin.serve.stage import MOST_LINES, lines
from octoform.builtin.task import Refused, Task

Device = Mapping[str, Any]
Owners = dict[str, list[tuple[Device, Mapping[str, Any]]]]
"""Capability name to (device, capability) of each device that has it, in the artifact's order."""


def run(task: Task) -> str:
    """Write the INTERFACE artifact of the task's IDENTIFY artifact; the summary line (``7 tools, 31 left out``)."""
    artifact = declare(task.read_input(), task.tools_budget, task.profiles)
    task.write(artifact)
    tools, left_out = len(artifact["tools"]), len(artifact["left_out"])
    return f"{tools} tool{'s' * (tools != 1)}, {left_out} device{'s' * (left_out != 1)} left out"


def declare(identify: Mapping[str, Any], budget: int, profiles: Profiles = ()) -> dict[str, Any]:
    """The artifact; Refused when the input is no IDENTIFY artifact."""
    try:
        owners = _owners(identify["devices"])
        kinds = {**KINDS, **grammar.kinds(profiles, KINDS)}
        wanted = [kinds[name] for name in kinds if name in owners]
        made = {kind.name: _tool(kind, owners[kind.name]) for kind in wanted}
        allowed = _within(budget, wanted)
        kept = _written(allowed, made, profiles)
        tools = [made[kind.name] for kind in kept]
        cut = [kind for kind in wanted if kind not in kept]
        reason = "tool_budget" if len(allowed) < len(wanted) and kept == allowed else "server_size"
        served = {name for tool in tools for name in tool["devices"]}
        left_out = _left_out(identify, served, _spared(cut, owners), reason)
    except (KeyError, TypeError, AttributeError) as problem:
        raise Refused(f"the IDENTIFY artifact is not as expected: {type(problem).__name__}: {problem}") from problem
    return {"format": 1, "tools": tools, "left_out": left_out}


def _owners(devices: Sequence[Device]) -> Owners:
    owners: Owners = {}
    for device in devices:
        for capability in device["capabilities"]:
            owners.setdefault(capability["name"], []).append((device, capability))
    return owners


def _within(budget: int, wanted: Sequence[Kind]) -> list[Kind]:
    """The tools that fit: the least worth goes first, the later in the catalog among equals."""
    ranked = sorted(wanted, key=lambda kind: -kind.worth)[:budget]
    return [kind for kind in wanted if kind in ranked]


def _written(wanted: list[Kind], made: Mapping[str, dict[str, Any]], profiles: Profiles) -> list[Kind]:
    """Those of which a server of the allowed length can be written: as many of the most worth as fit."""

    def too_long(count: int) -> bool:
        return lines([made[kind.name] for kind in _within(count, wanted)], profiles) > MOST_LINES

    if not wanted or not too_long(len(wanted)):
        return wanted
    return _within(bisect_left(range(1, len(wanted)), True, key=too_long), wanted)


def _tool(kind: Kind, owners: Sequence[tuple[Device, Mapping[str, Any]]]) -> dict[str, Any]:
    devices = [device["id"] for device, _ in owners]
    properties = {
        "device": _device(devices, legend([device for device, _ in owners])),
        **kind.parameters([capability.get("parameters", {}) for _, capability in owners]),
    }
    for part in ("led", "channel"):
        if kind.effect == "actuate" and _only_one(properties.get(part)):
            properties[part]["default"] = properties[part]["const"]
    required = [name for name, schema in properties.items() if "default" not in schema]
    tool: dict[str, Any] = {
        "name": kind.name,
        "capability": kind.name,
        "devices": devices,
        "description": kind.description,
        "effect": kind.effect,
        "annotations": _annotations(kind),
        "input_schema": {"type": "object", "properties": properties, "additionalProperties": False},
        "output_schema": _output(kind, [capability.get("parameters", {}) for _, capability in owners]),
    }
    if kind.stops:
        tool["stops"] = True
    if kind.acts_on:
        tool["units"] = dict(kind.acts_on)
    if required:
        tool["input_schema"]["required"] = required
    if limits := [
        _limit(name, schema, kind.units.get(name)) for name, schema in properties.items() if "minimum" in schema
    ]:
        tool["limits"] = limits
    if kind.effect == "read":
        chosen = {} if len(devices) == 1 else {"device": devices[0]}
        tool["smoke"] = {"arguments": {**chosen, **kind.smoke}}
    return tool


def _output(kind: Kind, facts: Sequence[Mapping[str, Any]]) -> Schema:
    """The result's schema, with a note for SERVE of the kernel interfaces that the channels come from."""
    found = {channel.get("source") for fact in facts for channel in fact.get("channels", ())} - {None, ""}
    return {**kind.output, "$comment": "sources: " + ", ".join(sorted(found))} if found else kind.output


def _device(devices: list[str], description: str) -> Schema:
    schema = one_of(description, devices)
    return {**schema, "default": devices[0]} if len(devices) == 1 else schema


def _only_one(schema: Schema | None) -> bool:
    return schema is not None and "const" in schema


def _annotations(kind: Kind) -> dict[str, bool]:
    return {
        "readOnlyHint": kind.effect == "read",
        "destructiveHint": kind.effect == "irreversible",
        "idempotentHint": kind.idempotent,
        "openWorldHint": False,
    }


def _limit(name: str, schema: Schema, unit: str | None) -> dict[str, Any]:
    limit = {"parameter": name, "minimum": schema["minimum"], "maximum": schema["maximum"]}
    return {**limit, "unit": unit} if unit else limit


def _spared(cut: list[Kind], owners: Owners) -> dict[str, list[str]]:
    """Device id to the capabilities that the budget cut, for all devices that lost one."""
    lost: dict[str, list[str]] = {}
    for kind in cut:
        for device, _ in owners[kind.name]:
            lost.setdefault(device["id"], []).append(kind.name)
    return lost


def _left_out(
    identify: Mapping[str, Any], served: set[str], spared: Mapping[str, list[str]], why: str
) -> list[dict[str, Any]]:
    out = [dict(item) for item in identify["left_out"]]
    for device in identify["devices"]:
        name = device["id"]
        if name in spared:
            reason, detail = why, f"without a tool for {', '.join(sorted(spared[name]))}"
        elif name in served:
            continue
        else:
            reason, detail = why_left_out(device)
        out.append({"id": name, "reason": reason, **({"detail": detail[:300]} if detail else {})})
    return out
