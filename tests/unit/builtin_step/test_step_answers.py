"""What the embedded agent wants tried, from the grammars of the shipped profiles; held to octoform's own contract."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from octoform.builtin.interface import declare
from octoform.builtin.step import answer, run
from octoform.builtin.task import Task, TaskRefused, read_task
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, StepFacts
from octoform.profiles import for_task, load
from octoform.protocol import schema_dir

PROFILES = Path(__file__).parents[3] / "profiles"
CAMERA, INNER, HUBBED = (
    {"device": f"usb-0000-000{n}", "tool": "capture_image", "arguments": {"device": f"usb-0000-000{n}"}}
    | {"hub_shared_with": [], "built_in": False, "hint": False}
    for n in (2, 1, 3)
)
INNER["built_in"], HUBBED["hub_shared_with"] = True, ["usb-9999-0001"]
"""A camera of its own, one that is built in (with the first id), one that hangs on the hub of something that moves."""


def profile(name: str, **rig: object) -> dict[str, Any]:
    (read,), found = load([PROFILES / f"{name}.md"])
    assert not found, found
    return {**for_task(read, ["usb-1"])}


def a_task(*profiles: dict[str, Any]) -> Task:
    return Task("step.x", None, None, Path("/nowhere"), 30, Path("/"), profiles)


def tools_of(given: dict[str, Any], category: str = "actuator") -> list[dict[str, Any]]:
    """The tools that the embedded agent itself declares for the commands of a profile."""
    names: list[dict[str, Any]] = [
        {"name": item["tool"], "effect": item["effect"]} for item in given["grammar"]["commands"]
    ]
    device: dict[str, Any] = {
        "id": "usb-1",
        "identified_as": "it",
        "category": category,
        "confidence": 0.9,
        "method": "profile",
    }
    device |= {
        "profile": given["name"],
        "evidence": [],
        "capabilities": [{**item, "via": "x", "about": "x"} for item in names],
    }
    return list(declare({"devices": [device], "left_out": []}, 60, (given,))["tools"])


def the_input(step: str, kind: str, minimum: float, tools: list[dict[str, Any]], *cameras: object) -> dict[str, Any]:
    proof = {"kind": kind, "minimum": minimum, "unit": "raw", "settle": 2.0}
    device = None if kind == "frame" else {"id": "usb-1"}
    blank = {"format": 1, "step": step, "proof": proof, "device": device, "server": "server.py"}
    return {**blank, "tools": tools, "cameras": list(cameras)}


def held(given: dict[str, Any], value: dict[str, Any], **facts: object) -> list[str]:
    """The codes of what the contract finds."""
    proof = given["proof"]
    step = StepFacts(given["step"], proof["kind"], proof["minimum"], ("usb-1",))
    capture: dict[str, Any] = {"name": "capture_image", "capability": "capture_image", "effect": "read", "devices": []}
    capture["input_schema"] = {"type": "object", "properties": {"device": {"type": "string"}}}
    interface = {"tools": [*given["tools"], capture]}
    known = Artifacts(identify={"devices": [{"id": "usb-1"}]}, interface=interface, step=replace(step, **facts))  # type: ignore[arg-type]
    return [item.code for item in check("step.x", value, known, schema_dir(None))]


def test_each_joint_of_the_arm_is_tried_slowly_from_the_outermost_on() -> None:
    arm = profile("so-arm101")
    given = the_input("arm", "reading", 50, tools_of(arm))
    value = answer(given, a_task(arm))
    assert [trial["unit"] for trial in value["trials"]] == [
        *("gripper", "wrist_roll", "wrist_flex", "elbow_flex", "shoulder_lift", "shoulder_pan")
    ]
    first = value["trials"][0]
    assert first["move"] == {
        "tool": "arm_move_joint",
        "arguments": {"device": "usb-1", "joint": "gripper", "speed": 200},
        "vary": "position",
        "by": 200,
        "relative": False,
    }
    assert first["read"] == {
        "tool": "arm_read_joint",
        "arguments": {"device": "usb-1", "joint": "gripper"},
        "value": "/position",
    }
    assert first["restore"] == {
        "read": {"tool": "arm_status", "arguments": {"device": "usb-1"}, "value": "/joints/5/torque"},
        "set": {"tool": "arm_set_torque", "arguments": {"device": "usb-1", "joint": "gripper"}, "vary": "on"},
    }
    assert held(given, value) == []


def test_how_a_joint_is_made_limp_again_follows_from_the_grammar() -> None:
    arm = profile("so-arm101")
    (one,) = [item for item in arm["grammar"]["commands"] if item["do"] == "read_unit"]
    one["fields"] = [*one["fields"], "torque"]
    given = the_input("arm", "reading", 50, tools_of(arm))
    value = answer(given, a_task(arm))
    arguments = {"device": "usb-1", "joint": "gripper"}
    assert value["trials"][0]["restore"]["read"] == {**value["trials"][0]["read"], "value": "/torque"}
    assert value["trials"][0]["restore"]["set"]["arguments"] == arguments
    assert held(given, value) == []
    arm["grammar"]["registers"]["motion"]["release"] = {"torque": 2}
    value = answer(given, a_task(arm))
    assert {trial["restore"] for trial in value["trials"]} == {None}, "what was read is not what the switch takes"
    assert held(given, value) == []
    untold = profile("so-arm101")
    offered = [tool for tool in tools_of(untold) if tool["name"] != "arm_set_torque"]
    value = answer(the_input("arm", "reading", 50, offered), a_task(untold))
    assert {trial["restore"] for trial in value["trials"]} == {None}


def test_a_disabled_joint_is_skipped_with_the_owners_reason() -> None:
    arm = profile("so-arm101")
    arm["grammar"]["registers"]["disabled"] = {"shoulder_pan": "motor is broken"}
    given = the_input("arm", "reading", 50, tools_of(arm))
    value = answer(given, a_task(arm))
    assert value["skipped"] == [{"unit": "shoulder_pan", "reason": "motor is broken"}]
    assert len(value["trials"]) == 5
    places = [trial["restore"]["read"]["value"] for trial in value["trials"]]
    assert places == [f"/joints/{place}/torque" for place in (5, 4, 3, 2, 1)], "it keeps its place in the list"
    assert held(given, value, disabled={"shoulder_pan": "motor is broken"}) == []


def test_each_axis_of_the_rail_is_looked_at_through_the_best_camera() -> None:
    rail = profile("camera-rail")
    given = the_input("rail", "view", 3, tools_of(rail), INNER, CAMERA, HUBBED)
    value = answer(given, a_task(rail))
    view = {"tool": "capture_image", "arguments": {"device": CAMERA["device"]}}
    move = {"tool": "rail_move_x", "arguments": {"device": "usb-1"}, "vary": "steps", "by": 1000, "relative": True}
    assert value["trials"][0] == {"unit": "x", "move": move, "read": None, "view": view}
    assert [trial["unit"] for trial in value["trials"]] == ["x", "y"]
    assert held(given, value) == []


def test_no_camera_no_trial_of_what_only_a_camera_sees() -> None:
    rail = profile("camera-rail")
    with pytest.raises(TaskRefused, match="nothing can be seen to move"):
        answer(the_input("rail", "view", 3, tools_of(rail)), a_task(rail))


@pytest.mark.parametrize(
    ("cameras", "chosen"),
    [
        ([INNER, CAMERA, HUBBED], CAMERA),
        ([INNER, HUBBED], INNER),
        ([HUBBED], HUBBED),
        ([CAMERA, INNER, {**HUBBED, "hint": True}], HUBBED),
    ],
)
def test_the_camera_that_is_looked_through(cameras: list[dict[str, Any]], chosen: dict[str, Any]) -> None:
    given = the_input("perceive", "frame", 0, [], *cameras)
    value = answer(given, a_task())
    assert value["camera"] == {name: chosen[name] for name in ("device", "tool", "arguments")}
    assert value["device"] is None and value["trials"] == []
    assert held(given, value, needs_profile=False, cameras=tuple(cameras), best=chosen["device"]) == []


def test_what_no_grammar_describes_is_not_moved() -> None:
    rail, arm = profile("camera-rail"), profile("so-arm101")
    with pytest.raises(TaskRefused, match="no protocol definition"):
        answer(the_input("arm", "reading", 50, tools_of(rail)), a_task(rail))
    with pytest.raises(TaskRefused, match="no tool of this device does move_unit"):
        answer(the_input("arm", "reading", 50, []), a_task(arm))
    with pytest.raises(TaskRefused, match="no certain device"):
        answer({**the_input("mine", "reading", 50, []), "device": None}, a_task(arm))


def test_a_step_is_a_task_like_a_stage(tmp_path: Path) -> None:
    given, output = tmp_path / "input.json", tmp_path / "output.json"
    given.write_text(json.dumps(the_input("perceive", "frame", 0, [], CAMERA)))
    document = {"stage": "step.perceive", "input": str(given), "output": str(output)}
    (tmp_path / "task.json").write_text(json.dumps(document))
    assert run(read_task(tmp_path / "task.json")) == f"the camera {CAMERA['device']}"
    assert json.loads(output.read_text())["step"] == "perceive"
    given.write_text("{}")
    with pytest.raises(TaskRefused, match="cannot be used"):
        run(read_task(tmp_path / "task.json"))
