"""A device that only a raw line leads to is read there, and nothing that is called a reading moves it.

The words, the code and the schemas below are those in which an agent can call a movement a reading; beside them stand
the honest ones that look alike.
"""

import copy
from dataclasses import replace
from typing import Any

from cases import for_each
from unit.contracts.contract_samples import IDENTIFY, INTERFACE, PROBE, READ, SCHEMAS, artifacts

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.movement_words import name_moves, speaks_of_change
from octoform.contracts.rules.raw_line_rules import lines_beside, unknown_lines
from octoform.contracts.rules.serve.line_rules import listening, on_a_line

LINE = "usb-1234-0003"
ANSWER = {LINE: "an Acme Arm, 0 to 4095, STOP stops it"}
THIN = {LINE: "an Acme Arm"}

_MOVING_NAMES = """
follow_joint_target teach_pose open_gripper close_gripper grip_object park_arm position_joint
command_joint bring_joint_to_angle stop_arm teleoperate_arm go_to_pose replay_pose nudge_joint relax_joints wave
mirror_leader track_target read_after_moving sync_goal_positions home_arm calibrate_joints guide_arm hold_pose
plan_and_read_path explore_joint visit_pose present_pose switch_torque
"""
_READING_NAMES = """
read_position read_joint_positions ask_board read_servo_status read_serial_port_presence listen_nmea
measure_voltage identify_instrument get_arm_state read_weight read_motion read_tilt list_sentences
read_home_humidity
"""
MOVING = """
Drive the joint to the wished angle and tell where it is.
Read the goal position of each joint after stating the wished one.
Teach the arm a pose: release the joints so that a person can guide them.
Follow a target angle with one joint and read how far it came.
Read a pose that a person shows by guiding the arm by hand, with the torque released.
Read the pose. The joint goes there.
State the wished angle of one joint and read it back.
Returns where the joint is. The joint moves.
Read a pose that a person shows by hand; the torque is released for that long.
Close the gripper of the arm. Returns where the gripper is.
Read the position, then open the gripper.
Reads back the position that the servo takes; the servo is moved there first.
Reads nothing but moves the joint.
Measures the range by moving each joint to both ends.
Reads the position and sets the speed.
Reads the state while the motor is driven to its end.
Makes the arm go home and reads it.
Rotates the base, reports the angle.
Reports the angle after the joint has been brought to it.
""".strip().splitlines()
READING = """
Read the present angle of each joint.
Tell whether the serial line of the arm is present on the system.
Wait for the receiver's next position and return it.
Read position, speed and heading of the receiver; it only listens.
Measure the DC voltage at the input. Returns null where the instrument is out of range.
Ask the instrument for its identity. Nothing is changed.
Read which joints are switched on and whether the hand is open or closed.
Listens for at most timeout_seconds and returns the last sentences. It sends nothing and moves nothing.
Read load and state of the arm. Through: the serial line, 9600 baud; one line each second.
The value is the moving average of the last ten samples.
Returns the state of each of the four switches.
Read the counter since the last reset.
Lists the channels with their labels; a reading that needs a person returns an empty list.
Tell whether the arm's program is running, and since when it was started.
Read the weight on the scale in grams; stable is false while the load is moving.
Shows the firmware release and the options that are enabled.
Read the temperature that the probe reports, without changing anything.
""".strip().splitlines()


@for_each("name", _MOVING_NAMES.split())
def test_a_name_that_moves_something_is_no_reading(name: str) -> None:
    assert name_moves(name) and len(identified(name)) == 1
    assert identified(name)[0] in ("IDENTIFY-READ-MOVES", "IDENTIFY-EFFECT-UNDERSTATED")


@for_each("name", _READING_NAMES.split())
def test_a_name_that_reads_is_one(name: str) -> None:
    assert name_moves(name) is None and identified(name) == []


@for_each("text", MOVING)
def test_a_text_that_speaks_of_a_movement_anywhere_is_no_reading(text: str) -> None:
    assert speaks_of_change(text)
    assert {"IDENTIFY-READ-MOVES", "IDENTIFY-EFFECT-UNDERSTATED"}.intersection(identified("read_angle", text))
    assert {"INTERFACE-READ-MOVES", "INTERFACE-EFFECT-UNDERSTATED"}.intersection(declared({}, description=text))


@for_each("text", READING)
def test_a_text_that_speaks_of_a_reading_is_one(text: str) -> None:
    assert speaks_of_change(text) is None and identified("read_angle", text) == []
    assert declared({}, description=text) == []


def test_a_fact_that_speaks_of_a_movement_counts_too() -> None:
    assert identified("read_angle", parameters={"order": "the wished angle"}) == ["IDENTIFY-READ-MOVES"]
    assert identified("read_angle", parameters={"range": "0..4095 steps", "baud": 9600}) == []


def test_what_the_owner_said_or_a_profile_that_holds_is_knowledge() -> None:
    held = {"arm": ProfileFacts("arm", frozenset({LINE}))}
    assert "IDENTIFY-READ-MOVES" not in identified("read_angle", MOVING[0], answers=ANSWER)
    assert "IDENTIFY-READ-MOVES" not in identified("read_angle", MOVING[0], profiles=held)


def test_where_a_profile_is_at_hand_nothing_but_listening_goes_without_it() -> None:
    known = {LINE: "acme-arm"}
    assert identified("read_angle", offered=known) == ["IDENTIFY-PROFILE-NOT-CHOSEN"]
    assert identified("read_line_presence", offered=known) == identified("listen_sentences", offered=known) == []
    assert identified("read_angle", offered=known, answers=ANSWER) == []
    [found] = problems("identify", identify("read_angle", "It reads."), artifacts(probe=probe(), offered=known))
    assert "leave it out" in str(found.hint) and "profiles: [acme-arm]" in str(found.hint)


# The device's strings, the class that is written down for it, and whether that bears out a reading.
SAID_OF_ITSELF = (
    ("product: Nano Connect", "sensor", False),
    ("manufacturer: Acme\nproduct: Nano 33", "weather_station", False),
    ("manufacturer: Acme Scales\nproduct: Uno", "scale", False),
    ("product: Acme GNSS receiver", "receiver", True),
    ("product: Acme Postal Scale", "scale", True),
    ("product: X-200\ninterface 00 string: Radiation Monitor", "radiation_monitor", True),
    ("product: Acme Anemometer", "anemometer", True),
)


@for_each("case", SAID_OF_ITSELF)
def test_a_reading_rests_on_what_the_device_says_of_itself(case: tuple[str, str, bool]) -> None:
    lines, kind, right = case
    value = identify("read_values", "Read the values that the board's program prints.")
    evidence = [{"quote": line} for line in lines.splitlines()]
    value["devices"][3] |= {"identified_as": lines.rpartition(": ")[2], "evidence": evidence, "class": kind}
    known = probe()
    known["devices"][3] |= {"name": lines.rpartition(": ")[2], "raw_descriptor": lines}
    codes = [item.code for item in problems("identify", value, artifacts(probe=known))]
    assert ("IDENTIFY-READ-UNFOUNDED" not in codes) == right, codes
    assert {"IDENTIFY-READ-MOVES", "IDENTIFY-QUOTE-NOT-VERBATIM"}.isdisjoint(codes)


QUANTITIES: list[dict[str, Any]] = [
    {"target": {"type": "integer", "enum": [0, 1]}},
    {"angle_degrees": {"type": "number", "minimum": 0, "maximum": 9}},
    {"speed": {"type": "integer", "minimum": 0, "maximum": 9}},
    {"x": {"type": "number", "minimum": 0, "maximum": 9}},
    {"number": {"type": "integer", "minimum": 0, "maximum": 9, "description": "the goal of the joint"}},
    {"torque": {"type": "boolean"}},
    {"mode": {"type": "string", "enum": ["open", "closed"]}},
    {"pose": {"type": "string", "enum": ["rest", "flat"]}},
    {"name": {"type": "string", "maxLength": 40}},
    {"speed_ms": {"type": "number", "minimum": 0, "maximum": 9}},
    {"angle_seconds": {"type": "number", "minimum": 0, "maximum": 9}},
    {"channel": {"type": "string", "enum": ["out 1", "in"]}},
    {"direction": {"type": "string", "enum": ["left", "right"]}},
    {"values": {"type": "array", "items": {"type": "number"}, "maxItems": 6}},
]
SELECTIONS: list[dict[str, Any]] = [
    {},
    {"channel": {"type": "integer", "minimum": 1, "maximum": 8}},
    {"joint": {"type": "string", "enum": ["base", "wrist"]}},
    {"timeout_seconds": {"type": "number", "minimum": 0.1, "maximum": 60}},
    {"samples": {"type": "integer", "minimum": 1, "maximum": 99}},
    {"quantity": {"type": "string", "enum": ["voltage", "current"]}},
    {"device": {"type": "string", "enum": [LINE]}},
    {"detailed": {"type": "boolean"}},
    {"channel": {"type": "string", "enum": ["in", "out"]}},
    {"sensor": {"type": "string", "enum": ["left", "right"]}},
    {"level_timeout_seconds": {"type": "number", "minimum": 0, "maximum": 9}},
]


@for_each("given", QUANTITIES)
def test_what_such_a_reading_takes_is_no_quantity(given: dict[str, Any]) -> None:
    assert "INTERFACE-READ-MOVES" in declared(given)


@for_each("given", SELECTIONS)
def test_what_such_a_reading_takes_may_select(given: dict[str, Any]) -> None:
    assert declared(given) == []


def test_a_reading_has_no_limit_on_what_a_device_is_given() -> None:
    given = {"level": {"type": "number", "minimum": 0, "maximum": 9}}
    limits = [{"parameter": "level", "minimum": 0, "maximum": 9}]
    assert "INTERFACE-READ-LIMITED" in declared(given, limits=limits, answers=ANSWER)


def test_a_graver_effect_is_one_that_somebody_knows_and_else_left_out() -> None:
    graver = {"effect": "actuate", "annotations": {**READ, "readOnlyHint": False}, "smoke": None}
    assert declared({}, **graver, answers=ANSWER) == []
    for answers in ({}, THIN):
        [found] = problems("interface", interface({}, **graver), known(artifacts, answers=answers))
        assert found.code == "INTERFACE-EFFECT-DIFFERS" and "unsafe" in str(found.hint)
        assert str(found.hint).startswith("write read, as IDENTIFY has read_angle")
        assert ("limits (a range" in str(found.hint)) == bool(answers)


def test_a_capability_is_left_out_as_unsafe_alone_or_with_its_device() -> None:
    why = {"id": LINE, "reason": "unsafe", "detail": "it may move what hangs on the line"}
    for entry, codes in (
        (why, []),
        ({**why, "capability": "read_angle"}, []),
        ({**why, "capability": "read_other"}, ["INTERFACE-CAPABILITY-WITHOUT-TOOL"]),
        ({"id": LINE, "reason": "unsafe"}, ["ARTIFACT-SHAPE"]),
        ({"id": LINE, "reason": "virtual", "capability": "read_angle"}, ["ARTIFACT-SHAPE"]),
    ):
        value = interface({})
        value["tools"].pop()
        value["left_out"].append(entry)
        found = [item.code for item in problems("interface", value, known(artifacts))]
        assert found == codes or (codes == ["ARTIFACT-SHAPE"] and found), entry
    served = interface({})
    served["left_out"].append(why)
    assert [each.code for each in problems("interface", served, known(artifacts))] == ["INTERFACE-LEFT-OUT-TWICE"]


_ARM = {"tool": "read_angle", "effect": "read", "parameters": {}}
# What is known of the line, and the text of the finding; None where the reason is accepted.
UNSAFE: dict[str, tuple[dict[str, Any], str | None]] = {
    "a line that no one knows": ({}, None),
    "such a line beside a class": ({"classes": ["tty", "video4linux"]}, None),
    "a class of the kernel": ({"classes": ["video4linux"], "raw_descriptor": "product: Acme Arm"}, "effect"),
    "an answer": ({"answers": ANSWER}, "an Acme Arm"),
    "an answer without limits": ({"answers": THIN}, None),
    "a profile": ({"profiles": {"arm": ProfileFacts("arm", frozenset({LINE}))}}, "denied in the `policy`"),
    "a grammar": ({"profiles": {"arm": ProfileFacts("arm", frozenset({LINE}), (), (_ARM,))}}, "each command"),
}


@for_each("case", UNSAFE)
def test_only_what_nobody_knows_is_unsafe(case: str) -> None:
    more, says = UNSAFE[case]
    seen = probe(**{name: more[name] for name in ("classes", "raw_descriptor") if name in more})
    before = identify("read_angle", "Read it.")
    if "profiles" in more:
        before["devices"][3] |= {"profile": "arm", "method": "profile"}
    given = artifacts(probe=seen, identify=before, answers=more.get("answers", {}), profiles=more.get("profiles", {}))
    why = {"id": LINE, "reason": "unsafe", "detail": "it may move what hangs on the line"}
    for entry in (why, {**why, "capability": "read_angle"}):
        value = interface({})
        value["tools"].pop()
        value["left_out"].append(entry)
        found = problems("interface", value, given)
        assert [item.code for item in found] == ([] if says is None else ["INTERFACE-REASON-FALSE"])
        assert all(says is not None and says in f"{item.summary} {item.hint}" for item in found), found


@for_each("case", UNSAFE)
def test_who_leaves_a_tool_out_is_told_of_that_reason_only_where_it_counts(case: str) -> None:
    more, says = UNSAFE[case]
    seen = probe(**{name: more[name] for name in ("classes", "raw_descriptor") if name in more})
    given = known(artifacts, answers=more.get("answers", {}), profiles=more.get("profiles", {}))
    value = interface({})
    value["tools"].pop()
    lines = [item for item in problems("interface", value, replace(given, probe=seen)) if "TOOL" in item.code]
    assert [("unsafe" in str(item.hint)) for item in lines] == [says is None]


_HEAD = '''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pyserial>=3", "lerobot>=0.3", "feetech-servo-sdk>=1"]
# ///
"""The line."""

import os
from pathlib import Path
from typing import Literal

import runtime
from fastmcp import FastMCP

mcp = FastMCP("line")
QUESTIONS = {"voltage": "MEAS:VOLT?", "current": b"MEAS:CURR?"}
GOALS = {"rest": b"MOVE 10", "flat": b"MOVE 20"}


def exchange(port, line):
    """Say a line and hear one."""
    port.write(line + b"\\\\n")
    return port.readline()


@mcp.tool(annotations={"readOnlyHint": True})
@runtime.logged
def read_angle(kind: Literal["voltage", "current"] = "voltage", channel: int = 1) -> dict:
    """Read it."""
    with runtime.device("usb-1234-0003").bus() as unit:
        node = unit.node("tty")
        %s


if __name__ == "__main__":
    mcp.run()
'''
_SERIAL = "import serial\n        with serial.Serial(node, 9600, timeout=1) as port:\n            "
_SDK = (
    "import scservo_sdk\n        port, packet = scservo_sdk.PortHandler(node), scservo_sdk.PacketHandler(0)\n        "
)
WRITING = [
    _SERIAL + 'return {"v": exchange(port, f"POS {channel}".encode())}',
    _SERIAL + 'return {"v": exchange(port, bytes([255, 255, channel]))}',
    _SERIAL + r'return {"v": exchange(port, b"\xff\xff\x06\x05\x03\x2a\x00\x08\xc1")}',
    _SERIAL + 'return {"v": exchange(port, GOALS["rest"])}',
    _SERIAL + 'return {"v": exchange(port, b"MOVE 10")}',
    _SERIAL + 'say = port.write\n            return {"v": say(b"RPM?")}',
    _SERIAL + 'return {"v": getattr(port, "wri" + "te")(b"RPM?")}',
    _SERIAL + 'port.dtr = True\n            return {"v": port.readline()}',
    _SERIAL + 'print(channel, file=port)\n            return {"v": port.readline()}',
    _SDK + 'return {"v": packet.write2ByteTxRx(port, channel, 42, 2048)}',
    _SDK + 'tell = packet.write1ByteTxRx\n        return {"v": tell(port, channel, 40, 0)}',
    _SDK + 'return {"v": packet.regWriteTxRx(port, channel, 42, 2, [0, 8])}',
    "from lerobot.motors.feetech import FeetechMotorsBus\n        bus = FeetechMotorsBus(node, {})\n"
    '        bus.sync_write("Goal_Position", {"a": channel})\n        return {"v": 1}',
    "from lerobot.motors.feetech import FeetechMotorsBus\n        bus = FeetechMotorsBus(node, {})\n"
    '        bus.disable_torque()\n        return {"v": bus.sync_read("Present_Position")}',
    'with Path(node).open("r+b", 0) as port:\n            port.write(bytes([channel]))\n            return {"v": 1}',
    'with open(node, "r+b", buffering=0) as port:\n            port.writelines([bytes([channel])])\n'
    '            return {"v": port.read(1)}',
    'fd = os.open(node, os.O_RDWR)\n        os.write(fd, bytes([channel]))\n        return {"v": os.read(fd, 9)}',
    'with os.fdopen(os.open(node, os.O_RDWR), "r+b", 0) as port:\n            port.write(b"%d" % channel)\n'
    '            return {"v": port.read(1)}',
    "import smbus2\n        bus = smbus2.SMBus(node)\n        bus.write_byte_data(8, 1, channel)\n"
    '        return {"v": 1}',
    "import usb.core\n        found = usb.core.find(idVendor=1)\n        found.ctrl_transfer(64, 1, channel)\n"
    '        return {"v": 1}',
    "import gpiozero\n        servo = gpiozero.AngularServo(1)\n        servo.angle = channel\n"
    '        return {"v": node}',
]
ASKING = [
    _SERIAL + 'return {"v": exchange(port, b"*IDN?")}',
    _SERIAL + 'port.write(b"*IDN?\\n")\n            return {"v": port.readline()}',
    _SERIAL + 'port.write(QUESTIONS[kind].encode())\n            return {"v": port.readline()}',
    _SERIAL + 'question = "MEAS:VOLT?" if kind == "voltage" else "MEAS:CURR?"\n'
    '            port.write(question.encode("ascii"))\n            return {"v": port.readline()}',
    _SERIAL + 'answers = []\n            for line in (b"V?", b"A?"):\n                port.write(line)\n'
    '                answers.append(port.readline())\n            return {"v": answers}',
    _SERIAL + 'port.reset_input_buffer()\n            return {"v": port.readline()}',
    _SDK + 'port.setBaudRate(1000000)\n        return {"v": packet.read2ByteTxRx(port, channel, 56)}',
    'with open(node, "r+b", buffering=0) as port:\n            port.write(b"NAME\\n")\n'
    '            return {"v": port.read(9)}',
    'fd = os.open(node, os.O_RDWR | os.O_NOCTTY)\n        os.write(fd, b"V?")\n        return {"v": os.read(fd, 9)}',
]
LISTENING = [
    'try:\n            return {"v": os.read(os.open(node, os.O_RDONLY), 80).decode("ascii")}\n'
    '        except OSError:\n            return {"v": ""}',
    'with open(node, "rb", buffering=0) as port:\n            return {"v": port.readline(80)}',
    'with Path(node).open("rb") as port:\n            return {"v": port.readline(80)}',
    'fd = os.open(node, os.O_RDONLY | os.O_NOCTTY)\n        try:\n            return {"v": os.read(fd, 9)}\n'
    "        finally:\n            os.close(fd)",
    'return {"v": [fields for fields in runtime.nmea.sentences(node, 1.0)]}',
    'return {"v": node}',
]
HIDDEN = [
    'return {"v": (lambda how: how(node, "r+b"))(open)}',
    'return {"v": os.open(node, os.O_RDONLY | channel)}',
    'return {"v": os.open(node, 2)}',
    'return {"v": open(node, kind)}',
    'return {"v": open(node, "rb", opener=os.open)}',
    'return {"v": getattr(os, "open")(node, 2)}',
    'return {"v": os.__dict__["open"](node, 2)}',
    'return {"v": TABLE[kind](node)}',
    'import ctypes\n        return {"v": ctypes.CDLL(None).open(node, 2)}',
    'import contextlib\n        return {"v": contextlib.os.write(9, b"")}',
    'return {"v": Path(node).write_bytes(b"1")}',
    'return {"v": runtime.units.Units(node).read("a", [])}',
    'import subprocess\n        return {"v": subprocess.run(["stty", node], check=True)}',
]


@for_each("body", WRITING)
def test_a_reading_sends_nothing_that_nobody_knows(body: str) -> None:
    assert "SERVE-LINE-WRITTEN" in served(body)
    assert "SERVE-LINE-WRITTEN" not in served(body, answers=ANSWER)
    assert listening(_HEAD % body) == frozenset()


@for_each("body", ASKING)
def test_a_reading_may_send_a_constant_question(body: str) -> None:
    assert "SERVE-LINE-WRITTEN" not in served(body)
    assert listening(_HEAD % body) == frozenset()


@for_each("body", LISTENING)
def test_who_only_listens_is_known_to(body: str) -> None:
    assert "SERVE-LINE-WRITTEN" not in served(body) and listening(_HEAD % body) == {"read_angle"}


@for_each("body", HIDDEN)
def test_what_is_no_plain_listening_counts_as_writing(body: str) -> None:
    text = (_HEAD % body).replace("GOALS =", 'TABLE = {"voltage": lambda node: os.open(node, os.O_RDWR)}\nGOALS =')
    assert listening(text) == frozenset()


def test_which_tools_reach_a_line_is_seen_in_their_code() -> None:
    assert all(on_a_line(_HEAD % body) == {"read_angle"} for body in (*WRITING, *ASKING, *LISTENING))
    other = _HEAD.replace('"tty"', '"input"') % 'return {"v": os.read(os.open(node, os.O_RDONLY), 24)}'
    assert on_a_line(other) == frozenset()
    assert on_a_line(
        other.replace("import os\n", "import os\nimport usb.core\n").replace("os.read(", "usb.core.find(")
    ) == {"read_angle"}


def test_a_line_beside_a_class_with_a_meaning_is_one_too() -> None:
    both = artifacts(probe=probe(classes=["tty", "video4linux"]))
    assert lines_beside(both) == {LINE} and LINE not in unknown_lines(both)
    assert LINE not in lines_beside(artifacts(probe=probe(classes=["tty", "input"]), answers=ANSWER))
    assert LINE not in lines_beside(artifacts(probe=probe(classes=["video4linux"])))


def probe(**more: Any) -> dict[str, Any]:
    value = copy.deepcopy(PROBE)
    value["devices"][3] |= {"classes": ["tty"], "name": "Acme Arm", "raw_descriptor": "product: Acme Arm", **more}
    return value


def identify(name: str, description: str, parameters: dict[str, Any] | None = None) -> dict[str, Any]:
    value = copy.deepcopy(IDENTIFY)
    reads = {"name": name, "description": description, "via": "a serial library", "effect": "read"}
    value["devices"][3] = {
        "id": LINE,
        "identified_as": "Acme Arm",
        "category": "bidirectional",
        "confidence": 0.9,
        "method": "descriptor_strings",
        "evidence": [{"quote": "product: Acme Arm"}],
        "capabilities": [{**reads, **({"parameters": parameters} if parameters else {})}],
    }
    return value


def problems(stage: str, value: Any, artifacts: Artifacts) -> list[Any]:
    return [item for item in check(stage, value, artifacts, SCHEMAS, "output") if item.severity == "error"]


def known(make: Any, **more: Any) -> Artifacts:
    made: Artifacts = make(probe=probe(), identify=identify("read_angle", "Read it."), **more)
    return made


def identified(
    name: str, description: str = "It reads.", parameters: dict[str, Any] | None = None, **more: Any
) -> list[str]:
    """The codes for a capability with these words, declared read."""
    value = identify(name, description, parameters)
    if "answers" in more:
        value["devices"][3] |= {"method": "user_answer", "evidence": [{"quote": "Acme Arm"}]}
    return [item.code for item in problems("identify", value, artifacts(probe=probe(), **more))]


def interface(properties: dict[str, Any], **more: Any) -> dict[str, Any]:
    value = copy.deepcopy(INTERFACE)
    value["left_out"] = [item for item in value["left_out"] if item["id"] != LINE]
    described = {name: {"description": "which one", **member} for name, member in properties.items()}
    tool = {
        "name": "read_angle",
        "capability": "read_angle",
        "devices": [LINE],
        "description": "Read it.",
        "effect": "read",
        "annotations": READ,
        "input_schema": {"type": "object", "properties": described, "additionalProperties": False},
        "output_schema": {"type": "object", "properties": {"v": {"type": "string"}}},
        "smoke": {"arguments": {}},
        **more,
    }
    value["tools"].append({name: member for name, member in tool.items() if member is not None})
    return value


def declared(properties: dict[str, Any], answers: dict[str, str] | None = None, **more: Any) -> list[str]:
    """The codes for a tool with these parameters, declared read."""
    value = interface(properties, **more)
    return [item.code for item in problems("interface", value, known(artifacts, answers=answers or {}))]


def served(body: str, answers: dict[str, str] | None = None) -> list[str]:
    """The codes for a server whose one tool has this body."""
    value = interface({})
    value["tools"] = value["tools"][-1:]
    given = known(artifacts, interface=value, answers=answers or {})
    return [item.code for item in problems("serve", _HEAD % body, given)]
