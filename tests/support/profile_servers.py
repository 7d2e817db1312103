"""Edits of the embedded agent's servers of devices with a profile: those that contradict it, and those that do not."""

LAMP = """---
name: bench-lamp
about: the lamp over the bench
evidence: {all: [{vid_pid: "16c0:05df"}, {text: [lamp]}]}
grammar:
  line: {class: tty, baud: 9600, ok: "OK", error: "E({message})", timeout: 2s}
  commands:
    - tool: lamp_dim
      send: "DIM {percent} {fade}"
      about: dim the lamp
      effect: actuate
      parameters:
        percent: {type: number, minimum: 0, maximum: 100, unit: "%"}
        fade: {type: string, enum: [slow, fast]}
    - {tool: lamp_off, send: "OFF", about: switch the lamp off, effect: actuate}
---
It shines.
"""

Edit = tuple[str, str, str]
_LINE = 'line = f"MOVE_X {steps:d}"'
_STOPPED = 'return RailStopAnswer(**runtime.counting.stop(device, until="rail_home"))'
_HOME, _POSITION = 'line = "HOME"', "units.move(joint, position, speed)"
_UNITS = "units.stop()"
_RAW = """
    with open_so_arm101(device, True) as bus:
        bus.packets.write2ByteTxRx(bus.port, {}, {}, {})
"""

# the device, what is replaced, by what, words of the finding
WRONG: dict[str, tuple[str, str, str, str]] = {
    "another speed of the bus": ("arm", "setBaudRate(1000000)", "setBaudRate(115200)", "115200"),
    "another goal": ("arm", '"goal": runtime.registers.Field(42, 2)', '"goal": runtime.registers.Field(44, 2)', "44"),
    "one byte of two": ("arm", "Field(56, 2, sign_bit=15)", "Field(56, 1, sign_bit=15)", "'position'"),
    "without a sign": ("arm", "Field(58, 2, sign_bit=15)", "Field(58, 2)", "'present_speed'"),
    "another scale": ("arm", "scale=6.5", "scale=0.65", "0.65"),
    "a register of its own": ("arm", '"moving": runtime', '"extra": runtime', "'extra'"),
    "another unit": ("arm", '"gripper": 6', '"gripper": 7', "'gripper' as 7"),
    "no protection from heat": (
        "arm",
        '    protect=runtime.registers.Protect("temperature", 69, 60, "Cel"),\n',
        "",
        "hot",
    ),
    "the goal is the speed": ("arm", 'goal="goal"', 'goal="speed"', "'speed' as goal"),
    "another pose": ("arm", '"shoulder_lift": 870', '"shoulder_lift": 1870', "1870"),
    "held where it rests": ("arm", "speed, release=True)", "speed)", "release"),
    "a mirrored position": ("arm", _POSITION, "units.move(joint, 4095 - position, speed)", "4088"),
    "a stop that moves": ("arm", _UNITS, "units.move_many({'gripper': 2048}, 400)", "moves a unit"),
    "a stop that goes to the middle": (
        "arm",
        f"    return ArmStopAnswer(**{_UNITS})",
        _RAW.format(1, 42, 2048) + f"    return ArmStopAnswer(**{_UNITS})",
        "2048",
    ),
    "a register by hand": (
        "arm",
        f"    return ArmStopAnswer(**{_UNITS})",
        _RAW.format(1, 44, 0) + f"    return ArmStopAnswer(**{_UNITS})",
        "register 44",
    ),
    "a unit by hand": (
        "arm",
        f"    return ArmStopAnswer(**{_UNITS})",
        _RAW.format(9, 40, 0) + f"    return ArmStopAnswer(**{_UNITS})",
        "unit 9",
    ),
    "another speed of the line": ("rail", "baud=115200", "baud=9600", "9600"),
    "another end of a line": ("rail", 'ending="\\n"', 'ending="\\r\\n"', "ending"),
    "twice the steps": ("rail", _LINE, 'line = f"MOVE_X {2 * steps:d}"', "MOVE_X 14"),
    "the other direction": ("rail", _LINE, 'line = f"MOVE_X {-steps:d}"', "MOVE_X -7"),
    "the other axis": ("rail", _LINE, 'line = f"MOVE_Y {steps:d}"', "MOVE_Y 7"),
    "a command of its own": ("rail", _HOME, 'line = "HOMEALL"', "HOMEALL"),
    "counted the other way": ("rail", 'Step("x", steps)', 'Step("x", -steps)', "counts -7"),
    "counted on the other axis": ("rail", 'Step("x", steps)', 'Step("y", steps)', "'y'"),
    "a stop that nothing ends": ("rail", "Step(zero=True, resumes=True)", "Step(zero=True)", "resumes"),
    "an origin that is not counted": ("rail", "Step(zero=True, resumes=True)", "Step(resumes=True)", "origin"),
    "a stop that sends": (
        "rail",
        _STOPPED,
        'exchange(device, "STOP", [], WIRES["camera-rail"], actuate=True)\n    ' + _STOPPED,
        "'STOP'",
    ),
    "a half of the light": ("lamp", "{percent", "{0.5 * percent", "sends"),
}
RIGHT: dict[str, Edit] = {
    "another speed of another device": (
        "arm",
        "class Registers:",
        "def open_other(node):\n    return serial.Serial(node, baudrate=9600, timeout=1)\n\n\nclass Registers:",
    ),
    "the speed as a name": ("arm", "setBaudRate(1000000)", "setBaudRate(int(1e6))"),
    "goals by a table": ("arm", "units.pose(goals, speed)", "units.pose(dict(goals), speed)"),
    "a register of the profile by hand": (
        "arm",
        f"    return ArmStopAnswer(**{_UNITS})",
        _RAW.format(1, 40, 1) + f"    return ArmStopAnswer(**{_UNITS})",
    ),
    "a goal that was read": (
        "arm",
        f"    return ArmStopAnswer(**{_UNITS})",
        _RAW.format(1, 42, "bus.read(1, 56, 2)") + f"    return ArmStopAnswer(**{_UNITS})",
    ),
    "a line put together": ("rail", _LINE, 'line = " ".join(["MOVE_X", str(steps)])'),
    "a line by a table": ("rail", _HOME, 'line = {"home": "HOME"}["home"]'),
    "a step by its names": ("rail", 'Step("x", steps)', 'Step(axis="x", by=steps)'),
    "a number in another form": ("rail", _LINE, 'line = f"MOVE_X {steps:.1f}"'),
    "a file beside it": (
        "rail",
        _HOME,
        _HOME + '\n    with open("/tmp/rail.log", "a") as log:\n        log.write("home")',
    ),
}

_HEAD = """# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pyserial", "feetech-servo-sdk"]
# ///
import re

import runtime
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError

mcp = FastMCP("bench")
ACT = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": False, "openWorldHint": False}
"""
_TOOL = "\n\n@mcp.tool(annotations=ACT)\n@runtime.logged\n"
OWN_RAIL = f"""{_HEAD}
BAUD = 115_200


def talk(command: str) -> str:
    import serial

    with runtime.device("usb-2341-804f", actuate=True).bus() as unit:
        port = serial.Serial()
        port.port, port.baudrate, port.timeout = unit.node("tty"), BAUD, 25
        port.open()
        try:
            port.reset_input_buffer()
            port.write(command.encode("ascii") + b"\\n")
            answer = port.readline().decode("ascii", "replace").strip()
        finally:
            port.close()
    if answer != "OK":
        raise ToolError(f"the rail answered {{answer[:40]!r}}")
    return answer
{_TOOL}def rail_move_x(steps: int) -> dict:
    return {{"answer": talk(f"MOVE_X {{steps}}")}}
{_TOOL}def rail_move_y(steps: int) -> dict:
    words = ["MOVE_Y", str(steps)]
    return {{"answer": talk(" ".join(words))}}
{_TOOL}def rail_home() -> dict:
    return {{"answer": talk("HOME")}}
"""
OWN_ARM = f"""{_HEAD}
JOINTS = {{"shoulder_pan": 1, "shoulder_lift": 2, "elbow_flex": 3, "wrist_flex": 4, "wrist_roll": 5, "gripper": 6}}
GOAL, PRESENT, TORQUE = 42, 56, 40


class Arm:
    def __init__(self, node):
        import scservo_sdk

        self.port, self.packets = scservo_sdk.PortHandler(node), scservo_sdk.PacketHandler(0)
        self.port.openPort()
        self.port.setBaudRate(1_000_000)

    def read(self, number, address):
        value, result, flags = self.packets.read2ByteTxRx(self.port, number, address)
        if result or flags:
            raise ToolError(f"joint {{number}} does not answer")
        return value

    def write(self, number, address, value):
        result, flags = self.packets.write2ByteTxRx(self.port, number, address, value)
        if result or flags:
            raise ToolError(f"joint {{number}} does not answer")
{_TOOL}def arm_move_joint(joint: str, position: int, speed: int = 400) -> dict:
    with runtime.device("usb-1a86-55d3", actuate=True).bus() as unit:
        arm = Arm(unit.node("tty"))
        arm.packets.write1ByteTxRx(arm.port, JOINTS[joint], TORQUE, 1)
        arm.write(JOINTS[joint], 46, speed)
        arm.write(JOINTS[joint], GOAL, position)
        return {{"position": arm.read(JOINTS[joint], PRESENT)}}
{_TOOL}def arm_stop() -> dict:
    with runtime.device("usb-1a86-55d3", actuate=True).bus() as unit:
        arm = Arm(unit.node("tty"))
        for number in JOINTS.values():
            arm.packets.write2ByteTxRx(arm.port, number, GOAL, arm.read(number, PRESENT))
        arm.packets.write1ByteTxRx(arm.port, 254, TORQUE, 1)
    return {{"stopped": True}}
"""
# a server in words of its own -> edits that contradict the profile, each with words of the finding
OWN: dict[str, tuple[str, dict[tuple[str, str], str]]] = {
    "rail": (
        OWN_RAIL,
        {
            ("BAUD = 115_200", "BAUD = 9600"): "9600",
            ('f"MOVE_X {steps}"', 'f"MOVE_X {-steps}"'): "MOVE_X -7",
            ('["MOVE_Y", str(steps)]', '["MOVE_X", str(steps)]'): "MOVE_X 7",
            ('talk("HOME")', 'talk("HOMEALL")'): "HOMEALL",
            ('command.encode("ascii")', 'command.lower().encode("ascii")'): "move_x 7",
        },
    ),
    "arm": (
        OWN_ARM,
        {
            ("1_000_000", "115_200"): "115200",
            ("GOAL, PRESENT, TORQUE = 42", "GOAL, PRESENT, TORQUE = 44"): "register 44",
            ("GOAL, arm.read(number, PRESENT))", "GOAL, 2048)"): "2048",
            ("arm.port, 254, TORQUE", "arm.port, 9, TORQUE"): "unit 9",
        },
    ),
}
