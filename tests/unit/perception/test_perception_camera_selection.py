"""The cameras of a host are found by what accepted artifacts say, and the one for looking by where it is plugged in."""

from typing import Any

import pytest

from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.perception.camera_selection import Camera, best, cameras

ROOT = "/sys/devices/pci0000:00/0000:00:14.0/usb1"
BENCH, DESK, LID, ARM = "usb-1f00-00c1", "usb-1f00-00c2", "usb-1f00-00c3", "usb-1f00-00a1"
PLACES = {BENCH: "/1-2/1-2.1", DESK: "/1-4", LID: "/1-5", ARM: "/1-2/1-2.4", "usb-1f00-0009": "/1-2"}
ORDERED = (BENCH, DESK, LID)


def probed() -> dict[str, Any]:
    found = []
    for name, place in PLACES.items():
        device: dict[str, Any] = {
            "id": name,
            "interface": "usb",
            "raw_descriptor": "",
            "instance": {"sysfs": ROOT + place},
        }
        found.append(device)
    found[2]["instance"]["removable"] = "fixed"
    found[3]["classes"] = ["tty"]
    return {"devices": found}


IDENTIFIED = {
    "devices": [{"id": name, "category": "sensor", "capabilities": []} for name in (*ORDERED, ARM, "usb-1f00-0009")]
}


def tool(name: str, *devices: str, capability: str = "capture_image", **schema: Any) -> dict[str, Any]:
    properties: dict[str, Any] = {"width": {"type": "integer", "default": 640}}
    if len(devices) > 1:
        properties["device"] = {"enum": list(devices)}
        schema = {"required": ["device"]}
    return {
        "name": name,
        "capability": capability,
        "devices": list(devices),
        "effect": "read",
        "input_schema": {"type": "object", "properties": properties, **schema},
        "smoke": {"arguments": {"width": 16}},
    }


def offered(*tools: dict[str, Any]) -> dict[str, Any]:
    return {"tools": list(tools)}


def test_each_camera_with_its_call_its_hub_and_its_place() -> None:
    found = cameras(probed(), IDENTIFIED, offered(tool("capture_image", LID, DESK, BENCH)), hint=DESK)
    assert found == (
        Camera(BENCH, ToolCall("capture_image", {"device": BENCH}), hub_shared_with=(ARM,)),
        Camera(DESK, ToolCall("capture_image", {"device": DESK}), hint=True),
        Camera(LID, ToolCall("capture_image", {"device": LID}), built_in=True),
    )
    assert found[0].to_json() == {
        "device": BENCH,
        "tool": "capture_image",
        "arguments": {"device": BENCH},
        "hub_shared_with": [ARM],
        "built_in": False,
        "hint": False,
    }


@pytest.mark.parametrize(
    ("name", "capability", "effect", "is_camera"),
    [
        ("capture_image", "capture_image", "read", True),
        ("webcam_snapshot", "take_photo", "read", True),
        ("grab_webcam_frame", "grab_webcam_frame", "read", True),
        ("list_camera_formats", "list_camera_formats", "read", False),
        ("capture_image", "capture_image", "actuate", False),
        ("record_video", "record_video", "read", False),
    ],
)
def test_a_camera_is_what_has_a_tool_that_takes_its_picture(
    name: str, capability: str, effect: str, is_camera: bool
) -> None:
    offer = offered({**tool(name, DESK, capability=capability), "effect": effect})
    assert bool(cameras(probed(), IDENTIFIED, offer)) == is_camera


def test_only_annotated_devices_whose_call_is_known_are_cameras() -> None:
    unknown: dict[str, Any] = {"required": ["preset"], "properties": {"preset": {"type": "string"}}}
    given = {**tool("capture_image", DESK, **unknown), "smoke": {"arguments": {"preset": "day", "width": 16}}}
    assert cameras(probed(), IDENTIFIED, offered(given))[0].call.arguments == {"preset": "day"}
    assert cameras(probed(), IDENTIFIED, offered({**given, "smoke": None})) == ()
    assert cameras(probed(), {"devices": []}, offered(tool("capture_image", DESK))) == ()
    assert cameras({}, {}, {}) == ()


def test_the_first_tool_of_a_device_is_its_only_one() -> None:
    found = cameras(probed(), IDENTIFIED, offered(tool("capture_image", DESK), tool("take_photo", DESK)))
    assert [item.call.tool for item in found] == ["capture_image"]


@pytest.mark.parametrize(
    ("change", "built_in"),
    [
        ({}, False),
        ({"raw_descriptor": "product: x\nremovable: fixed"}, True),
        ({"raw_descriptor": "removable: removable"}, False),
        ({"interface": "platform"}, True),
        ({"interface": "pci"}, True),
        ({"interface": "network"}, False),
    ],
)
def test_what_is_built_in(change: dict[str, Any], built_in: bool) -> None:
    probe = probed()
    probe["devices"][1] |= change
    (found,) = cameras(probe, IDENTIFIED, offered(tool("capture_image", DESK)))
    assert found.built_in is built_in


def test_the_ledger_of_this_machine_says_where_a_device_is_plugged_in() -> None:
    ledger = {DESK: {"sysfs": ROOT + "/1-2/1-2.3", "removable": "fixed"}, LID: {"removable": "removable"}}
    found = cameras(probed(), IDENTIFIED, offered(tool("capture_image", DESK, LID)), ledger=ledger)
    assert [(item.hub_shared_with, item.built_in) for item in found] == [((ARM,), True), ((), False)]


def test_named_then_on_a_hub_of_its_own_then_plugged_in_then_by_id() -> None:
    shared, built_in = (
        Camera("a", ToolCall("t", {}), hub_shared_with=("x",)),
        Camera("b", ToolCall("t", {}), built_in=True),
    )
    plugged, named = Camera("c", ToolCall("t", {})), Camera("z", ToolCall("t", {}), ("x",), built_in=True, hint=True)
    assert best([shared, built_in, plugged, named]) == named
    assert best([shared, built_in, plugged, Camera("d", ToolCall("t", {}))]) == plugged
    assert best([shared, built_in]) == built_in
    assert best([Camera("b", ToolCall("t", {}), ("x",), built_in=True), shared]) == shared
    assert best([]) is None
