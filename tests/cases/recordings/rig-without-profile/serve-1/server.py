# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pydantic>=2", "opencv-python-headless>=4.10,<5"]
# ///
"""Serves one USB camera (a Microsoft LifeCam Studio), and tells whether one USB servo bus (a Feetech SO-ARM101) is attached.

The camera is opened for each call and released in it. The line of the servo bus is never opened.
"""

import errno
import fcntl
import os
import re
import struct
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import runtime
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.tools import ToolResult
from fastmcp.utilities.types import Image
from pydantic import Field

mcp = FastMCP("camera-and-servo-bus")

Camera = Annotated[Literal["usb-045e-0772"], Field(description="the device; there is one")]
ServoBus = Annotated[Literal["usb-1a86-55d3"], Field(description="the device; there is one")]

SETTLING = 5
"""Frames that are thrown away while the exposure settles."""
MAX_FORMATS, MAX_SIZES, MAX_SETTINGS = 64, 256, 256
DECODED = ("MJPG", "YUYV", "UYVY", "YVYU", "NV12", "NV21", "YU12", "YV12", "I420", "BGR3", "RGB3", "GREY", "JPEG")
"""Pixel formats that OpenCV turns into a picture, the quickest first."""

# The questions about a control, of linux/videodev2.h.
QUERY_CONTROL, GET_CONTROL = 0xC0445624, 0xC008561B
QUERY = struct.Struct("=II32s4iI8x")
VALUE = struct.Struct("=Ii")
NEXT_CONTROL = 0x80000000
DISABLED, INACTIVE, WRITE_ONLY = 0x01, 0x10, 0x40
CONTROL_CLASS = 6
KINDS = {1: "integer", 2: "boolean", 3: "menu", 8: "integer", 9: "menu"}
"""Types of controls that have a plain number as their value."""

PICTURE = {
    "type": "object",
    "additionalProperties": False,
    "required": [
        "device",
        "width_pixels",
        "height_pixels",
        "image_format",
        "brightness_mean_percent",
        "brightness_spread_percent",
        "time",
    ],
    "properties": {
        "device": {"type": "string", "description": "id of the device"},
        "width_pixels": {"type": "integer", "minimum": 1, "description": "width of the picture in pixels"},
        "height_pixels": {"type": "integer", "minimum": 1, "description": "height of the picture in pixels"},
        "image_format": {"type": "string", "enum": ["jpeg", "png"], "description": "format of the image content"},
        "brightness_mean_percent": {
            "type": "number",
            "minimum": 0,
            "maximum": 100,
            "description": "mean brightness of the picture in percent of full white; near 0 is a black frame",
        },
        "brightness_spread_percent": {
            "type": "number",
            "minimum": 0,
            "maximum": 100,
            "description": "standard deviation of the brightness in percent of full white; near 0 is a uniform frame",
        },
        "time": {"type": "string", "description": "time of the reading, RFC 3339, UTC"},
    },
}


@dataclass
class Size:
    """One picture size, in pixels."""

    width_pixels: Annotated[int, Field(ge=1, description="pixels")]
    height_pixels: Annotated[int, Field(ge=1, description="pixels")]


@dataclass
class Format:
    """One pixel format with its picture sizes."""

    pixel_format: str
    description: str
    compressed: bool
    sizes: list[Size]


@dataclass
class Formats:
    """All pixel formats of a camera."""

    device: str
    formats: list[Format]
    time: str


@dataclass
class Setting:
    """One picture setting, in raw numbers of the driver."""

    name: str
    kind: Literal["integer", "boolean", "menu", "other"]
    value_raw: float | None
    minimum_raw: float | None
    maximum_raw: float | None
    step_raw: float | None
    default_raw: float | None
    active: bool


@dataclass
class Settings:
    """All picture settings of a camera."""

    device: str
    settings: list[Setting]
    time: str


@dataclass
class Presence:
    """Whether a device is attached, and whether the kernel made a serial line of it."""

    device: str
    present: bool
    serial_line: bool
    time: str


def now() -> str:
    """The time, RFC 3339 in UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def offered(node: str) -> list[dict[str, Any]]:
    """The formats that the camera gives; an error where it gives none."""
    found = runtime.v4l2.formats(node)
    if not found:
        raise ToolError("the camera reports no picture format; unplug it and plug it in again")
    return found


def pairs(sizes: list[str]) -> list[tuple[int, int]]:
    """Width and height of each size; of a range, its smallest and its largest."""
    return [(int(width), int(height)) for size in sizes for width, height in re.findall(r"(\d+)x(\d+)", size)]


def nearest(formats: list[dict[str, Any]], wanted: int) -> tuple[str, int, int]:
    """The pixel format and the size nearest to a width, the higher and the quicker first among equals."""
    found = [
        (abs(width - wanted), -height, DECODED.index(each["pixel_format"]), width)
        for each in formats
        if each["pixel_format"] in DECODED
        for width, height in pairs(each["sizes"])
    ]
    if not found:
        raise ToolError("the camera offers no picture size in a pixel format that can be decoded here")
    _, negative, place, width = min(found)
    return DECODED[place], width, -negative


def grab(node: str, code: str, width: int, height: int, seconds: int) -> tuple[bytes, int, int, float, float]:
    """One settled picture as JPEG, its width and height, and mean and spread of its brightness in percent."""
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")  # seconds; read when the library is loaded
    import cv2

    is_node = runtime.v4l2.is_node(node)
    end = time.monotonic() + seconds
    camera = cv2.VideoCapture(node, cv2.CAP_V4L2) if is_node else cv2.VideoCapture(node)
    try:
        if not camera.isOpened():
            raise ToolError("the camera cannot be opened; see whether another program is using it")
        if is_node:
            camera.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*code))
            camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        taken = 0
        while taken <= SETTLING:
            good, frame = camera.read()
            taken += bool(good)
            if taken <= SETTLING and time.monotonic() >= end:
                raise ToolError(f"the camera gave no settled picture within {seconds} s; see whether it is in use")
            if not good:
                time.sleep(0.05)
    finally:
        camera.release()
    written, data = cv2.imencode(".jpg", frame)
    if not written:
        raise ToolError("the picture of the camera could not be written as JPEG; call again")
    mean, spread = cv2.meanStdDev(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    percent = 100 / 255
    return data.tobytes(), frame.shape[1], frame.shape[0], float(mean[0][0]) * percent, float(spread[0][0]) * percent


def value_of(file: Any, number: int) -> int | None:
    """The present value of a control; None where the camera does not give it."""
    try:
        return VALUE.unpack(fcntl.ioctl(file, GET_CONTROL, VALUE.pack(number, 0)))[1]
    except OSError:
        return None


def controls(node: str) -> list[Setting]:
    """Each control that the driver lists, with its present value."""
    found: list[Setting] = []
    readable = number = 0
    with Path(node).open("rb", 0) as file:
        while len(found) < MAX_SETTINGS:
            try:
                asked = QUERY.pack(number | NEXT_CONTROL, 0, b"", 0, 0, 0, 0, 0)
                answer = QUERY.unpack(fcntl.ioctl(file, QUERY_CONTROL, asked))
            except OSError as problem:
                if problem.errno == errno.EINVAL or (problem.errno == errno.ENOTTY and number == 0):
                    break  # the list has ended, or the camera has no controls at all
                raise
            number, kind, name, low, high, step, default, flags = answer
            if kind == CONTROL_CLASS or flags & DISABLED:
                continue
            plain = kind in KINDS and not flags & WRITE_ONLY
            readable += plain
            found.append(
                Setting(
                    name=name.split(b"\0")[0].decode("utf-8", "replace"),
                    kind=KINDS.get(kind, "other"),
                    value_raw=value_of(file, number) if plain else None,
                    minimum_raw=low if plain else None,
                    maximum_raw=high if plain else None,
                    step_raw=step if plain else None,
                    default_raw=default if plain else None,
                    active=not flags & INACTIVE,
                )
            )
    if readable and all(each.value_raw is None for each in found):
        raise ToolError("the camera gave the value of none of its settings; unplug it and plug it in again")
    return found


READ = {"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}


@mcp.tool(annotations=READ, output_schema=PICTURE)
@runtime.logged
def capture_image(
    device: Camera = "usb-045e-0772",
    width_pixels: Annotated[
        int,
        Field(
            ge=16,
            le=4096,
            description="wanted width in pixels; the nearest size that the camera offers is taken. "
            "The bounds are safe for any camera; this camera's own sizes are asked at the call",
        ),
    ] = 640,
    timeout_seconds: Annotated[int, Field(ge=1, le=30, description="seconds to wait for a frame")] = 10,
) -> ToolResult:
    """Take one still picture with the Microsoft LifeCam Studio camera. Returns the picture as image content, and beside it its size in pixels, its format, and the mean and spread of its brightness, so that a black or uniform frame can be told from a real one. The camera is opened for the call only; it usually takes one to three seconds, as the first frames of a camera can be dark. The size is the camera's own size nearest to the width asked for, which can differ from it."""
    with runtime.device(device).bus() as unit:
        node = unit.node("video4linux", "video")
        code, width, height = nearest(offered(node), width_pixels)
        data, width, height, mean, spread = runtime.child.call(grab, node, code, width, height, timeout_seconds)
        taken_at = now()
    return ToolResult(
        content=[Image(data=data, format="jpeg")],
        structured_content={
            "device": device,
            "width_pixels": width,
            "height_pixels": height,
            "image_format": "jpeg",
            "brightness_mean_percent": round(mean, 3),
            "brightness_spread_percent": round(spread, 3),
            "time": taken_at,
        },
    )


@mcp.tool(annotations=READ)
@runtime.logged
def list_camera_formats(device: Camera = "usb-045e-0772") -> Formats:
    """List the pixel formats that the Microsoft LifeCam Studio camera offers, each with its picture sizes. Returns one entry for each format. No picture is taken; an offered size does not mean that every frame rate is possible with it."""
    with runtime.device(device).bus() as unit:
        found = offered(unit.node("video4linux", "video"))
    formats = [
        Format(
            pixel_format=each["pixel_format"],
            description=each["description"],
            compressed=each["compressed"],
            sizes=[Size(width, height) for width, height in pairs(each["sizes"])[:MAX_SIZES]],
        )
        for each in found[:MAX_FORMATS]
    ]
    return Formats(device=device, formats=formats, time=now())


@mcp.tool(annotations=READ)
@runtime.logged
def read_camera_settings(device: Camera = "usb-045e-0772") -> Settings:
    """Read the picture settings that the Microsoft LifeCam Studio camera reports, such as brightness or exposure. Returns for each setting its name, its present value, its range, step and default; all are raw numbers of the driver, without a unit that could be relied on. The list is empty where the camera reports none. Nothing is changed."""
    with runtime.device(device).bus() as unit:
        node = unit.node("video4linux", "video")
        offered(node)  # an error for what is no camera, which would have no settings either
        found = controls(node)
    return Settings(device=device, settings=found, time=now())


@mcp.tool(annotations=READ)
@runtime.logged
def check_presence(device: ServoBus = "usb-1a86-55d3") -> Presence:
    """Tell whether the Feetech SO-ARM101 servo bus is attached to this host. Returns whether the USB device is there and whether the kernel made a serial line of it. The line itself is never opened and nothing is sent, so the result does not say whether anything behind the bus has power or works."""
    try:
        unit = runtime.device(device)
    except runtime.DeviceAbsent:
        return Presence(device=device, present=False, serial_line=False, time=now())
    lines = unit.paths("tty")
    return Presence(device=device, present=unit.folder.is_dir(), serial_line=len(lines) > 0, time=now())


if __name__ == "__main__":
    mcp.run()
