"""Each rule of the privileged steps, broken alone: a good artifact, one change, exactly that code."""

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from unit.contracts.contract_samples import SCHEMAS, artifacts, good

from octoform.contracts import Artifacts, ProfileFacts
from octoform.contracts.contract_check import RULES, check
from octoform.contracts.model import StepFacts, corroborated

ARM, CAMERA = "usb-1a86-55d3", "usb-1234-0001"
JOINTS = ["base", "elbow", "grip"]
JOINT = {"type": "string", "enum": JOINTS}
PLACE = {"joint": "grip", "position": 5}
COUNT = {"type": "integer", "minimum": 0, "maximum": 4095}


def tool(name: str, effect: str, properties: dict[str, Any], required: list[str], device: str = ARM) -> dict[str, Any]:
    schema = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
    return {"name": name, "capability": name, "devices": [device], "effect": effect, "input_schema": schema}


TOOLS = [
    tool("arm_read", "read", {"joint": JOINT}, ["joint"]),
    tool("arm_move", "actuate", {"joint": JOINT, "position": COUNT, "speed": COUNT}, ["joint", "position"]),
    tool("arm_hold", "actuate", {"joint": JOINT, "on": {"type": "boolean"}}, ["joint", "on"]),
    tool("arm_melt", "irreversible", {"joint": JOINT, "position": COUNT}, ["joint", "position"]),
    tool("lamp_dim", "actuate", {"percent": {"type": "number"}}, ["percent"], "usb-1234-0002"),
    tool("capture_image", "read", {"device": {"type": "string", "enum": [CAMERA]}}, [], CAMERA),
]
IDENTIFY = {"devices": [{"id": ARM, "profile": "arm"}, {"id": CAMERA}, {"id": "usb-1234-0002"}], "left_out": []}
SEEN = (
    {
        "device": CAMERA,
        "tool": "capture_image",
        "arguments": {},
        "hub_shared_with": [],
        "built_in": False,
        "hint": False,
    },
    {
        "device": "cam-hub",
        "tool": "capture_image",
        "arguments": {},
        "hub_shared_with": [ARM],
        "built_in": False,
        "hint": False,
    },
    {
        "device": "cam-lid",
        "tool": "capture_image",
        "arguments": {},
        "hub_shared_with": [],
        "built_in": True,
        "hint": False,
    },
)
FACTS = StepFacts("arm", "reading", 50.0, (ARM,), disabled={"base": "its motor is broken"}, cameras=SEEN, best=CAMERA)


def trial(joint: str, *, view: bool = False) -> dict[str, Any]:
    return {
        "unit": joint,
        "move": {"tool": "arm_move", "arguments": {"joint": joint}, "vary": "position", "by": 200, "relative": False},
        "read": None if view else {"tool": "arm_read", "arguments": {"joint": joint}, "value": "/position"},
        "view": {"tool": "capture_image", "arguments": {}} if view else None,
        "restore": None if view else restore(joint),
    }


def restore(joint: str) -> dict[str, Any]:
    return {
        "read": {"tool": "arm_read", "arguments": {"joint": joint}, "value": "/torque"},
        "set": {"tool": "arm_hold", "arguments": {"joint": joint}, "vary": "on"},
    }


def reading() -> dict[str, Any]:
    skipped = [{"unit": "base", "reason": "its motor is broken"}]
    trials = [trial("grip"), trial("elbow")]
    head = {"format": 1, "step": "arm", "device": ARM, "server": None}
    return {**head, "trials": trials, "skipped": skipped, "camera": None}


def viewing() -> dict[str, Any]:
    return {**reading(), "trials": [trial("grip", view=True), trial("elbow", view=True)]}


def framing() -> dict[str, Any]:
    camera = {"device": CAMERA, "tool": "capture_image", "arguments": {"device": CAMERA}}
    head = {"format": 1, "step": "perceive", "device": None, "server": None}
    return {**head, "trials": [], "skipped": [], "camera": camera}


def known(facts: StepFacts = FACTS) -> Artifacts:
    profiles = {"arm": ProfileFacts("arm", frozenset({ARM}))}
    interface = {"tools": TOOLS, "left_out": []}
    return artifacts(identify=IDENTIFY, interface=interface, profiles=profiles, step=facts)


VIEW = replace(FACTS, kind="view")
FRAME = StepFacts("perceive", "frame", 0.0, needs_profile=False, cameras=SEEN, best=CAMERA)


def codes(value: Any, facts: StepFacts = FACTS) -> set[str]:
    return {item.code for item in check(f"step.{facts.name}", value, known(facts), SCHEMAS)}


def test_good_artifacts_pass() -> None:
    assert codes(reading()) == set()
    assert codes(viewing(), VIEW) == set()
    assert codes(framing(), FRAME) == set()
    assert codes({**reading(), "server": "server.py"}) == set()
    numeric = reading()
    put_back(numeric).update(tool="arm_move", vary="position")
    assert codes(numeric) == set()
    for without in ({"restore": None}, {}):
        trials = [
            {name: part for name, part in trial(joint).items() if name != "restore"} for joint in ("grip", "elbow")
        ]
        assert codes({**reading(), "trials": [{**item, **without} for item in trials]}) == set()


Change = Callable[[dict[str, Any]], object]


def first(value: dict[str, Any], part: str = "move") -> dict[str, Any]:
    found: dict[str, Any] = value["trials"][0][part]
    return found


def put_back(value: dict[str, Any], part: str = "set") -> dict[str, Any]:
    found: dict[str, Any] = value["trials"][0]["restore"][part]
    return found


CASES: list[tuple[str, Change]] = [
    ("STEP-SCHEMA", lambda value: value.pop("camera")),
    ("STEP-SCHEMA", lambda value: value.update(server="/etc/passwd")),
    ("STEP-SCHEMA", lambda value: first(value).update(by=0)),
    ("STEP-SCHEMA", lambda value: value["skipped"][0].update(reason="")),
    ("STEP-NAME-DIFFERS", lambda value: value.update(step="rail")),
    ("STEP-WRONG-PROOF", lambda value: value["trials"][0].update(view={"tool": "capture_image", "arguments": {}})),
    ("STEP-WRONG-PROOF", lambda value: value.update(camera=framing()["camera"])),
    ("STEP-FOREIGN-TOOL", lambda value: first(value).update(tool="arm_melt")),
    ("STEP-FOREIGN-TOOL", lambda value: first(value).update(tool="arm_mvoe")),
    ("STEP-FOREIGN-TOOL", lambda value: first(value, "read").update(tool="capture_image", arguments={})),
    ("STEP-FOREIGN-TOOL", lambda value: first(value).update(tool="lamp_dim", arguments={}, vary="percent")),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(vary="joint", arguments={})),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(vary="psition")),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value)["arguments"].update(position=5)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value)["arguments"].update(sped=5)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value, "read").update(arguments={})),
    ("STEP-UNCOVERED-UNIT", lambda value: value["trials"].pop()),
    ("STEP-UNCOVERED-UNIT", lambda value: value["trials"].append(trial("grip"))),
    ("STEP-UNCOVERED-UNIT", lambda value: first(value, "read")["arguments"].update(joint="elbow")),
    ("STEP-UNCOVERED-UNIT", lambda value: value["skipped"].clear()),
    (
        "STEP-WRONGLY-SKIPPED",
        lambda value: value["skipped"].append({"unit": value["trials"].pop()["unit"], "reason": "tired"}),
    ),
    ("STEP-WRONGLY-SKIPPED", lambda value: value["skipped"][0].update(reason="  ")),
    ("STEP-WRONGLY-SKIPPED", lambda value: value.update(skipped=[], trials=[trial(name) for name in JOINTS])),
    ("STEP-SCHEMA", lambda value: value["trials"][0]["restore"].pop("read")),
    ("STEP-SCHEMA", lambda value: put_back(value).update(by=1)),
    ("STEP-FOREIGN-TOOL", lambda value: put_back(value).update(tool="arm_melt", vary="position")),
    ("STEP-FOREIGN-TOOL", lambda value: put_back(value).update(tool="lamp_dim", arguments={}, vary="percent")),
    ("STEP-FOREIGN-TOOL", lambda value: put_back(value, "read").update(tool="arm_move", arguments=PLACE)),
    ("STEP-WRONG-ARGUMENTS", lambda value: put_back(value).update(vary="joint", arguments={"on": True})),
    ("STEP-WRONG-ARGUMENTS", lambda value: put_back(value)["arguments"].update(on=True)),
    ("STEP-WRONG-ARGUMENTS", lambda value: put_back(value, "read").update(arguments={})),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(tool="arm_hold", vary="on")),
    ("STEP-UNCOVERED-UNIT", lambda value: put_back(value)["arguments"].update(joint="elbow")),
    ("STEP-TOO-SMALL", lambda value: first(value).update(by=-49)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(by=4095)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(by=-2100)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value).update(relative=True)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value)["arguments"].update(speed=5000)),
    ("STEP-WRONG-ARGUMENTS", lambda value: first(value)["arguments"].update(speed=-1)),
    ("STEP-WRONGLY-SKIPPED", lambda value: value["skipped"][0].update(reason="it may hit the table")),
]


UNUSUAL: list[Change] = [
    lambda value: first(value).update(by=400),
    lambda value: first(value).update(by=-2047),
    lambda value: first(value)["arguments"].update(speed=0),
    lambda value: value["trials"].reverse(),
    lambda value: first(value, "read").update(value="/joint/position"),
    lambda value: value["skipped"][0].update(reason="The profile says so: the motor is broken."),
    lambda value: value["skipped"][0].update(reason="Sein Motor läuft nicht."),
]


@pytest.mark.parametrize("change", UNUSUAL)
def test_a_right_step_in_unusual_form_is_accepted(change: Change) -> None:
    value = reading()
    change(value)
    assert codes(value) == set()


def test_a_picture_is_of_a_camera_that_its_tool_serves() -> None:
    value = viewing()
    first(value, "view")["arguments"] = {"device": "cam-lid"}
    assert codes(value, VIEW) == {"STEP-WRONG-ARGUMENTS"}


@pytest.mark.parametrize(("code", "change"), CASES, ids=lambda item: item if isinstance(item, str) else "")
def test_one_breach_one_code(code: str, change: Change) -> None:
    value = reading()
    change(value)
    assert codes(value) == {code}


def test_every_rule_has_a_case() -> None:
    own_tests = {"STEP-WRONG-CAMERA", "STEP-DEVICE-DIFFERS"}
    assert {rule.code for rule in RULES["step"]} - {code for code, _ in CASES} == own_tests


def test_another_device_may_not_be_moved() -> None:
    value = {**reading(), "device": "usb-1234-0002", "skipped": []}
    value["trials"] = [copy.deepcopy(trial("lamp"))]
    value["trials"][0]["move"].update(tool="lamp_dim", arguments={}, vary="percent", by=60)
    assert "STEP-DEVICE-DIFFERS" in codes(value)
    assert codes({**reading(), "trials": []}) == {"STEP-WRONG-PROOF", "STEP-UNCOVERED-UNIT"}


def test_a_movement_that_only_a_picture_shows_has_no_least_size() -> None:
    value = viewing()
    first(value)["by"] = 1
    assert codes(value, VIEW) == set()
    first(value, "view")["tool"] = "arm_read"
    first(value, "view")["arguments"] = {"joint": "grip"}
    assert codes(value, VIEW) == {"STEP-FOREIGN-TOOL"}
    assert codes(reading(), VIEW) == {"STEP-WRONG-PROOF"}
    value = viewing()
    value["trials"][1]["restore"] = restore("elbow")
    assert codes(value, VIEW) == {"STEP-WRONG-PROOF"}


@pytest.mark.parametrize("device", ["cam-hub", "cam-lid", "cam-none"])
def test_the_better_camera_is_chosen(device: str) -> None:
    value = framing()
    value["camera"].update(device=device, arguments={})
    found = check("step.perceive", value, known(FRAME), SCHEMAS)
    assert [item.code for item in found] == ["STEP-WRONG-CAMERA"]
    named = tuple({**item, "hint": item["device"] == device} for item in SEEN)
    wanted = set() if device != "cam-none" else {"STEP-WRONG-CAMERA"}
    assert codes(value, replace(FRAME, cameras=named, best=device)) == wanted


def test_where_nothing_moves_nothing_is_tried() -> None:
    value = {**framing(), "device": CAMERA}
    assert codes(value, FRAME) == {"STEP-DEVICE-DIFFERS"}
    assert codes({**framing(), "camera": None}, FRAME) == {"STEP-WRONG-PROOF"}
    assert "STEP-WRONG-PROOF" in codes({**framing(), "trials": reading()["trials"]}, FRAME)


def test_a_step_without_a_device_claims_nothing() -> None:
    nothing = {**reading(), "device": None, "trials": [], "skipped": []}
    assert codes(nothing, replace(FACTS, devices=())) == set()
    assert codes(nothing) == {"STEP-DEVICE-DIFFERS", "STEP-WRONG-PROOF"}
    assert codes({**nothing, "trials": [trial("grip")]}, replace(FACTS, devices=())) == {"STEP-FOREIGN-TOOL"}


def test_a_device_is_corroborated_by_annotation_and_evidence_together() -> None:
    assert corroborated("arm", known()) == (ARM,)
    assert corroborated("rail", known()) == ()
    assert corroborated("arm", replace(known(), profiles={"arm": ProfileFacts("arm")})) == ()
    unnamed = {"devices": [{"id": ARM}], "left_out": []}
    assert corroborated("arm", replace(known(), identify=unnamed)) == ()
    assert good("identify")["devices"]  # the sample that the others share stays as it was
