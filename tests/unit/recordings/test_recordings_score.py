"""What counts as named, misidentified and rightly unknown, on invented items."""

from typing import Any

import pytest
from recordings import score
from recordings.onboarding import is_whole_host
from recordings.truth import Item, Units

UNIT = {
    "id": "usb-f00d-0001",
    "name": "Invented Works Sample Eye 300",
    "interface": "usb",
    "raw_descriptor": "bus: usb",
    "vid": "f00d",
    "pid": "0001",
    "classes": ["video4linux"],
    "instance": {"sysfs": "/sys/devices/x/1-2", "port": "1-2", "paths": [], "nodes": []},
}
TOOLS = [{"capability": "capture_image", "devices": [UNIT["id"]]}]


def item(**changes: Any) -> Item:
    values: dict[str, Any] = {
        "recording": "dev-sample",
        "match": "usb f00d:0001",
        "product": "Invented Works Sample Eye 300",
        "category": "sensor",
        "also_ok": (),
        "kind": "camera",
        "capabilities": ("capture_image",),
        "must_not_be": (),
        "identified_by": "strings",
        "by_hand": True,
    }
    return Item(**(values | changes))


def answer(name: str, category: str = "sensor", confidence: float = 0.9) -> dict[str, Any]:
    return {"identified_as": name, "category": category, "confidence": confidence, "capabilities": []}


def result(of: Item, given: dict[str, Any] | None) -> str:
    return score.mark(of, UNIT, given, TOOLS).result


def test_the_model_word_and_a_fitting_category_make_it_named() -> None:
    assert result(item(), answer("Sample Eye 300 camera")) == score.NAMED
    assert result(item(), answer("Sample Eye 300 camera", "infrastructure")) == score.MISSED
    assert result(item(also_ok=("infrastructure",)), answer("Sample Eye 300", "infrastructure")) == score.NAMED


def test_another_product_is_a_misidentification_if_it_is_said_with_confidence() -> None:
    assert result(item(), answer("Contoso Zoomer")) == score.MISIDENTIFIED
    assert result(item(), answer("Contoso Zoomer", confidence=0.3)) == score.MISSED


def test_a_word_that_must_not_be_is_a_misidentification_at_any_confidence() -> None:
    of = item(must_not_be=("robot arm",))
    assert result(of, answer("Sample Eye 300 robot arm", confidence=0.1)) == score.MISIDENTIFIED
    moving = answer("Sample Eye 300") | {"capabilities": [{"name": "move_robot_arm"}]}
    assert result(of, moving) == score.MISIDENTIFIED


@pytest.mark.parametrize("basis", ["context", "none"])
def test_where_the_recording_does_not_tell_only_unknown_is_right(basis: str) -> None:
    of = item(identified_by=basis)
    assert result(of, answer("unknown device", "unknown", 0.0)) == score.UNKNOWN_RIGHT
    assert result(of, answer("Sample Eye 300", confidence=0.4)) == score.UNKNOWN_RIGHT
    assert result(of, answer("Sample Eye 300", confidence=0.9)) == score.MISIDENTIFIED


def test_unknown_is_no_name_where_the_recording_tells() -> None:
    assert result(item(), answer("unknown device", "unknown", 0.0)) == score.MISSED


def test_what_was_not_annotated_is_left_out_and_what_probe_lacks_is_not_seen() -> None:
    assert result(item(), None) == score.LEFT_OUT
    assert score.mark(item(), None, None, TOOLS).result == score.NOT_SEEN


def test_usable_asks_for_a_tool_that_serves_the_device() -> None:
    given = answer("Sample Eye 300")
    assert score.mark(item(), UNIT, given, TOOLS).usable is True
    assert score.mark(item(capabilities=("take_photo",)), UNIT, given, TOOLS).usable is True
    assert score.mark(item(), UNIT, given, [{"capability": "capture_image", "devices": ["other"]}]).usable is False
    assert score.mark(item(category="infrastructure"), UNIT, given, TOOLS).usable is None


def test_usable_does_not_ask_for_what_the_recording_has_no_interface_for() -> None:
    bare = UNIT | {"classes": []}
    assert score.mark(item(), bare, answer("Sample Eye 300"), []).usable is None
    assert score.mark(item(), None, None, []).usable is False


def test_items_find_their_unit_by_ids_and_port_and_path() -> None:
    second = UNIT | {"id": "usb-f00d-0001-2", "instance": {"sysfs": "/sys/devices/x/1-4", "port": "1-4"}}
    probe = {"devices": [UNIT, second]}
    by_port = Units(probe).find(item(match="usb f00d:0001 at 1-4"))
    by_path = Units(probe).find(item(match="sysfs /devices/x/1-4/1-4:1.0"))
    assert by_port is not None and by_path is not None
    assert (by_port["id"], by_path["id"]) == ("usb-f00d-0001-2", "usb-f00d-0001-2")
    units = Units(probe)
    found = [units.find(item()), units.find(item())]
    assert [unit["id"] for unit in found if unit] == ["usb-f00d-0001", "usb-f00d-0001-2"]
    assert Units(probe).find(item(match="usb 0bad:0001")) is None


def test_a_name_by_id_tells_which_of_two_equal_devices_is_meant() -> None:
    text = "bus: usb\ntty[0].udev.ID_SERIAL.name: Heron_Stick"
    probe = {"devices": [UNIT, UNIT | {"id": "usb-f00d-0001-2", "raw_descriptor": text}]}
    by_id = item(match="serial port usb-Heron_Stick_0042-if00 (usb f00d:0001)")
    assert (Units(probe).find(by_id) or {})["id"] == "usb-f00d-0001-2"


def test_a_whole_host_is_told_by_the_entry_s_name() -> None:
    assert [is_whole_host(name) for name in ("host-sample", "laptop-x", "dev-sample", "iio-x")] == [
        True,
        True,
        False,
        False,
    ]
