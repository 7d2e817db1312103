# /// script
# requires-python = ">=3.11"
# dependencies = [
#   "fastmcp>=4.1,<4.2",
#   "feetech-servo-sdk>=1.0,<2",
#   "opencv-python-headless>=4.10,<5",
#   "pydantic>=2.10,<3",
#   "pyserial>=3.5,<4",
#   "typing-extensions>=4.12,<5",
# ]
# ///
"""Tools for an SO-ARM101 robot arm, a two-axis camera rail and a Microsoft LifeCam Studio camera."""

import errno
import fcntl
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import runtime
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.tools import ToolResult
from fastmcp.utilities.types import Image
from pydantic import Field
from typing_extensions import TypedDict

mcp = FastMCP("bench")

READ = {"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
SET = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
STEP = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": False, "openWorldHint": False}


def within(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Refuse an argument beyond its limit, before any device is touched."""
    if not low <= value <= high:
        raise ToolError(f"{name} {value} is outside of its limit, {low} to {high} {unit}; nothing was moved")


# The robot arm: six servos on one serial line.

ARM = "usb-1a86-55d3"
ARM_BAUD = 1_000_000
ARM_TX_MS = 10.0  # the library's own wait for an answer is too short on a busy host
ARM_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ARM_HOME = dict(zip(ARM_JOINTS, (2048, 2048, 1100, 2048, 2048, 2048), strict=True))
ARM_REST = dict(zip(ARM_JOINTS, (2048, 870, 3090, 2500, 2048, 2048), strict=True))
Cell = runtime.registers.Field
SERVOS = runtime.registers.Map(
    unit="joint",
    units={name: number for number, name in enumerate(ARM_JOINTS, 1)},
    fields={
        "lowest": Cell(9, 2),
        "highest": Cell(11, 2),
        "torque": Cell(40),
        "acceleration": Cell(41),
        "goal": Cell(42, 2),
        "speed": Cell(46, 2),
        "position": Cell(56, 2, sign_bit=15),
        "present_speed": Cell(58, 2, sign_bit=15),
        "load": Cell(60, 2, scale=0.1, sign_bit=10),
        "voltage": Cell(62, scale=0.1),
        "temperature": Cell(63),
        "moving": Cell(66),
        "current": Cell(69, 2, scale=6.5, sign_bit=15),
    },
    motion=runtime.registers.Motion(
        goal="goal", present="position", lowest="lowest", highest="highest", minimum=0, maximum=4095,
        before=(("torque", 1), ("acceleration", 20), ("speed", "speed")),
        speeds=(50, 1500), moved=50, within=20.0, release=(("torque", 0),),
    ),
    protect=runtime.registers.Protect("temperature", refuse_at=69, resume_below=60, unit="Cel"),
    calibration=("~/.cache/huggingface/lerobot/calibration/robots/*/*.json",),
)
STATUS_FIELDS = ("position", "load", "voltage", "temperature", "torque", "moving")
JOINT_FIELDS = ("position", "present_speed", "load", "voltage", "temperature", "current", "moving")

Joint = Annotated[
    Literal[
        "shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper",
        "1", "2", "3", "4", "5", "6",
    ],
    Field(description="which joint, by its name or its id"),
]
JointName = Literal["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
Speed = Annotated[int, Field(ge=50, le=1500, description="speed of the movement, in raw/s")]
Skipped = Annotated[str | None, Field(description="why the joint was left alone, or null")]
Counts = Annotated[int | None, Field(description="raw counts")]
Raw = Annotated[int | None, Field(description="raw")]
Percent = Annotated[float | None, Field(description="%")]
Volts = Annotated[float | None, Field(description="V")]
Celsius = Annotated[int | None, Field(description="Cel (degrees Celsius)")]
Milliamperes = Annotated[float | None, Field(description="mA")]
BusId = Annotated[int, Field(description="bus id, raw")]


class JointStatus(TypedDict):
    """What one joint feels, as far as it answered."""

    joint: JointName
    skipped: Skipped
    id: BusId
    position: Counts
    load: Percent
    voltage: Volts
    temperature: Celsius
    torque: Raw
    moving: Raw
    calibrated: Percent


class ArmStatus(TypedDict):
    """All joints, and why there is no calibrated position, or null."""

    device: str
    joints: list[JointStatus]
    calibration: str | None


class JointReading(TypedDict):
    """What one joint feels."""

    device: str
    joint: JointName
    skipped: Skipped
    id: BusId
    position: Counts
    present_speed: Raw
    load: Percent
    voltage: Volts
    temperature: Celsius
    current: Milliamperes
    moving: Raw
    calibrated: Percent


MOVED = {
    "joint": JointName,
    "skipped": Skipped,
    "from": Counts,
    "goal": Annotated[int, Field(description="raw counts")],
    "position": Counts,
    "moved": bool,
}
JointMove = TypedDict("JointMove", {"device": str, **MOVED})
MoveRecord = TypedDict("MoveRecord", MOVED)
RestRecord = TypedDict("RestRecord", {**MOVED, "released": bool})


class ArmMove(TypedDict):
    """What came of a movement, for each joint."""

    device: str
    joints: list[MoveRecord]


class ArmRest(TypedDict):
    """The same, with whether each joint was made limp."""

    device: str
    joints: list[RestRecord]


class JointTorque(TypedDict):
    """Whether a joint is held."""

    device: str
    joint: JointName
    skipped: Skipped
    id: BusId
    on: bool | None


class StopRecord(TypedDict):
    """Where a joint was stopped."""

    joint: JointName
    skipped: Skipped
    id: BusId
    position: Counts


class ArmStop(TypedDict):
    """Where each joint was stopped."""

    device: str
    joints: list[StopRecord]


class ServoPort:
    """The open bus of the servos, through the maker's library, as `runtime.registers` uses it."""

    def __init__(self, port: Any, packets: Any) -> None:
        """The library's port, open, and its handler of packets."""
        self._port, self._packets = port, packets

    def read(self, unit_id: int, address: int, size: int) -> int:
        """The unsigned value at an address of a servo."""
        self._port.ser.reset_input_buffer()
        ask = self._packets.read1ByteTxRx if size == 1 else self._packets.read2ByteTxRx
        value, result, flags = ask(self._port, unit_id, address)
        self._judge(result)
        if flags:
            raise runtime.registers.NoReply(f"it reports a fault of its own, flags 0x{flags:02x}")
        return int(value)

    def write(self, unit_id: int, address: int, size: int, value: int) -> int:
        """Write it; the servo's own fault flags."""
        self._port.ser.reset_input_buffer()
        order = self._packets.write1ByteTxRx if size == 1 else self._packets.write2ByteTxRx
        result, flags = order(self._port, unit_id, address, value)
        self._judge(result)
        return int(flags)

    def _judge(self, result: int) -> None:
        """Raise for a communication result other than success."""
        if result != 0:
            raise runtime.registers.NoReply(str(self._packets.getTxRxResult(result)))


@contextmanager
def servo_bus(actuate: bool) -> Iterator[ServoPort]:
    """The arm's line, locked, and open for one group of exchanges."""
    import scservo_sdk

    with runtime.device(ARM, actuate=actuate).bus() as unit:
        port = scservo_sdk.PortHandler(unit.node("tty"))
        if not port.setBaudRate(ARM_BAUD):  # this opens it as well
            raise ToolError(f"the arm's serial line cannot be set to {ARM_BAUD} baud; see which adapter it has")
        try:
            port.tx_time_per_byte = ARM_TX_MS
            yield ServoPort(port, scservo_sdk.PacketHandler(0))
        finally:
            port.closePort()


def arm(actuate: bool) -> runtime.units.Units:
    """The joints of the arm; nothing is opened before they are asked for something."""
    return runtime.units.Units(SERVOS, ARM, partial(servo_bus, actuate))


@mcp.tool(annotations=READ)
@runtime.logged
def arm_status() -> ArmStatus:
    """Reads what all six joints of the SO-ARM101 robot arm feel: position, load, voltage, temperature, torque and
    whether they move. Returns one record for each joint; a joint that does not answer has null values. Where
    the arm has no single LeRobot calibration file, calibrated is null.
    """
    return arm(actuate=False).read_all(STATUS_FIELDS)


@mcp.tool(annotations=READ)
@runtime.logged
def arm_read_joint(joint: Joint) -> JointReading:
    """Reads what one joint of the SO-ARM101 robot arm feels: position, speed, load, voltage, temperature, current
    and whether it moves. Where the arm has no single LeRobot calibration file, calibrated is null.
    """
    return arm(actuate=False).read(joint, JOINT_FIELDS)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_move_joint(
    joint: Joint,
    position: Annotated[int, Field(ge=0, le=4095, description="goal of the joint, in raw")],
    speed: Speed = 400,
) -> JointMove:
    """Moves one joint of the SO-ARM101 robot arm to a position in raw counts, of which 4096 are a full turn and
    2048 is near the centre. Returns where it was, its goal and where it is. The arm moves, for up to twenty
    seconds a joint; a joint from 69 Cel on is refused until it reads below 60, and an acknowledgement without a
    change of at least 50 counts is an error.
    """
    within("position", position, 0, 4095, "raw")
    within("speed", speed, 50, 1500, "raw/s")
    return arm(actuate=True).move(joint, position, speed)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_move_joint_calibrated(
    joint: Joint,
    percent: Annotated[
        float, Field(ge=-100, le=100, description="goal within the calibrated range of the joint, in %")
    ],
    speed: Speed = 400,
) -> JointMove:
    """Moves one joint of the SO-ARM101 robot arm to a percentage of its calibrated range, where 0 is the middle.
    Returns where it was, its goal and where it is, in raw counts. Without a single calibration file of the arm
    the movement is refused. The arm moves, for up to twenty seconds a joint; a joint from 69 Cel on is refused
    until it reads below 60, and an acknowledgement without a change of at least 50 counts is an error.
    """
    within("percent", percent, -100, 100, "%")
    within("speed", speed, 50, 1500, "raw/s")
    return arm(actuate=True).move_percent(joint, percent, speed)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_move_joints(
    shoulder_pan: Annotated[int, Field(ge=0, le=4095, description="goal of shoulder_pan, in raw")],
    shoulder_lift: Annotated[int, Field(ge=0, le=4095, description="goal of shoulder_lift, in raw")],
    elbow_flex: Annotated[int, Field(ge=0, le=4095, description="goal of elbow_flex, in raw")],
    wrist_flex: Annotated[int, Field(ge=0, le=4095, description="goal of wrist_flex, in raw")],
    wrist_roll: Annotated[int, Field(ge=0, le=4095, description="goal of wrist_roll, in raw")],
    gripper: Annotated[int, Field(ge=0, le=4095, description="goal of gripper, in raw")],
    speed: Speed = 400,
) -> ArmMove:
    """Moves all six joints of the SO-ARM101 robot arm to positions in raw counts, one for each joint. Returns one
    record for each joint with where it was, its goal and where it is. The arm moves, for up to twenty seconds a
    joint; a joint from 69 Cel on is refused until it reads below 60, and an acknowledgement without a change of
    at least 50 counts is an error.
    """
    places = (shoulder_pan, shoulder_lift, elbow_flex, wrist_flex, wrist_roll, gripper)
    goals = dict(zip(ARM_JOINTS, places, strict=True))
    for name, goal in goals.items():
        within(name, goal, 0, 4095, "raw")
    within("speed", speed, 50, 1500, "raw/s")
    return arm(actuate=True).move_many(goals, speed)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_home(speed: Speed = 400) -> ArmMove:
    """Stands the SO-ARM101 robot arm up so that hardly any joint works against gravity. Returns one record for
    each joint with where it was, its goal and where it is. The arm moves, for up to twenty seconds a joint; a
    joint from 69 Cel on is refused until it reads below 60, and an acknowledgement without a change of at least
    50 counts is an error.
    """
    within("speed", speed, 50, 1500, "raw/s")
    return arm(actuate=True).pose(ARM_HOME, speed)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_rest(speed: Speed = 400) -> ArmRest:
    """Folds the SO-ARM101 robot arm onto its base and makes it limp there. Returns one record for each joint with
    where it was, its goal, where it is and whether it was released. The arm moves, for up to twenty seconds a
    joint; a joint from 69 Cel on is refused until it reads below 60, and an acknowledgement without a change of
    at least 50 counts is an error.
    """
    within("speed", speed, 50, 1500, "raw/s")
    return arm(actuate=True).pose(ARM_REST, speed, release=True)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_set_torque(
    joint: Joint, on: Annotated[bool, Field(description="true holds the joint, false makes it limp")]
) -> JointTorque:
    """Holds one joint of the SO-ARM101 robot arm or makes it limp. Returns the joint and whether it is held. A
    limp arm drops.
    """
    return arm(actuate=True).torque(joint, on)


@mcp.tool(annotations=SET)
@runtime.logged
def arm_stop() -> ArmStop:
    """Ends the movement of the SO-ARM101 robot arm under way and holds every joint where it is. Returns the
    position of each joint in raw counts. Torque stays as it was: a limp joint stays limp.
    """
    return arm(actuate=True).stop()


# The camera rail: one command a line, one line in answer, and a position that is counted.

RAIL = "usb-2341-804f"
WIRE = runtime.lines.Wire("tty", 115200, "\n", error=r"ERR (?P<message>.*)", timeout=25.0, settle=0.3)
Steps = Annotated[int, Field(ge=-2000, le=2000, description="steps, negative is back, in steps")]
StepCount = Annotated[int | None, Field(description="steps")]


class Acknowledged(TypedDict):
    """The line that was sent and the line that came back."""

    device: str
    command: str
    answer: str


class RailPosition(TypedDict):
    """Where the axes must be, or why that is not known."""

    device: str
    x: StepCount
    y: StepCount
    unknown: str | None


class RailStop(TypedDict):
    """What the stop keeps away, and until when."""

    device: str
    stopped: bool
    until: str
    note: str


def rail(command: str, step: runtime.counting.Step) -> Acknowledged:
    """Send one command to the rail and wait for its acknowledgement."""
    import serial

    talk = runtime.lines.Exchange(RAIL, WIRE, command, ["OK"], step)
    with (
        talk,
        runtime.device(RAIL, actuate=True).bus() as unit,
        serial.Serial(unit.node("tty"), WIRE.baud, timeout=0.1, write_timeout=5, exclusive=True) as port,
    ):
        answer = talk.over(port)
    return {"device": RAIL, "command": command, "answer": answer.lines[0]}


@mcp.tool(annotations=STEP)
@runtime.logged
def rail_move_x(steps: Steps) -> Acknowledged:
    """Moves the camera along the X axis of the camera rail by a number of motor steps, from where it is. Something
    moves, for more than three seconds at 2000 steps. OK as the answer says that the firmware counted the steps,
    not that the carriage moved.
    """
    within("steps", steps, -2000, 2000, "steps")
    return rail(f"MOVE_X {steps}", runtime.counting.Step(axis="x", by=steps))


@mcp.tool(annotations=STEP)
@runtime.logged
def rail_move_y(steps: Steps) -> Acknowledged:
    """Moves the camera along the Y axis of the camera rail by a number of motor steps, from where it is. Something
    moves, for more than three seconds at 2000 steps. OK as the answer says that the firmware counted the steps,
    not that the carriage moved.
    """
    within("steps", steps, -2000, 2000, "steps")
    return rail(f"MOVE_Y {steps}", runtime.counting.Step(axis="y", by=steps))


@mcp.tool(annotations=SET)
@runtime.logged
def rail_home() -> Acknowledged:
    """Drives both axes of the camera rail back to their origin. Something moves, for up to sixteen seconds.
    Afterwards the position is known as 0 and 0, as far as the firmware counts.
    """
    return rail("HOME", runtime.counting.Step(zero=True, resumes=True))


@mcp.tool(annotations=READ)
@runtime.logged
def rail_position() -> RailPosition:
    """Says where both axes of the camera rail must be, in motor steps counted from the moves that were
    acknowledged since the last rail_home. It is counted and not measured: null, with the reason in unknown,
    before the first rail_home and after a command that failed.
    """
    return runtime.counting.position(RAIL, runtime.device(RAIL).node("tty"), ("x", "y"), "rail_home")


@mcp.tool(annotations=SET)
@runtime.logged
def rail_stop() -> RailStop:
    """Keeps every further command from the camera rail until rail_home went well. A movement under way still ends
    by itself, which takes a few seconds for a move and up to sixteen for the way home.
    """
    return runtime.counting.stop(runtime.device(RAIL, actuate=True).id, "rail_home")


# The camera: pictures through OpenCV, controls through the ioctls of Video4Linux2 (linux/videodev2.h).

CAMERA = "usb-045e-0772"
SETTLING = 10  # frames that are thrown away while the exposure settles
QUERY_CONTROL, QUERY_MENU, GET_CONTROL = 0xC0445624, 0xC02C5625, 0xC008561B
NOT_OFFERED = (errno.EINVAL, errno.ENOTTY)  # of one control, and of a camera without any
DISABLED, GRABBED, READ_ONLY, INACTIVE, WRITE_ONLY = 0x1, 0x2, 0x4, 0x10, 0x40
KINDS = {1: "integer", 2: "boolean", 3: "menu", 9: "menu"}
INTEGER_MENU = 9
CONTROLS = {
    "brightness": 0x00980900,
    "contrast": 0x00980901,
    "saturation": 0x00980902,
    "hue": 0x00980903,
    "gain": 0x00980913,
    "gamma": 0x00980910,
    "sharpness": 0x0098091B,
    "backlight_compensation": 0x0098091C,
    "power_line_frequency": 0x00980918,
    "white_balance_automatic": 0x0098090C,
    "white_balance_temperature": 0x0098091A,
    "auto_exposure": 0x009A0901,
    "exposure_time_absolute": 0x009A0902,
    "focus_automatic_continuous": 0x009A090C,
    "focus_absolute": 0x009A090A,
}
ControlName = Literal[
    "brightness", "contrast", "saturation", "hue", "gain", "gamma", "sharpness", "backlight_compensation",
    "power_line_frequency", "white_balance_automatic", "white_balance_temperature", "auto_exposure",
    "exposure_time_absolute", "focus_automatic_continuous", "focus_absolute",
]
RawNumber = Annotated[int, Field(description="raw")]
ANY_SIZE = "the camera has to be asked for its sizes, the bound is safe for any"
ANY_VALUE = (
    "in the control's own scale; the camera is asked for the range of the control at every call, "
    "and this bound is safe for any"
)
LEVEL = {"type": "number", "minimum": 0, "maximum": 255}
PICTURE = {
    "type": "object",
    "properties": {
        "device": {"type": "string", "description": "id of the device"},
        "width": {"type": "integer", "description": "width in pixels"},
        "height": {"type": "integer", "description": "height in pixels"},
        "format": {"type": "string", "enum": ["jpeg"], "description": "format of the picture"},
        "mean_brightness": {**LEVEL, "description": "mean brightness, raw, 0 to 255"},
        "brightness_spread": {**LEVEL, "description": "standard deviation of the brightness, raw, 0 to 255"},
        "captured_at": {"type": "string", "description": "time of the picture, UTC, ISO 8601"},
    },
    "required": ["device", "width", "height", "format", "mean_brightness", "brightness_spread", "captured_at"],
}


class Choice(TypedDict):
    """A value of a menu."""

    value: RawNumber
    label: str


class Control(TypedDict):
    """A control that the camera offers, in its own scale."""

    control: ControlName
    kind: Literal["integer", "boolean", "menu"]
    minimum: RawNumber
    maximum: RawNumber
    step: RawNumber
    default: RawNumber
    value: Raw
    inactive: bool
    choices: list[Choice]


class Controls(TypedDict):
    """All controls that the camera offers, and when they were read (UTC)."""

    device: str
    controls: list[Control]
    read_at: str


class ControlChange(TypedDict):
    """A control before and after it was set, as the camera reports it."""

    device: str
    control: ControlName
    before: Raw
    value: Raw


def utc_now() -> str:
    """The time in UTC, as ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def grab(node: str, width: int, height: int) -> tuple[bytes, int, int, float, float]:
    """One picture with settled exposure: JPEG, width, height, mean and spread of its brightness."""
    import cv2

    api = cv2.CAP_V4L2 if runtime.v4l2.is_node(node) else cv2.CAP_ANY
    camera = cv2.VideoCapture(node, api)
    try:
        if not camera.isOpened():
            raise ToolError("the camera cannot be opened; see whether another program uses it")
        camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        for _ in range(SETTLING):
            if not camera.grab():
                raise ToolError("the camera gives no frames; plug it in again")
        is_read, frame = camera.read()
    finally:
        camera.release()
    if not is_read:
        raise ToolError("the camera gave no picture; plug it in again")
    is_coded, coded = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, 90])
    if not is_coded:
        raise ToolError("the picture cannot be written as JPEG; see which formats the camera has")
    mean, spread = cv2.meanStdDev(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    return coded.tobytes(), frame.shape[1], frame.shape[0], float(mean[0][0]), float(spread[0][0])


@mcp.tool(annotations=READ, output_schema=PICTURE)
@runtime.logged
def capture_image(
    width: Annotated[int, Field(ge=16, le=4096, description=f"wanted width in pixels; {ANY_SIZE}")] = 640,
    height: Annotated[int, Field(ge=16, le=4096, description=f"wanted height in pixels; {ANY_SIZE}")] = 480,
) -> ToolResult:
    """Takes one picture through the Microsoft LifeCam Studio camera. Returns the picture as JPEG, with its size
    and the mean and spread of its brightness, by which a black frame shows. The camera picks the size nearest
    to the one asked for; exposure needs a few frames, so the first ones are thrown away.
    """
    with runtime.device(CAMERA).bus() as unit:
        data, wide, high, mean, spread = runtime.child.call(grab, unit.node("video4linux"), width, height)
        captured_at = utc_now()
    return ToolResult(
        content=[Image(data=data, format="jpeg")],
        structured_content={
            "device": CAMERA,
            "width": wide,
            "height": high,
            "format": "jpeg",
            "mean_brightness": round(mean, 2),
            "brightness_spread": round(spread, 2),
            "captured_at": captured_at,
        },
    )


def asked(camera: Any, request: int, question: bytes) -> bytes | None:
    """The answer of the camera to a request about its controls; None where it does not have what was asked for."""
    try:
        return fcntl.ioctl(camera, request, question.ljust(request >> 16 & 0x3FFF, b"\0"))
    except OSError as problem:
        if problem.errno in NOT_OFFERED:
            return None
        raise


def text_of(padded: bytes) -> str:
    """The text in a field of fixed length."""
    return padded.split(b"\0")[0].decode("utf-8", "replace").strip()


def choices_of(camera: Any, number: int, kind: int, low: int, high: int) -> list[Choice]:
    """The values of a menu, which may have gaps."""
    found: list[Choice] = []
    for index in range(low, min(high, low + 63) + 1):
        answer = asked(camera, QUERY_MENU, struct.pack("=II", number, index))
        if answer is not None:
            label = str(struct.unpack_from("=8xq", answer)[0]) if kind == INTEGER_MENU else text_of(answer[8:40])
            found.append({"value": index, "label": label})
    return found


def control_of(camera: Any, name: ControlName) -> tuple[Control, int] | None:
    """A control with its flags, as the camera reports it now; None for one that it does not offer."""
    number = CONTROLS[name]
    answer = asked(camera, QUERY_CONTROL, struct.pack("=I", number))
    if answer is None:
        return None
    kind, low, high, step, default, flags = struct.unpack_from("=4xI32xiiiiI", answer)
    if kind not in KINDS or flags & DISABLED:
        return None
    value = None
    if not flags & WRITE_ONLY:
        found = fcntl.ioctl(camera, GET_CONTROL, struct.pack("=Ii", number, 0))
        value = struct.unpack("=Ii", found)[1]
    control: Control = {
        "control": name,
        "kind": KINDS[kind],
        "minimum": low,
        "maximum": high,
        "step": step,
        "default": default,
        "value": value,
        "inactive": bool(flags & INACTIVE),
        "choices": choices_of(camera, number, kind, low, high) if KINDS[kind] == "menu" else [],
    }
    return control, flags


@mcp.tool(annotations=READ)
@runtime.logged
def read_camera_controls() -> Controls:
    """Reads the controls that the Microsoft LifeCam Studio camera offers now, each with its range, step, factory
    value and present value. Values are raw numbers in each control's own scale. A control that the camera does
    not offer is missing.
    """
    with runtime.device(CAMERA).bus() as unit, Path(unit.node("video4linux")).open("rb", 0) as camera:
        found = [control_of(camera, name) for name in CONTROLS]
    return {"device": CAMERA, "controls": [each[0] for each in found if each is not None], "read_at": utc_now()}


@mcp.tool(annotations=SET)
@runtime.logged
def set_camera_control(
    control: Annotated[ControlName, Field(description="which control")],
    value: Annotated[int, Field(ge=-65536, le=65536, description=f"new value, raw, {ANY_VALUE}")],
) -> ControlChange:
    """Sets one control of the Microsoft LifeCam Studio camera to a value, which later pictures show. Returns the
    value before and the value that the camera reports afterwards. A control that the camera does not offer, a
    value outside its range, or a control that another one keeps inactive is an error.
    """
    with runtime.device(CAMERA, actuate=True).bus() as unit:
        node = unit.node("video4linux")
        with Path(node).open("rb", 0) as camera:
            found = control_of(camera, control)
            if found is None:
                raise ToolError(f"the camera does not offer the control {control}; nothing was set")
            before, flags = found
            if refused := refusal(before, flags, value):
                raise ToolError(f"{control} was not set: {refused}")
            runtime.v4l2.set_control(node, CONTROLS[control], value)
            after = control_of(camera, control)
    if after is None or (after[0]["value"] is not None and after[0]["value"] != value):
        raise ToolError(f"{control} did not take {value}; read the controls to see what the camera made of it")
    return {"device": CAMERA, "control": control, "before": before["value"], "value": after[0]["value"]}


def refusal(control: Control, flags: int, value: int) -> str:
    """Why a control cannot be set to a value now; "" where it can."""
    low, high, step = control["minimum"], control["maximum"], control["step"]
    if flags & READ_ONLY:
        return "it can only be read"
    if flags & (INACTIVE | GRABBED):
        return "another control or program keeps it inactive"
    if not low <= value <= high:
        return f"{value} is outside of its range, {low} to {high}"
    if control["kind"] == "menu" and value not in [choice["value"] for choice in control["choices"]]:
        return f"{value} is none of its choices"
    if step > 1 and (value - low) % step:
        return f"{value} is not on its steps of {step} from {low}"
    return ""


if __name__ == "__main__":
    mcp.run()
