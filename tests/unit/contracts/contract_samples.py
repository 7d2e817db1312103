"""One good artifact of each stage, of a bench that does not exist; tests break one thing in a copy of them."""

import copy
from pathlib import Path
from typing import Any

from octoform.contracts import Artifacts, ProfileFacts

SCHEMAS = Path(__file__).parents[3] / "protocol" / "schemas"
PERCENT = {"minimum": 0, "maximum": 100}
SHA = "sha256:" + "0123456789abcdef" * 4

PROBE: dict[str, Any] = {
    "format": 1,
    "platform": {"os": "linux", "arch": "x86_64", "kernel": "6.1.0"},
    "hostname": "bench-seven",
    "timestamp": "2026-01-02T03:04:05Z",
    "scan_methods": [
        {"name": "sysfs", "status": "ok", "detail": "no terminal line was opened", "duration_ms": 12.5},
        {"name": "usb ids", "status": "not_found"},
    ],
    "devices": [
        {
            "id": "usb-1234-0001",
            "name": "Acme Deskcam",
            "interface": "usb",
            "raw_descriptor": "manufacturer: Acme\nproduct: Acme Deskcam\ndriver: uvcvideo",
            "vid": "1234",
            "pid": "0001",
            "classes": ["video4linux"],
            "drivers": ["uvcvideo"],
            "instance": {
                "sysfs": "/sys/devices/pci0000:00/usb1/1-1",
                "port": "1-1.4",
                "serial": "AC00451177",
                "strength": "strong",
                "nodes": [{"class": "video4linux", "name": "video0", "node": "/dev/video0"}],
            },
        },
        {
            "id": "hwmon-fanboard",
            "name": "fanboard",
            "interface": "platform",
            "raw_descriptor": "hwmon: fanboard\nfan1_label: case",
            "classes": ["hwmon"],
        },
        {
            "id": "usb-1234-0002",
            "name": "Widgetronic Lamp",
            "interface": "usb",
            "raw_descriptor": "manufacturer: Widgetronic\nproduct: Lamp\ndriver: lamp",
        },
        {
            "id": "usb-1234-0003",
            "name": "USB Serial",
            "interface": "usb",
            "raw_descriptor": "manufacturer: Bridgemaker\nproduct: USB Serial\ndriver: bridge",
            "classes": ["tty"],
            "instance": {"sysfs": "/sys/devices/pci0000:00/usb1/1-2", "port": "1-2", "address": "02:00:5e:10:00:01"},
        },
        {"id": "neighbour-router", "name": "router", "interface": "network", "raw_descriptor": "arp", "context": True},
        {"id": "pci-bridge", "name": "PCI bridge", "interface": "pci", "raw_descriptor": "class: 0604"},
    ],
}

IDENTIFY: dict[str, Any] = {
    "format": 1,
    "devices": [
        {
            "id": "usb-1234-0001",
            "identified_as": "Acme Deskcam",
            "category": "sensor",
            "confidence": 0.95,
            "method": "descriptor_strings",
            "evidence": [{"quote": "product: Acme Deskcam", "says": "it names itself"}],
            "capabilities": [
                {"name": "capture_image", "description": "One picture", "via": "OpenCV", "effect": "read"}
            ],
        },
        {
            "id": "hwmon-fanboard",
            "identified_as": "Fan board",
            "category": "bidirectional",
            "confidence": 0.9,
            "method": "kernel_class",
            "evidence": [{"quote": "hwmon: fanboard"}],
            "capabilities": [
                {"name": "read_fan_speed", "description": "Fan speed", "via": "hwmon", "effect": "read"},
                {"name": "set_fan_speed", "description": "Drive a fan", "via": "hwmon", "effect": "actuate"},
            ],
        },
        {
            "id": "usb-1234-0002",
            "identified_as": "Widgetronic Lamp",
            "category": "actuator",
            "confidence": 0.9,
            "method": "profile",
            "profile": "lamp",
            "evidence": [{"quote": "Widgetronic"}],
            "capabilities": [
                {"name": "set_lamp_level", "description": "Dim it", "via": "the lamp's library", "effect": "actuate"}
            ],
        },
        {
            "id": "usb-1234-0003",
            "identified_as": "USB serial bridge",
            "category": "unknown",
            "confidence": 0.0,
            "method": "none",
            "evidence": [{"quote": "USB Serial"}],
            "capabilities": [],
            "missing": "Say what is plugged into this serial bridge.",
        },
    ],
    "left_out": [
        {"id": "neighbour-router", "reason": "network_neighbour"},
        {"id": "pci-bridge", "reason": "bus_infrastructure"},
    ],
}

READ = {"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
ACT = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}

INTERFACE: dict[str, Any] = {
    "format": 1,
    "tools": [
        {
            "name": "capture_image",
            "capability": "capture_image",
            "devices": ["usb-1234-0001"],
            "description": "One picture of the camera.",
            "effect": "read",
            "annotations": READ,
            "input_schema": {
                "type": "object",
                "properties": {"width": {"type": "integer", "minimum": 1, "maximum": 4096}},
                "required": ["width"],
                "additionalProperties": False,
            },
            "output_schema": {"type": "object", "properties": {"width": {"type": "integer"}}},
            "smoke": {"arguments": {"width": 640}},
        },
        {
            "name": "read_fan_speed",
            "capability": "read_fan_speed",
            "devices": ["hwmon-fanboard"],
            "description": "Speed of the fan in revolutions per minute.",
            "effect": "read",
            "annotations": READ,
            "input_schema": {"type": "object", "properties": {}},
            "output_schema": {"type": "object", "properties": {"rpm": {"type": "number"}}},
            "smoke": {"arguments": {}},
        },
        {
            "name": "set_fan_speed",
            "capability": "set_fan_speed",
            "devices": ["hwmon-fanboard"],
            "description": "Drive the fan.",
            "effect": "actuate",
            "annotations": ACT,
            "input_schema": {
                "type": "object",
                "properties": {"percent": {"type": "number", **PERCENT}},
                "required": ["percent"],
            },
        },
        {
            "name": "set_lamp_level",
            "capability": "set_lamp_level",
            "devices": ["usb-1234-0002"],
            "description": "Dim the lamp.",
            "effect": "actuate",
            "annotations": ACT,
            "input_schema": {
                "type": "object",
                "properties": {"level": {"type": "number", **PERCENT}},
                "required": ["level"],
            },
            "limits": [{"parameter": "level", "minimum": 0, "maximum": 80, "unit": "percent"}],
        },
    ],
    "left_out": [
        {"id": "usb-1234-0003", "reason": "unknown_meaning"},
        {"id": "neighbour-router", "reason": "network_neighbour"},
        {"id": "pci-bridge", "reason": "bus_infrastructure"},
    ],
}

SERVER = '''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "opencv-python-headless"]
# ///
"""The bench."""

import subprocess

import runtime
from fastmcp import FastMCP

mcp = FastMCP("bench")
LAMP_STATUS = ["lampctl", "--status"]


@mcp.tool(name="capture_image")
@runtime.logged
def capture(width: int) -> dict:
    """One picture of the camera."""
    with runtime.bus("usb-1234-0001"):
        return runtime.child.call(_picture, width)


def _picture(width: int) -> dict:
    import cv2

    camera = cv2.VideoCapture(runtime.device("usb-1234-0001").node("video4linux"))
    camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    try:
        return {"ok": [camera.read()[0] for _ in range(5)][-1]}
    finally:
        camera.release()


@mcp.tool
@runtime.logged
def read_fan_speed() -> dict:
    """Speed of the fan in revolutions per minute."""
    return {"rpm": _fan()}


def _fan() -> int:
    path = runtime.device("hwmon-fanboard").path("hwmon") / "fan1_input"
    return int(path.read_text())


@mcp.tool
@runtime.logged
def set_fan_speed(percent: float) -> dict:
    """Drive the fan."""
    with runtime.bus("hwmon-fanboard"):
        _drive(percent)
    return {}


def _drive(percent: float) -> None:
    with open(runtime.device("hwmon-fanboard", actuate=True).node("fan"), "w") as line:
        line.write(str(percent))


@mcp.tool
@runtime.logged
def set_lamp_level(level: float) -> dict:
    """Dim the lamp."""
    subprocess.run(["lampctl", "--level", str(level)], check=True, timeout=5)
    subprocess.run(LAMP_STATUS, check=True, timeout=5)
    return {}


if __name__ == "__main__":
    mcp.run()
'''

DEPLOY: dict[str, Any] = {
    "format": 1,
    "status": "ok",
    "requirements": [
        {"name": "fastmcp", "version": "4.1.2", "why": "the server"},
        {"name": "opencv-python-headless", "version": "4.10.0.84", "why": "the camera"},
    ],
    "imports": [
        {"module": "fastmcp", "provided_by": "fastmcp"},
        {"module": "cv2", "provided_by": "opencv_python_headless"},
        {"module": "runtime", "provided_by": "runtime"},
        {"module": "subprocess", "provided_by": "python"},
    ],
    "deps_failed": [],
}

PROFILES = {
    "lamp": ProfileFacts(
        "lamp",
        frozenset({"usb-1234-0002"}),
        ({"parameter": "level", "minimum": 0, "maximum": 80, "unit": "percent"},),
    )
}


def good(stage: str) -> Any:
    """A fresh copy of the good artifact of a stage."""
    values = {"probe": PROBE, "identify": IDENTIFY, "interface": INTERFACE, "serve": SERVER, "deploy": DEPLOY}
    return copy.deepcopy(values[stage])


def artifacts(**other: Any) -> Artifacts:
    """The good artifacts of all stages, with what a test replaces."""
    known: dict[str, Any] = {name: good(name) for name in ("probe", "identify", "interface", "serve", "deploy")}
    return Artifacts(**{**known, "profiles": PROFILES, **other})
