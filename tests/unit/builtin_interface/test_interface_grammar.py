"""Tools of a command grammar mirror it exactly: names, effects, parameters, bounds; nothing beside them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import KINDS, declare
from octoform.builtin.serve.stage import render
from octoform.builtin.task import TaskRefused
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.profiles import Profile, commands, for_task, load, load_text
from octoform.profiles.definition_forms import Value
from octoform.profiles.lines import Command, LineDefinition
from octoform.profiles.model import Grammar
from octoform.profiles.registers import RegisterDefinition

ROOT = Path(__file__).parents[3]
SCHEMAS = ROOT / "protocol" / "schemas"
(RAIL, ARM), _ = load([ROOT / "profiles" / name for name in ("camera-rail.md", "so-arm101.md")])
ID = "usb-2341-804f"
PROBE: dict[str, Any] = {
    "format": 1,
    "devices": [
        {
            "id": ID,
            "name": "board",
            "interface": "usb",
            "vid": "2341",
            "pid": "804f",
            "raw_descriptor": "product: board\ninterface[0]: class 02/02/01 driver=cdc_acm",
            "classes": ["tty"],
        }
    ],
}


def made(profile: Profile) -> tuple[dict[str, Any], str]:
    """INTERFACE and SERVE of a host with the device of that profile, past all contracts."""
    assert profile.grammar is not None
    task = [for_task(profile, {ID})]
    facts = {profile.name: ProfileFacts(profile.name, frozenset({ID}), profile.limits, commands(profile))}
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), task)
    tools = declare(named, 30, task)
    server = render(tools, task)
    before = Artifacts(probe=PROBE, profiles=facts)
    assert check("identify", named, before, SCHEMAS) == []
    assert check("interface", tools, replace(before, identify=named), SCHEMAS) == []
    assert check("serve", server, replace(before, identify=named, interface=tools), SCHEMAS) == []
    return tools, server


def as_commands(interface: dict[str, Any]) -> list[tuple[str, str, dict[str, tuple[Any, ...]]]]:
    return [
        (
            tool["name"],
            tool["effect"],
            {
                name: (value["type"], value.get("minimum"), value.get("maximum"), tuple(value.get("enum", ())))
                for name, value in tool["input_schema"]["properties"].items()
                if name != "device"
            },
        )
        for tool in interface["tools"]
    ]


def as_described(grammar: Grammar) -> list[tuple[str, str, dict[str, tuple[Any, ...]]]]:
    return [
        (
            tool.tool,
            tool.effect,
            {item.name: (item.type, item.minimum, item.maximum, item.choices) for item in tool.parameters},
        )
        for tool in grammar.tools()
    ]


assert isinstance(RAIL.grammar, LineDefinition)
MIXED = LineDefinition(
    replace(RAIL.grammar.line, error=None, ending="\r\n", settle=1.0),
    (
        Command("lamp_dim", 'DIM "{percent}" \\ {fade}', "dim it", "actuate",
                (Value("percent", "number", minimum=0, maximum=80.5),
                 Value("fade", "string", choices=("slow", 'f"st')))),
        Command("lamp_state", "S {lamp}?", "what it does.", "read", (Value("lamp", "integer", minimum=1, maximum=4),),
                ("S {celsius};{percent} {mode}",),
                (Value("celsius", "number", unit="C"), Value("percent", "integer"),
                 Value("mode", "string", choices=("on", "off")))),
        Command("lamp_burn", "BURN", "write the settings for good", "irreversible"),
    ),
)  # fmt: skip


@pytest.mark.parametrize("profile", [RAIL, replace(RAIL, grammar=MIXED, limits=()), ARM], ids=["rail", "mixed", "arm"])
def test_tools_equal_the_grammar(profile: Profile) -> None:
    interface, _ = made(profile)
    assert profile.grammar is not None
    assert as_commands(interface) == as_described(profile.grammar)
    assert interface["left_out"] == []


def test_a_narrower_limit_of_the_profile_stands_in_schema_and_limits() -> None:
    rig = {"tool": "rail_move_x", "parameter": "steps", "maximum": 500, "unit": "steps"}
    wide = {"parameter": "steps", "minimum": -9000, "unit": "steps"}
    interface, server = made(replace(RAIL, limits=(*RAIL.limits, rig, wide)))
    x, y = interface["tools"][:2]
    assert x["limits"] == [{"parameter": "steps", "minimum": -2000, "maximum": 500, "unit": "steps"}]
    assert y["limits"] == [{"parameter": "steps", "minimum": -2000, "maximum": 2000, "unit": "steps"}]
    assert "ge=-2000, le=500" in server


def test_fields_are_typed_and_units_are_told() -> None:
    interface, _ = made(replace(RAIL, grammar=MIXED, limits=()))
    state = interface["tools"][1]
    assert state["output_schema"]["properties"] == {
        "device": {"type": "string"},
        "celsius": {"type": "number"},
        "percent": {"type": "integer"},
        "mode": {"type": "string"},
    }
    assert "Returns celsius in C." in state["description"]
    assert state["smoke"] == {"arguments": {"lamp": 1}} and "smoke" not in interface["tools"][2]
    assert interface["tools"][2]["annotations"]["destructiveHint"] is True


def test_a_profile_without_a_grammar_is_left_out_with_that_reason() -> None:
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), [for_task(replace(RAIL, grammar=None), {ID})])
    (left,) = declare(named, 30)["left_out"]
    assert (left["id"], left["reason"]) == (ID, "no_standard_interface")
    assert "camera-rail" in left["detail"] and "protocol definition" in left["detail"]


def test_a_name_of_the_catalog_is_refused() -> None:
    text = (ROOT / "profiles" / "camera-rail.md").read_text()
    profile, _ = load_text(text.replace("rail_home", "read_battery"), "rail")
    assert profile is not None
    with pytest.raises(TaskRefused, match="names a tool read_battery, which is this agent's own"):
        made(profile)


def test_a_tool_with_other_parameters_than_the_grammar_is_not_served() -> None:
    interface, _ = made(RAIL)
    properties = interface["tools"][0]["input_schema"]["properties"]
    properties["speed"] = properties.pop("steps")
    with pytest.raises(TaskRefused, match="other parameters than the protocol definition"):
        render(interface, [for_task(RAIL, {ID})])


def test_the_budget_cuts_a_described_tool_last() -> None:
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), [for_task(RAIL, {ID})])
    kept = declare(named, 2, [for_task(RAIL, {ID})])
    assert [tool["name"] for tool in kept["tools"]] == ["rail_move_x", "rail_move_y"]
    left = "without a tool for rail_home, rail_position, rail_stop"
    assert kept["left_out"] == [{"id": ID, "reason": "tool_budget", "detail": left}]


def test_the_tools_of_units_say_what_they_take_and_answer() -> None:
    interface, server = made(ARM)
    tools = {tool["name"]: tool for tool in interface["tools"]}
    move, read, stop = (tools[f"arm_{name}"] for name in ("move_joint", "read_joint", "stop"))
    assert move["input_schema"]["required"] == ["joint", "position"]
    speed = move["input_schema"]["properties"]["speed"]
    assert speed.pop("description") == "speed of the movement (raw/s)"
    assert speed == {"type": "integer", "minimum": 50, "maximum": 1500, "default": 400}
    assert tools["arm_set_torque"]["input_schema"]["properties"]["on"]["type"] == "boolean"
    load = {"type": "number", "description": "in %"}
    assert read["output_schema"]["properties"]["load"] == {"anyOf": [load, {"type": "null"}]}
    position = {"type": "integer", "description": "raw"}
    assert read["output_schema"]["properties"]["position"] == {"anyOf": [position, {"type": "null"}]}
    assert read["smoke"] == {"arguments": {"joint": "shoulder_pan"}}
    assert [name for name, tool in tools.items() if tool.get("stops")] == ["arm_stop"]
    assert stop["input_schema"].keys() >= {"properties"} and "required" not in stop["input_schema"]
    assert '"feetech-servo-sdk"' in server.partition("# ///\n")[0]
    assert server.count("import scservo_sdk") == 1 and "    import scservo_sdk" in server


def test_a_disabled_unit_is_named_and_not_tried() -> None:
    assert isinstance(ARM.grammar, RegisterDefinition)
    off = replace(ARM.grammar.registers, disabled={"shoulder_pan": "motor is broken"}, renumbered={"wrist_flex": 9})
    interface, server = made(replace(ARM, grammar=replace(ARM.grammar, registers=off)))
    tools = {tool["name"]: tool for tool in interface["tools"]}
    assert tools["arm_read_joint"]["smoke"] == {"arguments": {"joint": "shoulder_lift"}}
    assert "Disabled: shoulder_pan." in tools["arm_move_joint"]["description"]
    assert '"shoulder_pan": "motor is broken"' in server and '"wrist_flex": 9' in server


def test_when_tools_have_to_go_a_stop_of_units_stays() -> None:
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), [for_task(ARM, {ID})])
    kept = declare(named, 3, [for_task(ARM, {ID})])
    assert [tool["name"] for tool in kept["tools"]] == ["arm_status", "arm_read_joint", "arm_stop"]


def change(tool: dict[str, Any], **members: Any) -> None:
    tool.update(members)


DIFFERENT: dict[str, Any] = {
    "another tool": (
        lambda tools: tools.append(tools[0] | {"name": "rail_spin", "capability": "rail_spin"}),
        "rail_spin",
    ),
    "a missing one": (lambda tools: tools.pop(2), "lacks 'rail_home'"),
    "another name": (lambda tools: change(tools[2], name="go_home"), "is no command of the protocol definition"),
    "another effect": (lambda tools: change(tools[2], effect="read"), "is read, unlike the command"),
    "another parameter": (
        lambda tools: tools[0]["input_schema"]["properties"].update(speed={"type": "integer"}),
        "has other parameters than the command",
    ),
    "another type": (
        lambda tools: tools[0]["input_schema"]["properties"]["steps"].update(type="number"),
        "has other parameters than the command",
    ),
}


@pytest.mark.parametrize("case", DIFFERENT)
def test_an_agent_that_strays_from_the_grammar_is_refused(case: str) -> None:
    interface, _ = made(RAIL)
    stray, says = DIFFERENT[case]
    stray(interface["tools"])
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), [for_task(RAIL, {ID})])
    facts = {RAIL.name: ProfileFacts(RAIL.name, frozenset({ID}), (), commands(RAIL))}
    found = check("interface", interface, Artifacts(probe=PROBE, identify=named, profiles=facts), SCHEMAS)
    lines = [item.summary for item in found if item.code == "INTERFACE-GRAMMAR-DIFFERS"]
    assert len(lines) == 1 and says in lines[0], found
    without = {RAIL.name: replace(facts[RAIL.name], commands=())}
    other = check("interface", interface, Artifacts(probe=PROBE, identify=named, profiles=without), SCHEMAS)
    assert "INTERFACE-GRAMMAR-DIFFERS" not in {item.code for item in other}


def test_a_host_with_a_device_of_many_classes_and_a_product_keeps_all_its_tools() -> None:
    """The length of a server is no reason to cut a tool that the budget allows."""
    has = {
        "usb-1f00-00c1": ("capture_image", "list_camera_formats"),
        "usb-1f00-00a1": ("record_audio", "play_audio"),
        "usb-1f00-00f1": ("read_gpio_lines", "read_gpio_line", "set_gpio_line"),
        "hwmon-corechip": ("read_temperature", "read_fan_speed", "read_sensor_channels"),
        "scsi-demo-disk": ("read_storage",),
        "pci-1f01-0003": ("read_network_interfaces",),
        "usb-1f00-00b1": ("describe_input", "read_input_events"),
    }
    task = [for_task(RAIL, {ID})]
    named = identify(PROBE, IdDatabases(Path("/nonexistent")), task)
    named["devices"] += [
        {
            "id": device,
            "identified_as": f"Demo {device}",
            "category": "sensor",
            "capabilities": [
                {"name": name, "description": "x", "via": "y", "effect": KINDS[name].effect} for name in names
            ],
        }
        for device, names in has.items()
    ]
    artifact = declare(named, 30, task)
    wanted = {name for names in has.values() for name in names} | {item["tool"] for item in commands(RAIL)}
    assert {tool["name"] for tool in artifact["tools"]} == wanted
    assert "tool_budget" not in {item["reason"] for item in artifact["left_out"]}
    assert check("serve", render(artifact, task), Artifacts(interface=artifact), SCHEMAS) == []
