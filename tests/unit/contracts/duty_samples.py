"""A deployment in trouble that does not exist: what WATCH and HEAL are given, and good reports about it."""

import copy
from collections.abc import Mapping
from typing import Any

from unit.contracts.contract_samples import SCHEMAS

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.report_context import DutyFacts, device_facts, tool_facts

ARM, CAMERA = "usb-1234-0007", "usb-1234-0001"


def _tool(name: str, effect: str, devices: list[str], properties: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    schema = {"type": "object", "properties": dict(properties)}
    return {"name": name, "effect": effect, "devices": devices, "input_schema": schema, **more}


JOINT = {"type": "string", "enum": ["shoulder", "elbow"], "description": "which joint"}
INTERFACE: dict[str, Any] = {
    "format": 1,
    "tools": [
        _tool("read_joints", "read", [ARM], {}),
        _tool("move_joint", "actuate", [ARM], {"joint": JOINT, "position": {"type": "integer"}}),
        _tool("halt", "actuate", [ARM], {}, stops=True),
        _tool("capture_image", "read", [CAMERA], {}),
        _tool("set_light", "actuate", [ARM, CAMERA], {"device": {"type": "string", "enum": [ARM, CAMERA]}}),
    ],
    "left_out": [],
}
IDENTIFY = {"devices": [{"id": ARM, "identified_as": "Acme Arm"}, {"id": CAMERA, "identified_as": "Acme Deskcam"}]}
HEAT = {"channel": "sensor", "source": "read_joints", "path": "/joints/elbow/heat"}


def reading(identity: str, channel: str, source: str, path: str, value: Any, at: str = "10:00:00") -> dict[str, Any]:
    """A row of the input."""
    why = "" if value is not None else "the unit is skipped"
    row = {"id": identity, "at": f"2026-01-02T{at}Z", "channel": channel, "source": source, "path": path}
    return {**row, "value": value, "why": why}


READINGS = [
    reading("r1", "process", "endpoint", "/running", True, "09:00:00"),
    reading("r2", "process", "endpoint", "/answers", True, "09:00:00"),
    reading("r3", "kernel", ARM, "/there", True, "09:00:00"),
    reading("r4", "kernel", CAMERA, "/there", True, "09:00:00"),
    reading("r5", "sensor", "read_joints", "/joints/shoulder/heat", 31, "09:30:00"),
    reading("r6", "sensor", "read_joints", "/joints/elbow/heat", 71, "09:30:00"),
    reading("r7", "sensor", "read_joints", "/joints/elbow/heat", 78, "09:59:00"),
    reading("r8", "log", "capture_image", "/ok", False, "09:59:30"),
    reading("r9", "frame", CAMERA, "/mean", 93.5, "09:58:00"),
]
FAILURE = {
    "id": "f1",
    "tool": "capture_image",
    "error": "AttributeError",
    "message": "module 'pictures' has no attribute 'grab'",
    "count": 4,
    "first": "2026-01-02T09:40:00Z",
    "last": "2026-01-02T09:59:30Z",
}
WATCH_INPUT: dict[str, Any] = {
    "format": 1,
    "host": "bench",
    "since": "2026-01-02T09:00:00Z",
    "readings": READINGS,
    "failures": [FAILURE],
    "log": "",
    "claims": [],
    "summary": None,
    "devices": device_facts(INTERFACE, IDENTIFY),
    "tools": tool_facts(INTERFACE),
    "frames": [],
    "perception": {"available": False, "reason": "switched off"},
}
CLAIM: dict[str, Any] = {
    "target": f"device:{ARM}/elbow",
    "fault": "none",
    "statement": "The elbow is too hot to be moved.",
    "signal": HEAT,
    "condition": {"op": ">=", "value": 70},
    "cites": ["r6", "r7"],
    "seconds": 600,
    "restrictions": [{"tool": "move_joint", "arguments": {"joint": "elbow"}, "effect": "deny"}],
}
ERROR: dict[str, Any] = {
    "tool": "capture_image",
    "device": CAMERA,
    "class": "broken_tool",
    "message": "It asks its library for a name that this version does not have.",
    "severity": "recoverable",
    "suggested_fix": "Use the name that the installed version has.",
    "cites": ["f1"],
}
WATCH: dict[str, Any] = {
    "format": 1,
    "stage": "watch",
    "status": "error",
    "summary": "The camera's tool fails since 09:40; the elbow is hot.",
    "physical_state": {"available": False, "seen": None, "reason": "switched off"},
    "errors": [ERROR],
    "claims": [CLAIM],
    "declarations": [],
}
HEAL_INPUT: dict[str, Any] = {
    "format": 1,
    "host": "bench",
    "target": "tool:capture_image",
    "error": ERROR,
    "tool": next(item for item in tool_facts(INTERFACE) if item["name"] == "capture_image"),
    "functions": ["capture_image", "_grab"],
    "device": device_facts(INTERFACE, IDENTIFY)[1],
    "readings": READINGS,
    "failures": [FAILURE],
    "log": "",
    "server": "server.py",
}
HEAL: dict[str, Any] = {
    "format": 1,
    "stage": "heal",
    "class": "broken_tool",
    "target": "tool:capture_image",
    "status": "repaired",
    "reason": "Line 12 calls a name that the library no longer has; the new name does the same.",
    "action": "rewrite",
    "functions": ["_grab"],
    "server": "server.py",
    "cites": ["f1"],
    "claims": [],
}


def report(duty: str) -> dict[str, Any]:
    """A copy of the good report of a duty."""
    return copy.deepcopy(WATCH if duty == "watch" else HEAL)


def given(duty: str) -> dict[str, Any]:
    """A copy of the input of a duty."""
    return copy.deepcopy(WATCH_INPUT if duty == "watch" else HEAL_INPUT)


def codes(duty: str, value: object, document: Mapping[str, Any] | None = None) -> set[str]:
    """The codes of everything that is wrong with a report about an input."""
    facts = DutyFacts.of(document if document is not None else given(duty))
    return {item.code for item in check(duty, value, Artifacts(interface=INTERFACE, duty=facts), SCHEMAS)}
