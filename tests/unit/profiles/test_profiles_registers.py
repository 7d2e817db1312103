"""The grammar of registers: what is read, what a tool takes, and that no number or name in it is left to chance."""

import json
from pathlib import Path
from typing import Any

import pytest

from octoform.diagnostics import Diagnostic
from octoform.profiles import Profile, briefing, for_task, load, load_text
from octoform.profiles.model import plain
from octoform.profiles.registers import Action, Library, Motion, Register, RegisterDefinition, Speed

SHIPPED = Path(__file__).parents[3] / "profiles"
PUMP = """---
name: pump-bank
about: two dosing pumps on one bus
product: Pump Bank Two
evidence: {all: [{vid_pid: "16c0:05df"}, {text: [Pump Bank]}]}
limits:
  - {tool: pump_turn, parameter: position, maximum: 900, unit: counts}
grammar:
  registers:
    class: tty
    baud: 57600
    library: {distribution: pump-sdk, module: pump_sdk.bus, protocol: 2}
    units: {left: 11, right: 12}
    unit: pump
    fields:
      torque: {address: 64, bytes: 1}
      pace: {address: 112, bytes: 4}
      goal: {address: 116, bytes: 4, sign_bit: 31}
      place: {address: 132, bytes: 4, sign_bit: 31}
      low: {address: 52, bytes: 4}
      heat: {address: 146, bytes: 1, unit: Cel}
    motion:
      goal: goal
      present: place
      lowest: low
      minimum: -1000
      maximum: 1000
      before: [{torque: 1}, {pace: speed}]
      speed: {minimum: 1, maximum: 200, default: 40, unit: rpm}
      moved: 20
      timeout: 10s
      release: {torque: 0}
    protect: {field: heat, refuse_at: 80, resume_below: 70.5, unit: Cel}
    calibration: {format: lerobot, files: ["~/pumps/*.json"]}
    poses: {empty: {left: -1000, right: 0}}
  commands:
    - {tool: pump_status, do: read_units, about: what the pumps feel, fields: [place, heat]}
    - {tool: pump_turn, do: move_unit, about: turn one pump}
    - {tool: pump_turn_percent, do: move_unit, scale: calibrated, about: turn one pump by its range}
    - {tool: pumps_turn, do: move_units, about: turn both pumps}
    - {tool: pumps_empty, do: pose, pose: empty, release: true, about: empty both pumps}
    - {tool: pump_hold, do: set_torque, about: hold a pump or let it go}
    - {tool: pumps_stop, do: stop, about: stop both pumps}
rig:
  facts: [The bench is wet.]
  disabled: {right: its hose is torn}
  units: {left: 12, right: 11}
---

It must not run dry.
"""
RIG = PUMP[PUMP.index("rig:") : PUMP.index("---\n\nIt")]


def pump(old: str = "", new: str = "") -> tuple[Profile | None, list[Diagnostic]]:
    assert old in PUMP, old
    return load_text(PUMP.replace(old, new, 1) if old else PUMP, "octopus.yaml")


def good() -> Profile:
    profile, found = pump()
    assert profile is not None and found == []
    return profile


def grammar() -> RegisterDefinition:
    found = good().grammar
    assert isinstance(found, RegisterDefinition)
    return found


def test_a_bus_of_any_maker_is_read_as_data() -> None:
    registers = grammar().registers
    assert (registers.kind, registers.baud, registers.unit) == ("tty", 57600, "pump")
    assert registers.library == Library("pump-sdk", "pump_sdk.bus", 2)
    assert registers.fields["goal"] == Register(116, 4, sign_bit=31)
    assert registers.motion == Motion(
        goal="goal",
        present="place",
        lowest="low",
        minimum=-1000,
        maximum=1000,
        before=(("torque", 1), ("pace", "speed")),
        speed=Speed(1, 200, 40, "rpm"),
        moved=20,
        timeout=10.0,
        release=(("torque", 0),),
    )
    assert registers.poses == {"empty": {"left": -1000, "right": 0}}
    assert grammar().commands[4] == Action("pumps_empty", "pose", "empty both pumps", pose="empty", release=True)


def test_the_former_name_of_the_timeout_of_a_movement_is_read() -> None:
    former, found = pump("timeout: 10s", "within: 10s")
    assert former is not None and found == []
    assert former.grammar == good().grammar


def test_what_a_tool_takes_follows_from_what_it_does() -> None:
    fields = {item["tool"]: item for item in plain(grammar())["commands"]}
    one = {"type": "string", "about": "which pump, by its name or its id", "enum": ["left", "right", "12", "11"]}
    speed = {"type": "integer", "about": "speed of the movement", "unit": "rpm", "minimum": 1, "maximum": 200}
    speed |= {"default": 40}
    assert {name: item["effect"] for name, item in fields.items() if item["effect"] == "read"} == {
        "pump_status": "read"
    }
    assert fields["pump_status"]["parameters"] == fields["pumps_stop"]["parameters"] == {}
    assert fields["pump_status"]["fields"] == ["place", "heat"]
    goal = {"type": "integer", "about": "goal of the pump", "minimum": -1000, "maximum": 1000}
    assert fields["pump_turn"]["parameters"] == {"pump": one, "position": goal, "speed": speed}
    percent = fields["pump_turn_percent"]["parameters"]["percent"]
    assert (percent["type"], percent["minimum"], percent["maximum"], percent["unit"]) == ("number", -100, 100, "%")
    assert list(fields["pumps_turn"]["parameters"]) == ["left", "right", "speed"]
    assert fields["pumps_empty"]["parameters"] == {"speed": speed}
    assert (fields["pumps_empty"]["pose"], fields["pumps_empty"]["release"]) == ("empty", True)
    assert fields["pump_hold"]["parameters"]["on"]["type"] == "boolean"
    assert [tool.tool for tool in grammar().tools() if tool.stops] == ["pumps_stop"]


def test_the_task_has_the_bus_as_it_is_on_the_rig() -> None:
    result = for_task(good(), {"usb-a"})["grammar"]["registers"]
    assert (result["units"], result["disabled"]) == ({"left": 12, "right": 11}, {"right": "its hose is torn"})
    assert result["motion"]["before"] == [{"torque": 1}, {"pace": "speed"}]
    assert (result["motion"]["timeout"], result["fields"]["heat"]) == (
        10.0,
        {"address": 146, "bytes": 1, "unit": "Cel"},
    )
    assert json.loads(json.dumps(result)) == result
    alone, found = pump(RIG, "")
    assert alone is not None and found == []
    result = for_task(alone, {"usb-a"})["grammar"]["registers"]
    assert (result["units"], result["disabled"]) == ({"left": 11, "right": 12}, {})


def test_an_agent_that_reads_prose_is_told_product_and_rig_apart() -> None:
    product, _, rig = briefing(good(), {"usb-a"}).partition("Only this rig, no other copy of the product:")
    shown = json.loads(product[product.index("\n{") :])
    assert shown["registers"]["units"] == {"left": 11, "right": 12} and "hose" not in product
    assert "right is disabled: its hose is torn." in rig and "left has the id 12 on the bus." in rig
    assert "The bench is wet." in rig


def test_every_bound_of_the_grammar_is_a_limit_of_the_profile() -> None:
    """What an author wrote is kept, in the author's unit; what no one wrote is bounded all the same."""
    assert good().limits == (
        {"tool": "pump_turn", "parameter": "position", "maximum": 900, "unit": "counts"},
        {"parameter": "position", "minimum": -1000, "unit": "counts"},
        {"parameter": "speed", "minimum": 1, "maximum": 200, "unit": "rpm"},
        {"parameter": "percent", "minimum": -100, "maximum": 100, "unit": "%"},
        {"parameter": "left", "minimum": -1000, "maximum": 1000},
        {"parameter": "right", "minimum": -1000, "maximum": 1000},
    )


REFUSED: list[tuple[str, str, str]] = [
    ("class: tty", "class: hidraw", "class of the bus is not tty"),
    ("baud: 57600", "baud: 0", "'baud' is not an integer from 1"),
    ("    baud: 57600\n", "", "'baud' is not an integer"),
    ("distribution: pump-sdk", 'distribution: "pump sdk; rm"', "distribution of the library"),
    ("distribution: pump-sdk", 'distribution: "git+https://x/y"', "distribution of the library"),
    ("module: pump_sdk.bus", 'module: "os;x"', "module of the library"),
    ("protocol: 2", "protocol: 7", "'protocol' is not an integer from 0 to 2"),
    ("library: {", "libary: {", "did you mean 'library'"),
    ("unit: pump\n", "unit: speed\n", "what a unit is called"),
    ("unit: pump\n", "unit: id\n", "what a unit is called"),
    ("units: {left: 11, right: 12}", "units: {}", "1 to 32 units"),
    ("units: {left: 11, right: 12}", "units: {left: 11, right: 11}", "another unit's already"),
    ("units: {left: 11, right: 12}", "units: {left: 11, right: 253}", "from 0 to 252"),
    ("units: {left: 11, right: 12}", "units: {left: 11, right: -1}", "from 0 to 252"),
    ("units: {left: 11, right: 12}", "units: {left: 11, right: true}", "from 0 to 252"),
    ("units: {left: 11, right: 12}", "units: {left: 11, speed: 12}", "no usable name of a unit"),
    ("units: {left: 11, right: 12}", "units: {left: 11, pump: 12}", "no usable name of a unit"),
    ("units: {left: 11, right: 12}", "units: {left: 11, device: 12}", "no usable name of a unit"),
    ("units: {left: 11, right: 12}", "units: {left: 11, Right: 12}", "no usable name of a unit"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 256, bytes: 1", "from 0 to 255"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 255, bytes: 2", "do not end within 0..255"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: 3", "none of 1, 2 and 4"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: true", "none of 1, 2 and 4"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: 1, sign_bit: 8", "'sign_bit'"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: 1, scale: 0", "'scale' is not above 0"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: 1, scale: .nan", "'scale' is no number"),
    ("heat: {address: 146, bytes: 1", "heat: {address: 146, bytes: 1, mask: 3", "'mask' is no field here"),
    ("heat: {address: 146, bytes: 1", "skipped: {address: 146, bytes: 1", "no usable name of a field"),
    ("unit: Cel}\n    motion", 'unit: "C\\n"}\n    motion', "'unit' is not a string"),
    ("      goal: goal\n", "      goal: gaol\n", "did you mean 'goal'"),
    ("      goal: goal\n", "", "None is no field"),
    ("present: place", "present: plaice", "did you mean 'place'"),
    ("lowest: low", "lowest: lowest", "'lowest' is no field"),
    ("minimum: -1000\n      maximum: 1000", "minimum: 1000\n      maximum: -1000", "not below its maximum"),
    ("      maximum: 1000\n", "      maximum: 4294967296\n", "'maximum' is not an integer"),
    ("goal: {address: 116, bytes: 4, sign_bit: 31}", "goal: {address: 116, bytes: 4}", "'minimum' is not an integer"),
    ("goal: {address: 116, bytes: 4, sign_bit: 31}", "goal: {address: 116, bytes: 1}", "from 0 to 255"),
    ("before: [{torque: 1}, {pace: speed}]", "before: {torque: 1}", "no list of at most"),
    ("before: [{torque: 1}, {pace: speed}]", "before: [{torque: 1, pace: speed}]", "one field to its value"),
    ("before: [{torque: 1}, {pace: speed}]", "before: [{torque: 1}]", "written nowhere"),
    ("before: [{torque: 1}, {pace: speed}]", "before: [{torque: 256}, {pace: speed}]", "from 0 to 255"),
    ("before: [{torque: 1}, {pace: speed}]", "before: [{torqe: 1}, {pace: speed}]", "did you mean 'torque'"),
    (
        "before: [{torque: 1}, {pace: speed}]",
        "before: [{torque: position}, {pace: speed}]",
        "no parameter of a movement",
    ),
    ("pace: {address: 112, bytes: 4}", "pace: {address: 112, bytes: 1, sign_bit: 7}", "does not fit into 'pace'"),
    ("default: 40", "default: 201", "from 1 to 200"),
    ("speed: {minimum: 1,", "speed: {minimum: 300,", "minimum of the speed is above"),
    ("moved: 20", "moved: 0", "'moved'"),
    ("moved: 20", "moved: 2001", "from 1 to 2000"),
    ("timeout: 10s", "timeout: 10", "'timeout' is no duration from 1s to 60s"),
    ("timeout: 10s", "timeout: 2m", "'timeout'"),
    ("timeout: 10s", "within: 2m", "'within'"),
    ("timeout: 10s", "timeout: 10s\n      within: 10s", "are the same"),
    ("release: {torque: 0}", "release: {torqe: 0}", "did you mean 'torque'"),
    ("release: {torque: 0}", "release: {torque: off}", "from 0 to 255"),
    ("resume_below: 70.5", "resume_below: 80", "not below 'refuse_at'"),
    ("refuse_at: 80", "refuse_at: hot", "'refuse_at' is no number"),
    ("protect: {field: heat", "protect: {field: load", "'load' is no field"),
    ("resume_below: 70.5, unit: Cel", "resume_below: 70.5, unit: K", "in 'K' and its field in 'Cel'"),
    ("format: lerobot", "format: pickle", "format of the calibration is not known"),
    ('files: ["~/pumps/*.json"]', 'files: ["/etc/*.json"]', "below the home folder"),
    ('files: ["~/pumps/*.json"]', 'files: ["~/../*.json"]', "below the home folder"),
    ('files: ["~/pumps/*.json"]', 'files: ["~/**/*.json"]', "below the home folder"),
    ('files: ["~/pumps/*.json"]', 'files: ["~root/*.json"]', "below the home folder"),
    ('files: ["~/pumps/*.json"]', "files: []", "1 to 10 patterns"),
    ("poses: {empty: {left: -1000, right: 0}}", "poses: {empty: {left: -1000}}", "lacks right"),
    ("poses: {empty: {left: -1000, right: 0}}", "poses: {empty: {left: -1001, right: 0}}", "from -1000 to 1000"),
    ("poses: {empty: {left: -1000, right: 0}}", "poses: {empty: {left: 0.5, right: 0}}", "is not an integer"),
    ("poses: {empty: {left: -1000, right: 0}}", "poses: {empty: {left: 0, right: 0, top: 0}}", "'top' is no field"),
    ("poses: {empty: {left: -1000, right: 0}}", "poses: {empty: []}", "no mapping"),
    ("do: read_units", "do: write_register", "no thing that a command does"),
    ("tool: pump_status", "tool: pump_write_register", "raw pipe"),
    ("tool: pump_status", "tool: pump", "no usable tool name"),
    ("tool: pump_turn_percent", "tool: pump_turn", "occurs twice"),
    ("about: what the pumps feel, ", "", "'about' is missing"),
    ("fields: [place, heat]}\n    - {tool: pump_turn", "fields: [place, heap]}\n    - {tool: pump_turn", "mean 'heat'"),
    ("fields: [place, heat]", "fields: [place, place]", "occurs twice"),
    (", fields: [place, heat]", "", "fields that it reads"),
    ("do: move_unit, about: turn one pump}", "do: move_unit, fields: [heat], about: x}", "is of read_units, read_unit"),
    ("scale: calibrated", "scale: degrees", "'degrees' is no scale"),
    ("    calibration: {format", "    # calibration: {format", "without a `calibration`"),
    ("pose: empty, release", "pose: full, release", "'full' is no pose"),
    ("release: true", "release: 1", "neither true nor false"),
    ("      release: {torque: 0}\n", "", "no setting makes a unit limp"),
    ("before: [{torque: 1}, ", "before: [", "not hold it again"),
    ("do: stop, about", "do: stop, effect: read, about", "'effect' is no field here"),
    ("  registers:\n", "  line: {}\n  registers:\n", "has one kind"),
]


@pytest.mark.parametrize(("old", "new", "says"), REFUSED)
def test_what_is_refused(old: str, new: str, says: str) -> None:
    profile, found = pump(old, new)
    assert profile is None
    lines = [f"{item.summary} {item.hint}" for item in found if item.code == "PROFILE-GRAMMAR"]
    assert any(says in text for text in lines), [(item.code, item.summary, item.hint) for item in found]
    assert all(item.span is not None and item.span.line > 7 for item in found if item.code == "PROFILE-GRAMMAR")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("disabled: {right", "disabled: {rihgt", "did you mean 'right'"),
        ("right: its hose is torn", 'right: ""', "the reason is missing 'right' is disabled"),
        ("right: its hose is torn", r'right: "two\nlines"', "the reason is missing 'right' is disabled"),
        ("disabled: {right: its hose is torn}", "disabled: [right]", "no mapping of units"),
        ("units: {left: 12, right: 11}\n---", "units: {left: 12}\n---", "is the one of 'right'"),
        ("units: {left: 12, right: 11}\n---", "units: {left: 253}\n---", "from 0 to 252"),
        ("units: {left: 12, right: 11}\n---", "units: {top: 3}\n---", "'top' is no unit of the protocol definition"),
    ],
)
def test_what_a_rig_may_not_say_of_units(old: str, new: str, says: str) -> None:
    profile, found = pump(old, new)
    assert profile is None and {item.code for item in found} == {"PROFILE-RIG"}
    assert any(says in f"{item.summary} {item.hint}" for item in found), found


def test_a_wrong_grammar_is_not_told_a_second_time_as_a_wrong_rig() -> None:
    profile, found = pump("moved: 20", "moved: 0")
    assert profile is None and [item.code for item in found] == ["PROFILE-GRAMMAR"]


def test_units_of_a_rig_need_a_grammar_that_names_them() -> None:
    text = PUMP[: PUMP.index("limits:")] + PUMP[PUMP.index("rig:") :]
    profile, found = load_text(text, "x")
    assert profile is None and [item.code for item in found] == ["PROFILE-RIG", "PROFILE-RIG"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("tool: pump_turn, parameter", "tool: pump_trun, parameter", "no tool 'pump_trun'"),
        ("tool: pump_turn, parameter: position", "tool: pump_turn, parameter: positron", "'positron'"),
        ("rig:\n", "rig:\n  limits: [{tool: pump_tern, parameter: position, maximum: 5}]\n", "no tool 'pump_tern'"),
        ("rig:\n", "rig:\n  limits: [{parameter: positron, maximum: 5}]\n", "'positron'"),
    ],
)
def test_a_limit_is_of_a_tool_and_a_parameter_that_exist(old: str, new: str, says: str) -> None:
    profile, found = pump(old, new)
    assert profile is None and [item.code for item in found] == ["PROFILE-LIMIT"] and says in found[0].summary


@pytest.mark.parametrize("value", ["1", "[]", "{}", "{units: 1, fields: 2, motion: 3, poses: 4, library: 5}"])
def test_nonsense_is_told_and_never_raises(value: str) -> None:
    start, end = PUMP.index("  registers:"), PUMP.index("  commands:")
    profile, found = load_text(f"{PUMP[:start]}  registers: {value}\n{PUMP[end:]}", "x")
    assert profile is None and "PROFILE-GRAMMAR" in {item.code for item in found}


def test_sensors_on_a_bus_need_no_motion() -> None:
    start, end = PUMP.index("    motion:"), PUMP.index("  commands:")
    text = PUMP[:start] + PUMP[end : PUMP.index("    - {tool: pump_turn,")] + PUMP[PUMP.index("rig:") :]
    profile, found = load_text(
        text.replace("limits:\n  - {tool: pump_turn, parameter: position, maximum: 900, unit: counts}\n", ""), "x"
    )
    assert found == [] and profile is not None and profile.grammar is not None
    assert "motion" not in plain(profile.grammar)["registers"]
    moving, found = load_text(text.replace("do: read_units", "do: stop"), "x")
    assert moving is None and any("without a `motion`" in item.summary for item in found)


def test_a_grammar_that_unfolds_beyond_a_prompt_is_refused() -> None:
    units = ", ".join(f"pump_number_{number}: {number}" for number in range(30))
    extra = "".join(f"    - {{tool: pumps_turn_{number}, do: move_units, about: x}}\n" for number in range(8))
    text = PUMP.replace("{left: 11, right: 12}", f"{{{units}}}").replace("rig:\n", f"{extra}rig:\n")
    text = text.replace(RIG, "").replace("    poses: {empty: {left: -1000, right: 0}}\n", "")
    pose = "    - {tool: pumps_empty, do: pose, pose: empty, release: true, about: empty both pumps}\n"
    profile, found = load_text(text.replace(pose, ""), "x")
    assert profile is None and any("written out" in item.summary for item in found), found


def arm() -> tuple[Profile, dict[str, Any]]:
    (profile,), found = load([SHIPPED / "so-arm101.md"])
    assert found == [] and profile.grammar is not None
    return profile, plain(profile.grammar)


def test_the_shipped_arm_has_its_tools_and_its_order_of_writes() -> None:
    profile, found = arm()
    assert [(item["tool"], item["do"]) for item in found["commands"]] == [
        ("arm_status", "read_units"),
        ("arm_read_joint", "read_unit"),
        ("arm_move_joint", "move_unit"),
        ("arm_move_joint_calibrated", "move_unit"),
        ("arm_move_joints", "move_units"),
        ("arm_home", "pose"),
        ("arm_rest", "pose"),
        ("arm_set_torque", "set_torque"),
        ("arm_stop", "stop"),
    ]
    registers = found["registers"]
    assert (registers["baud"], registers["disabled"], list(registers["units"].values())) == (
        1_000_000,
        {},
        [1, 2, 3, 4, 5, 6],
    )
    order = [*(next(iter(step)) for step in registers["motion"]["before"]), registers["motion"]["goal"]]
    assert [registers["fields"][name]["address"] for name in order] == [40, 41, 46, 42]
    assert not profile.describes
    assert [item.write.hex(" ") for item in profile.stop] == ["ff ff fe 04 03 28 00 d2"]


def test_every_number_that_moves_the_shipped_arm_is_limited() -> None:
    profile, found = arm()
    bounded = {limit["parameter"] for limit in profile.limits if {"minimum", "maximum"} <= limit.keys()}
    numbers = {
        name
        for command in found["commands"]
        for name, value in command["parameters"].items()
        if value["type"] in ("integer", "number")
    }
    assert numbers == bounded and len(numbers) == 9
