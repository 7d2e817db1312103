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
