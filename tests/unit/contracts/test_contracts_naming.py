"""What names give away, and two schemas compared for what they accept."""

from typing import Any

import pytest
from unit.contracts.contract_samples import SCHEMAS, artifacts, good

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.name_clues import is_chip_name, is_passthrough, same_action
from octoform.contracts.rules.interface.parameter_rules import foreign
from octoform.contracts.schema_equivalence import schema_equal

PIPES = [
    "send_serial_command",
    "serial_write",
    "raw_bytes_write",
    "exec",
    "execute_command",
    "run_shell",
    "write_register",
    "i2c_transfer",
    "spi_transceive",
    "usb_control_transfer",
    "serial_read",
    "read_registers",
    "hid_send_report",
    "sendRawCommand",
    "uart-passthrough",
    "pass_through",
    "send_gcode",
    "write_block",
    "run_code",
    "ioctl",
    "send_packet",
]
NO_PIPES = [
    "capture_image",
    "read_temperature",
    "read_serial_number",
    "list_serial_ports",
    "set_brightness",
    "record_audio",
    "read_block_inventory",
    "get_memory_usage",
    "send_ir_code",
    "play_sound",
    "wait_for_event",
    "read_battery_status",
    "write_led_level",
    "capture_raw_frame",
    "set_port_power",
    "read_raw_acceleration",
    "send_magic_packet",
    "send_status_report",
    "transmit_beacon_frame",
    "move_to",
    "list_formats",
]


@pytest.mark.parametrize("name", PIPES)
def test_a_raw_pipe_is_known_by_its_name(name: str) -> None:
    assert is_passthrough(name)


@pytest.mark.parametrize("name", NO_PIPES)
def test_a_typed_capability_is_not_taken_for_a_pipe(name: str) -> None:
    assert not is_passthrough(name)


CHIPS = [
    ("USB-serial adapter", ""),
    ("USB to UART bridge", ""),
    ("AB123X USB to UART Bridge Controller", ""),
    ("Bridgemaker AB232 USB UART", "manufacturer: Bridgemaker"),
    ("Bridgemaker Electronics USB-RS485 converter", ""),
    ("USB Serial Port (bridge of the Bridgemaker)", ""),
    ("Bridgemaker USB serial", "ID_VENDOR_FROM_DATABASE: Bridgemaker"),
]
PRODUCTS = [
    ("Acme Widget 3000", ""),
    ("Acme Widget USB serial", "manufacturer: Acme"),
    ("Label printer behind a USB-serial adapter", ""),
    ("USB Audio Device", ""),
    ("USB Camera", ""),
    ("I2C temperature sensor", ""),
    ("Servo arm with a serial bus", ""),
    ("Acme Lightbar serial LED controller", ""),
]


@pytest.mark.parametrize(("name", "text"), CHIPS)
def test_a_bridge_is_no_product(name: str, text: str) -> None:
    assert is_chip_name(name, text)


@pytest.mark.parametrize(("name", "text"), PRODUCTS)
def test_a_product_is_not_taken_for_a_bridge(name: str, text: str) -> None:
    assert not is_chip_name(name, text)


def test_synonyms_name_one_action() -> None:
    assert same_action("take_photo") == same_action("capture_image") == same_action("grabFrame")
    assert same_action("read_temp") == same_action("get_temperature")
    assert same_action("read_temperature") != same_action("set_temperature")


BASE: dict[str, Any] = {
    "type": "object",
    "properties": {
        "device": {"type": "string", "enum": ["b", "a"], "description": "which"},
        "level": {"type": "number", "minimum": 0, "maximum": 10.0, "default": 1.0},
        "count": {"type": "integer"},
        "title": {"type": "string"},
        "mode": {"enum": ["only"]},
    },
    "required": ["title", "device"],
}
SAME: list[dict[str, Any]] = [
    {**BASE, "title": "Tool", "additionalProperties": False, "$schema": "x", "required": ["device", "title"]},
    {
        "type": "object",
        "$defs": {"D": {"type": "string", "enum": ["a", "b"], "title": "D"}},
        "properties": {
            "device": {"$ref": "#/$defs/D"},
            "level": {"type": "number", "minimum": 0.0, "maximum": 10, "default": 1, "title": "Level"},
            "count": {"anyOf": [{"type": "integer"}, {"type": "null"}], "default": None, "title": "Count"},
            "title": {"type": "string", "title": "Title"},
            "mode": {"const": "only", "type": "string"},
        },
        "required": ["device", "title"],
    },
    {**BASE, "properties": {**BASE["properties"], "count": {"type": ["integer", "null"], "default": None}}},
]
OTHER: list[tuple[str, dict[str, Any]]] = [
    ("maximum", {**BASE["properties"], "level": {"type": "number", "minimum": 0, "maximum": 11, "default": 1}}),
    ("default", {**BASE["properties"], "level": {"type": "number", "minimum": 0, "maximum": 10, "default": 2}}),
    ("count", {**BASE["properties"], "count": {"type": "number"}}),
    ("count", {**BASE["properties"], "count": {"anyOf": [{"type": "integer"}, {"type": "null"}]}}),
    ("device", {**BASE["properties"], "device": {"type": "string", "enum": ["a"]}}),
    ("title", {name: item for name, item in BASE["properties"].items() if name != "title"}),
    ("extra", {**BASE["properties"], "extra": {"type": "boolean"}}),
]


@pytest.mark.parametrize("other", SAME, ids=range(len(SAME)))
def test_schemas_that_accept_the_same_are_equal(other: dict[str, Any]) -> None:
    assert schema_equal(BASE, other) == []
    assert schema_equal(other, BASE) == []


@pytest.mark.parametrize(("where", "properties"), OTHER)
def test_schemas_that_do_not_are_told_apart(where: str, properties: dict[str, Any]) -> None:
    assert any(where in line for line in schema_equal(BASE, {**BASE, "properties": properties}))


def test_openness_and_truth_values_count() -> None:
    assert schema_equal(BASE, {**BASE, "additionalProperties": True})
    one, true = {"type": "object", "minProperties": 1}, {"type": "object", "minProperties": True}
    assert schema_equal(one, true)


def test_a_schema_without_end_is_compared() -> None:
    endless: dict[str, Any] = {"type": "object", "properties": {"a": {"$ref": "#"}}}
    assert schema_equal(endless, endless) == []
    forked: dict[str, Any] = {"type": "object", "properties": {"a": {"$ref": "#"}, "b": {"$ref": "#"}}}
    assert schema_equal(forked, forked) == []
    assert schema_equal({"$ref": "#"}, {"$ref": "#"}) == []


def named(product: str, parameter: str) -> set[str]:
    """The codes of an interface whose tool of a camera takes this parameter, where the camera calls itself so."""
    value, probe = good("interface"), good("probe")
    probe["devices"][0]["raw_descriptor"] = f"manufacturer: Acme\nproduct: {product}\ndriver: uvcvideo"
    tool = next(each for each in value["tools"] if each["devices"] == ["usb-1234-0001"])
    tool["input_schema"].setdefault("properties", {})[parameter] = {"type": "integer", "minimum": 0, "maximum": 9}
    return {item.code for item in check("interface", value, artifacts(probe=probe), SCHEMAS)}


@pytest.mark.parametrize(
    ("product", "parameter"),
    [("DeskCam Studio", "deskcam_gain"), ("Acme H20x", "h20x_gain"), ("Acme HOMER camera", "homer_gain")],
)
def test_one_word_that_was_made_for_a_product_names_no_parameter(product: str, parameter: str) -> None:
    assert "INTERFACE-NAME-PRODUCT" in named(product, parameter)


@pytest.mark.parametrize(
    ("product", "parameter"),
    [
        ("Desk Studio", "studio_gain"),
        ("ACME DESK CAMERA", "desk_gain"),
        ("Acme H20x", "gain"),
        ("DeskCam Studio", "width"),
        ("Stream Camera", "stream_index"),
    ],
)
def test_a_plain_word_of_a_product_may_name_a_parameter(product: str, parameter: str) -> None:
    assert "INTERFACE-NAME-PRODUCT" not in named(product, parameter)


@pytest.mark.parametrize(
    ("listed", "names", "own", "foreign_to_it"),
    [
        ("channels", ["left", "right"], [], False),
        ("channels", ["1", "2"], [], False),
        ("channels", ["Front", "rear"], [], False),
        ("leds", ["red", "blue"], [], False),
        ("formats", ["MJPG", "YUYV"], [], False),
        ("modes", ["portrait", "macro"], [], False),
        ("channels", ["woofer", "tweeter"], [], True),
        ("channels", ["woofer", "tweeter"], ["Woofer"], False),
    ],
)
def test_what_any_device_may_have_is_no_other_devices(
    listed: str, names: list[str], own: list[str], foreign_to_it: bool
) -> None:
    rows = {listed: [{"name": name} for name in names]}
    ability = {"name": "set_volume", "description": "Set the volume.", "parameters": rows}
    taking = {"name": "capture_image", "description": "Take a picture.", "parameters": {"names": own}}
    of_ids = {"usb-sound": [ability], "usb-camera": [taking]}
    devices = [{"id": each, "identified_as": "a device", "capabilities": has} for each, has in of_ids.items()]
    taken = {"type": "object", "properties": {"eye": {"type": "string", "enum": names}}}
    tool = {"name": "capture_image", "description": "Take a picture.", "capability": "capture_image"}
    tools = [{**tool, "devices": ["usb-camera"], "effect": "read", "input_schema": taken}]
    assert bool(foreign({"tools": tools}, Artifacts(identify={"devices": devices}))) is foreign_to_it
