"""The tools of a device with a grammar, of either kind: exactly the commands, and what a caller may leave out."""

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from cases import for_each

from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.rules.interface.interface_rules import effect_differs
from octoform.contracts.rules.interface.protocol_definition_rules import definition_differs
from octoform.contracts.rules.raw_line_rules import identify_stops, interface_stops
from octoform.profiles import Profile, commands, load

PROFILES = {item.name: item for item in load(sorted((Path(__file__).parents[3] / "profiles").glob("*.md")))[0]}
DEVICE = "usb-0000-0001"
Tools = dict[str, dict[str, Any]]


def tool(command: Any) -> dict[str, Any]:
    """The tool that a careful agent makes of a command."""
    members = {"type", "minimum", "maximum", "enum", "default"}
    values = {
        name: {key: value[key] for key in members & value.keys()} for name, value in command["parameters"].items()
    }
    required = [name for name, value in values.items() if "default" not in value]
    return {
        "name": command["tool"],
        "capability": command["tool"],
        "devices": [DEVICE],
        "effect": command["effect"],
        "input_schema": deepcopy({"type": "object", "properties": values, "required": required}),
        **({"stops": True} if command.get("do") == "stop" else {}),
    }


def identified(profile: Profile) -> dict[str, Any]:
    stops = [
        {"name": item["tool"], "effect": item["effect"], "stops": item.get("do") == "stop"}
        for item in commands(profile)
    ]
    return {"devices": [{"id": DEVICE, "profile": profile.name, "capabilities": stops}]}


def judged(
    name: str,
    change: Callable[[Tools], Any] = lambda tools: None,
    before: Callable[[dict[str, dict[str, Any]]], Any] = lambda capabilities: None,
) -> list[str]:
    """The diagnostics for the changed tools of a profile, after an IDENTIFY whose capabilities are changed, too."""
    profile = PROFILES[name]
    tools = {item["tool"]: tool(item) for item in commands(profile)}
    change(tools)
    facts = {name: ProfileFacts(name, frozenset({DEVICE}), profile.limits, commands(profile))}
    known = identified(profile)
    before({item["name"]: item for item in known["devices"][0]["capabilities"]})
    given = Artifacts(identify=known, profiles=facts)
    interface = {"tools": list(tools.values()), "left_out": []}
    rules = (definition_differs, interface_stops, effect_differs)
    return [f"{item.summary} / {item.hint}" for rule in rules for item in rule(interface, given)]


@pytest.mark.parametrize("name", sorted(PROFILES))
def test_tools_that_mirror_the_grammar_are_accepted(name: str) -> None:
    assert judged(name) == []


def of(tools: Tools, tool_name: str, parameter: str) -> dict[str, Any]:
    found: dict[str, Any] = tools[tool_name]["input_schema"]["properties"][parameter]
    return found


CASES: dict[str, tuple[str, Callable[[Tools], Any], str]] = {
    "a command without a tool": ("so-arm101", lambda tools: tools.pop("arm_stop"), "lacks 'arm_stop'"),
    "a counted position without a tool": ("camera-rail", lambda tools: tools.pop("rail_position"), "'rail_position'"),
    "a read that actuates": ("so-arm101", lambda tools: tools["arm_status"].update(effect="actuate"), "write read"),
    "a joint of any name": (
        "so-arm101",
        lambda tools: of(tools, "arm_read_joint", "joint").pop("enum"),
        "takes other words for 'joint'",
    ),
    "a joint that is none": (
        "so-arm101",
        lambda tools: of(tools, "arm_set_torque", "joint")["enum"].append("elbow"),
        "takes other words for 'joint'",
    ),
    "torque as a word": (
        "so-arm101",
        lambda tools: of(tools, "arm_set_torque", "on").update(type="string"),
        "joint: string, on: boolean",
    ),
    "a speed that must be given": (
        "so-arm101",
        lambda tools: tools["arm_home"]["input_schema"].update(required=["speed"]),
        "requires 'speed'",
    ),
    "a goal that may be skipped": (
        "so-arm101",
        lambda tools: tools["arm_move_joints"]["input_schema"]["required"].remove("gripper"),
        "lets a caller leave out 'gripper'",
    ),
    "steps that may be skipped": (
        "camera-rail",
        lambda tools: tools["rail_move_x"]["input_schema"].pop("required"),
        "lets a caller leave out 'steps'",
    ),
    "another default": (
        "so-arm101",
        lambda tools: of(tools, "arm_move_joint", "speed").update(default=1500),
        'write "default": 400',
    ),
    "a joint that is not among the parameters": (
        "so-arm101",
        lambda tools: tools["arm_move_joints"]["input_schema"]["properties"].pop("gripper"),
        "has other parameters",
    ),
    "a movement that passes the others": (
        "so-arm101",
        lambda tools: tools["arm_move_joint"].update(stops=True),
        "is a tool that stops",
    ),
    "a stop that waits for the movement": (
        "camera-rail",
        lambda tools: tools["rail_stop"].pop("stops"),
        'write "stops": true',
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_differs_from_the_grammar_is_told(case: str) -> None:
    name, change, says = CASES[case]
    found = judged(name, change)
    assert any(says in item for item in found), found


# An artifact from before a profile was changed, or from before IDENTIFY was held to it: its facts of a capability.
OLD: dict[str, tuple[str, str, dict[str, Any]]] = {
    "a stop of a rail that is none": ("camera-rail", "rail_stop", {"stops": False}),
    "a stop of an arm that is none": ("so-arm101", "arm_stop", {"stops": False}),
    "a movement that stops": ("so-arm101", "arm_home", {"stops": True}),
    "a reading that acts": ("camera-rail", "rail_position", {"effect": "actuate"}),
    "a movement that reads": ("so-arm101", "arm_move_joint", {"effect": "read"}),
}


@for_each("case", OLD)
def test_where_identify_contradicts_the_grammar_the_grammar_holds(case: str) -> None:
    name, capability, says = OLD[case]

    def before(capabilities: dict[str, dict[str, Any]]) -> None:
        capabilities[capability].update(says)

    assert judged(name, before=before) == []
    found = judged(name, lambda tools: tools[capability].update(says), before)
    assert any("unlike the command" in item for item in found) and not any("capability says" in item for item in found)


def test_of_the_commands_of_a_grammar_one_rule_tells_who_stops() -> None:
    facts = ProfileFacts("camera-rail", frozenset({DEVICE, "usb-2"}), (), commands(PROFILES["camera-rail"]))
    value = identified(PROFILES["camera-rail"])
    value["devices"].append({**deepcopy(value["devices"][0]), "id": "usb-2"})
    value["devices"][1]["capabilities"][-1]["stops"] ^= True
    assert identify_stops(value, Artifacts(profiles={"camera-rail": facts})) == []
    assert len(identify_stops(value, Artifacts())) == 1


def test_words_may_be_fewer_and_one_may_be_fixed() -> None:
    def narrow(tools: Tools) -> None:
        of(tools, "arm_read_joint", "joint")["enum"] = ["gripper"]
        tools["arm_set_torque"]["input_schema"]["properties"]["joint"] = {"type": "string", "const": "gripper"}

    assert judged("so-arm101", narrow) == []


def test_a_tool_that_stops_takes_nothing_but_its_device() -> None:
    def more(tools: Tools) -> None:
        properties = tools["arm_stop"]["input_schema"]["properties"]
        properties |= {"device": {"type": "string"}, "position": {"type": "integer"}}

    found = judged("so-arm101", more)
    assert any("stops, and takes the parameter 'position'" in item for item in found), found


def test_a_capability_stops_only_if_it_actuates() -> None:
    value = identified(PROFILES["so-arm101"])
    assert identify_stops(value, Artifacts()) == []
    value["devices"][0]["capabilities"][0]["stops"] = True
    assert ["stops and is read" in item.summary for item in identify_stops(value, Artifacts())] == [True]
