"""A simulated host whose camera, serial boards and sensor are plugged in elsewhere while their endpoint is live.

A board is a pty with a firmware behind it that answers each line with its own name; a camera is a node with a frame in
it; a sensor is an attribute. What the agent would write is here, by hand, and holds no node, port or number.
"""

import json
import os
import threading
import tty
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sysfs_tree import Tree

CAMERA, BOARD, TWIN, SENSOR = "usb-1f00-00c1", "usb-1f00-00b1", "usb-1f00-00b1-2", "usb-1f00-00a1"
ANSWERS = (
    f"{{{BOARD}: a bench board that moves its lever on and off, {TWIN}: a bench board that moves its lever on and off}}"
)
"""The owner's answer about the boards: nothing else shows that they may be moved over a serial line."""
PCI = "pci0000:00/0000:00:14.0/usb1"
SERVER = f'''"""Endpoint of a bench with a camera, two boards and a sensor."""

# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pydantic>=2.12,<3"]
# ///

from typing import Annotated, Literal

import runtime
from fastmcp import FastMCP
from pydantic import BaseModel, Field

mcp = FastMCP("bench")
Which = Annotated[Literal["{BOARD}", "{TWIN}"], Field(description="the board")]


class Said(BaseModel):
    """What a device said."""

    text: str


def exchange(unit, line):
    with open(unit.node("tty"), "r+b", buffering=0) as port:
        port.write(line)
        return port.read(40).decode().strip()


@mcp.tool(
    annotations={{"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}}
)
@runtime.logged
def capture_image() -> Said:
    """Take a picture."""
    with runtime.device("{CAMERA}").bus() as unit, open(unit.node("video4linux"), "rb", buffering=0) as camera:
        return Said(text=camera.read(100).decode())


@mcp.tool(
    annotations={{"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}}
)
@runtime.logged
def read_temperature() -> Said:
    """Read the temperature in thousandths of a degree Celsius."""
    with runtime.device("{SENSOR}").bus() as unit:
        return Said(text=runtime.read_text(unit.path("hwmon") / "temp1_input") or "")


@mcp.tool(
    annotations={{"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}}
)
@runtime.logged
def ask_board(device: Which) -> Said:
    """Ask a board for its name."""
    with runtime.device(device).bus() as unit:
        return Said(text=exchange(unit, b"NAME\\n"))


@mcp.tool(
    annotations={{"readOnlyHint": False, "destructiveHint": False, "idempotentHint": False, "openWorldHint": False}}
)
@runtime.logged
def move_board(device: Which) -> Said:
    """Move a board by one step."""
    with runtime.device(device, actuate=True).bus() as unit:
        return Said(text=exchange(unit, b"STEP\\n"))


if __name__ == "__main__":
    mcp.run(show_banner=False)
'''
ToolRow = tuple[list[str], str, str]
"""The devices of a tool, its description and its effect."""
_TOOLS: Mapping[str, ToolRow] = {
    "capture_image": ([CAMERA], "Take a picture.", "read"),
    "read_temperature": ([SENSOR], "Read the temperature in thousandths of a degree Celsius.", "read"),
    "ask_board": ([BOARD, TWIN], "Ask a board for its name.", "read"),
    "move_board": ([BOARD, TWIN], "Move a board by one step.", "actuate"),
}


class Host:
    """The host's tree, and what is plugged into it."""

    def __init__(self, root: Path) -> None:
        self.tree = Tree(root)
        self._open: dict[str, tuple[int, int]] = {}

    def camera(self, port: str, number: int) -> None:
        """A camera with a serial number, whose node holds a frame."""
        self._usb(port, "00c1", "Bench Cam", serial="CAM-7F31A9")
        self._part(port, f"video4linux/video{number}", "video4linux", {"name": "Bench Cam"}, f"video{number}")
        (self.tree.root / f"dev/video{number}").write_text("a frame")

    def sensor(self, port: str, number: int, value: str) -> None:
        """A thermometer without a serial number."""
        self._usb(port, "00a1", "Bench Thermometer")
        self._part(port, f"hwmon/hwmon{number}", "hwmon", {"name": "benchtemp", "temp1_input": value})

    def board(self, port: str, name: str, says: str) -> None:
        """A board without a serial number; its line is a live pty, whose firmware answers from the file ``says``."""
        self._usb(port, "00b1", "Bench Board")
        self._part(port, f"{name}/tty/{name}", "tty", {}, name)
        firmware, line = os.openpty()
        tty.setraw(line)
        (self.tree.root / "dev" / name).symlink_to(os.ttyname(line))
        self._open[port] = firmware, line
        threading.Thread(target=_answer, args=(firmware, says), daemon=True).start()

    def unplug(self, port: str) -> None:
        """Take away what is in a port, its nodes too."""
        folder = self.tree.root / "sys/devices" / PCI / port
        for part in folder.rglob("uevent"):
            name = part.read_text().partition("DEVNAME=")[2].partition("\n")[0]
            if name:
                (self.tree.root / "dev" / name).unlink()
        self.tree.unplug(f"{PCI}/{port}")
        for descriptor in self._open.pop(port, ()):
            os.close(descriptor)

    def clear(self) -> None:
        """Take away everything."""
        for device in (self.tree.root / "sys/devices" / PCI).glob("*-*"):
            self.unplug(device.name)

    def _usb(self, port: str, product: str, name: str, serial: str = "") -> None:
        self.tree.usb(f"{PCI}/{port}", "1f00", product, serial)
        folder = self.tree.root / "sys/devices" / PCI / port
        (folder / "product").write_text(name + "\n")
        (folder / "manufacturer").write_text("Bench Works\n")
        (folder / "modalias").write_text(f"usb:v1F00p{product.upper()}d0100\n")
        self.tree.bus(f"{PCI}/{port}/{port}:1.0", "usb", {"bInterfaceNumber": "00"})

    def _part(self, port: str, path: str, kind: str, attributes: dict[str, str], node: str = "") -> None:
        event = {"DEVNAME": node, "MAJOR": "250", "MINOR": node[-1]} if node else {}
        self.tree.member(f"{PCI}/{port}/{port}:1.0/{path}", kind, attributes, **event)


def _answer(firmware: int, says: str) -> None:
    """The firmware: one line back for each line, until it is unplugged."""
    try:
        while asked := os.read(firmware, 64):
            os.write(firmware, f"{says} {asked.decode().strip()}\n".encode())
    except OSError:  # unplugged
        return


def script(server: str = SERVER, more: Mapping[str, ToolRow] | None = None) -> dict[str, list[object]]:
    """What the scripted agent writes behind PROBE; ``more`` are tools that ``server`` has besides."""
    tools = {**_TOOLS, **(more or {})}
    names = {CAMERA: "Bench Cam", BOARD: "Bench Board", TWIN: "Bench Board", SENSOR: "Bench Thermometer"}
    identify = {"format": 1, "devices": [_annotated(each, name, tools) for each, name in names.items()], "left_out": []}
    interface = {"format": 1, "tools": [_tool(name, *row) for name, row in tools.items()], "left_out": []}
    return {
        "identify": [{"write": json.dumps(identify)}],
        "interface": [{"write": json.dumps(interface)}],
        "serve": [{"write": server}],
        "deploy": ["good"],
    }


def _annotated(device: str, name: str, tools: Mapping[str, ToolRow]) -> dict[str, Any]:
    made = [
        {"name": f"{tool}_line", "description": text, "via": "an interface of the kernel", "effect": effect}
        for tool, (devices, text, effect) in tools.items()
        if device in devices
    ]
    return {
        "id": device,
        "identified_as": f"Bench Works {name}",
        "category": "bidirectional" if len(made) > 1 else "sensor",
        "confidence": 0.9,
        "method": "descriptor_strings",
        "evidence": [{"quote": f"product: {name}"}, {"quote": "manufacturer: Bench Works"}],
        "capabilities": made,
    }


def _tool(name: str, devices: list[str], text: str, effect: str) -> dict[str, Any]:
    reads = effect == "read"
    which = {"device": {"type": "string", "enum": devices, "description": "the board"}} if len(devices) > 1 else {}
    return {
        "name": name,
        "capability": f"{name}_line",  # each result is the line that was read, and no quantity
        "devices": devices,
        "description": text,
        "effect": effect,
        "annotations": {
            "readOnlyHint": reads,
            "destructiveHint": False,
            "idempotentHint": reads,
            "openWorldHint": False,
        },
        "input_schema": {
            "type": "object",
            "properties": which,
            "additionalProperties": False,
            **({"required": [*which]} if which else {}),
        },
        "output_schema": {"type": "object", "properties": {"text": {"type": "string"}}, "required": ["text"]},
        **({"smoke": {"arguments": {"device": devices[0]} if which else {}}} if reads else {}),
    }
