"""What the description of a tool may speak of: its own device, by its own name, and what its capability does."""

from typing import Any

import pytest
from cases import for_each
from unit.contracts.contract_samples import READ, SCHEMAS

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Severity

BOARD, CAMERA, BUS = "dmi-board", "usb-1f00-00c1", "usb-1f00-00b5"


def device(name: str, identified_as: str, lines: str, *classes: str) -> dict[str, Any]:
    return {"id": name, "name": identified_as, "interface": "usb", "classes": list(classes), "raw_descriptor": lines}


def identified(name: str, identified_as: str, kind: str, capability: str, about: str) -> dict[str, Any]:
    ability = {"name": capability, "description": about, "via": f"the {kind} class", "effect": "read"}
    return {
        "id": name,
        "identified_as": identified_as,
        "class": kind,
        "category": "sensor",
        "capabilities": [ability],
    }


def tool(capability: str, name: str, text: str) -> dict[str, Any]:
    return {
        "name": capability,
        "capability": capability,
        "devices": [name],
        "description": text,
        "effect": "read",
        "annotations": READ,
        "input_schema": {"type": "object", "properties": {}, "additionalProperties": False},
        "output_schema": {"type": "object", "properties": {"model": {"type": ["string", "null"]}}},
        "smoke": {"arguments": {}},
    }


KNOWN = Artifacts(
    probe={
        "devices": [
            device(BOARD, "GPD G1621-02", "sys_vendor: GPD\nproduct: G1621-02", "dmi"),
            device(CAMERA, "Heron H20", "manufacturer: Heron Optics\nproduct: Heron H20", "video4linux"),
            device(
                BUS,
                "Reiher RX-ARM200",
                "manufacturer: Reiher Werk\nproduct: Reiher RX-ARM200 bus\ndriver: cdc_acm",
                "tty",
            ),
        ]
    },
    identify={
        "devices": [
            identified(BOARD, "GPD G1621-02 computer", "computer", "read_system_identity", "Read maker and model."),
            identified(CAMERA, "Heron H20 camera", "camera", "capture_image", "Take one picture."),
            identified(BUS, "Reiher RX-ARM200 bus", "bus", "read_device_presence", "Whether it is attached."),
        ],
        "left_out": [],
    },
)
CAMERA_TEXT = "Take one picture with the Heron H20 camera."
TEXTS = {
    BOARD: "Read maker and model of the GPD G1621-02 computer.",
    CAMERA: CAMERA_TEXT,
    BUS: "Report whether the Reiher RX-ARM200 bus is attached. Nothing is sent to it.",
}
OF = {BOARD: "read_system_identity", CAMERA: "capture_image", BUS: "read_device_presence"}
WRONG = {
    (BOARD, "Read maker and model of the GPD Pocket computer."): "'Pocket' is in no text of it",
    (BOARD, "Read the model. The GPD Pocket 3 is meant."): "'Pocket' is in no text of it",
    (CAMERA, "Take one picture with the Heron H20 Pro camera."): "'Pro' is in no text of it",
    (CAMERA, f"{CAMERA_TEXT} The RX-ARM200 is seen in it."): "which is another device",
    (CAMERA, f"{CAMERA_TEXT} Before it the arm is turned to the given place."): "its capability reads",
    (CAMERA, f"{CAMERA_TEXT} It then moves the carriage."): "its capability reads",
    (BOARD, "Report which gripper is open."): "is about a gripper",
}
RIGHT = [
    *TEXTS.items(),
    (BOARD, "Read the GPD's model, as Linux has it in its DMI table."),
    (BOARD, "Read maker and model of the GPD G1621-02 Laptop Computer."),
    (CAMERA, f"{CAMERA_TEXT} It is not that of the RX-ARM200."),
    (CAMERA, f"{CAMERA_TEXT} Nothing is moved to it."),
    (CAMERA, f"{CAMERA_TEXT} Returned as JPEG or PNG in 1920x1080, beside its brightness."),
    (BUS, "Report whether the Reiher Werk bus is attached. Nothing is sent to it."),
    (CAMERA, "Macht ein Bild mit der Heron H20."),
    (CAMERA, "Takes a photograph with the webcam. Works over USB3 and I2C0."),
]


def judged(name: str, text: str, **more: Any) -> list[str]:
    tools = [{**tool(OF[each], each, TEXTS[each]), **({"description": text} if each == name else {})} for each in TEXTS]
    tools[2] |= more
    found = check("interface", {"format": 1, "tools": tools, "left_out": []}, KNOWN, SCHEMAS)
    return [f"{item.code}: {item.summary}" for item in found if item.severity is Severity.ERROR]


@for_each("case", WRONG)
def test_a_description_of_something_else_is_refused(case: tuple[str, str]) -> None:
    [found] = judged(*case)
    assert found.startswith("INTERFACE-DESCRIPTION") and WRONG[case] in found


@for_each("case", RIGHT)
def test_a_description_of_its_own_device_is_accepted(case: tuple[str, str]) -> None:
    assert judged(*case) == []


NUMBER = {"type": "integer", "minimum": 0, "maximum": 6, "description": "an index", "default": 0}
THERE = TEXTS[BUS]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (THERE, "channel"),
        (THERE, "index"),
        (f"{THERE}\n\nThrough: the bus, address 42 with the index.", None),
        (f"{THERE}\n\nThrough: class tty, register 0x2a.", None),
    ],
)
def test_to_see_that_a_device_is_there_asks_it_nothing(text: str, name: str | None) -> None:
    schema = {"type": "object", "properties": {name: NUMBER} if name else {}, "additionalProperties": False}
    [found] = judged(BUS, text, input_schema=schema)
    assert found.startswith("INTERFACE-READ-MOVES") and "asks it nothing" in found


def test_it_may_be_waited_for() -> None:
    seconds = {"type": "number", "minimum": 0, "maximum": 10, "default": 0, "description": "seconds"}
    schema = {"type": "object", "properties": {"wait_seconds": seconds}, "additionalProperties": False}
    text = f"{THERE}\n\nThrough: sysfs of the kernel, class tty; the line itself stays closed, at 115200 baud."
    assert judged(BUS, text, input_schema=schema) == []
