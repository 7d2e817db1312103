"""What the embedded agent makes of devices that no recording shows: by principle, and never a guess that is sure."""

from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree
from unit.builtin_identify.probes import answer, capabilities, device, usb

from octoform.builtin.description import glossary
from octoform.builtin.probe import probe_root


@pytest.mark.parametrize(
    ("said", "english"),
    [
        ("热敏打印机 X2", "thermal printer"),
        ("機械鍵盤", "mechanical keyboard"),
        ("Весы электронные", "electronic scale"),
        ("オシロスコープ", "oscilloscope"),
        ("Θερμόμετρο", "thermometer"),
        ("바코드 리더", "barcode scanner"),
        ("Druckerei", "printer"),
        ("Balance Board", ""),
        ("USB Serial", ""),
    ],
)
def test_general_words_of_other_languages_are_read(said: str, english: str) -> None:
    assert glossary.english(said) == english


def test_a_name_in_another_language_is_given_with_what_it_says() -> None:
    found = answer(usb("manufacturer: 佳博", "product: 热敏打印机", "interface 00: class ff/00/00"))
    assert (found["category"], found["class"]) == ("actuator", "printer")
    assert found["identified_as"] == "佳博 热敏打印机 (thermal printer)" and found["confidence"] < 0.5


@pytest.mark.parametrize(
    ("lines", "nodes", "category", "kind"),
    [
        (["bus: platform", "watchdog[0].identity: Demo"], [("watchdog", "watchdog0")], "infrastructure", "watchdog"),
        (["bus: i2c", "name: 24c99", "driver: at24"], [], "infrastructure", "memory"),
        (["bus: i2c", "name: nfc9"], [("nfc", "nfc0")], "bidirectional", "nfc"),
        (["bus: platform", "name: cec"], [("cec", "cec0")], "bidirectional", "cec"),
        (
            ["bus: usb", "interface 00: class ff/ff/ff driver=dvb_usb_rtl28xxu"],
            [("dvb", "dvb0.frontend0")],
            "sensor",
            "tv_receiver",
        ),
        (["bus: i2c", "name: pca9", "pwm[0].npwm: 16"], [("pwm", "pwmchip0")], "actuator", "pwm"),
        (["bus: pci", "class_code: 0x120000"], [], "infrastructure", "accelerator"),
        (["bus: pci", "class_code: 0x040000"], [], "sensor", "capture"),
        (["bus: typec"], [], "infrastructure", "typec"),
        (["bus: w1", "family: 28"], [], "sensor", "temperature"),
        (["bus: firewire", "vendor_name: Heron", "model_name: Heron DV Camera"], [], "sensor", "camera"),
        (["bus: i2c", "name: dw9714"], [("video4linux", "v4l-subdev0")], "actuator", "lens"),
        (["bus: i2c", "name: adv7180"], [("video4linux", "v4l-subdev0")], "sensor", "capture"),
    ],
)
def test_what_the_kernel_a_code_or_a_family_tells_is_named(
    lines: list[str], nodes: list[tuple[str, str]], category: str, kind: str
) -> None:
    bus = lines[0].partition(": ")[2]
    driver = [line.partition(": ")[2] for line in lines if line.startswith("driver: ")]
    found = answer(device(f"{bus}-demo", bus, *lines, nodes=nodes, drivers=driver))
    assert (found["category"], found["class"]) == (category, kind)


def test_a_part_of_the_board_with_several_functions_is_called_by_each() -> None:
    lines = (
        'input[0].name: "Demo Extra Buttons"',
        "input[0].kinds: buttons",
        "leds[0].name: demo::kbd_backlight",
        "hwmon[0].name: demofw",
        "hwmon[0].fan1: input",
    )
    nodes = [("input", "input1"), ("leds", "demo::kbd_backlight"), ("hwmon", "hwmon1")]
    found = answer(device("platform-demo", "platform", "bus: platform", *lines, nodes=nodes))
    assert found["category"] == "bidirectional"
    assert all(word in found["identified_as"] for word in ("Demo Extra Buttons", "demofw", "kbd backlight"))
    assert {"set_led", "read_fan_speed", "describe_input"} <= set(capabilities(found))


def test_a_disk_that_calls_itself_another_thing_is_a_disk() -> None:
    found = answer(usb("manufacturer: Tern", "product: Webcam Pro", "interface 00: class 08/06/50"))
    assert (found["identified_as"], found["class"]) == ("Tern storage device", "storage")


@pytest.mark.parametrize("product", ["I2C Thermometer Bridge", "USB to Thermometer"])
def test_what_can_be_wired_to_a_bridge_is_not_what_it_is(product: str) -> None:
    found = answer(usb(f"product: {product}", "interface 00: class ff/00/00", nodes=[("tty", "ttyUSB0")]))
    assert found["category"] == "unknown"


def _nodes(root: Path, place: str, *nodes: tuple[str, dict[str, str]]) -> list[dict[str, Any]]:
    tree = Tree(root)
    for name, given in nodes:
        tree.member(f"{place}/video4linux/{name}", "video4linux", given, DEVNAME=name)
    devices: Any = probe_root(root)["devices"]
    return [each for each in devices if "video4linux" in each.get("classes", ())]


def test_the_node_for_metadata_is_an_entry_of_its_own_and_no_second_camera(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    tree.usb("pci0/usb1/1-1", "1f00", "00c1")
    tree.bus("pci0/usb1/1-1/1-1:1.0", "usb", DRIVER="uvcvideo")
    both = [(f"video{index}", {"name": "Demo: Demo", "index": str(index)}) for index in (0, 1)]
    shown = _nodes(tmp_path, "pci0/usb1/1-1/1-1:1.0", *both)
    assert [[node["name"] for node in each["instance"]["nodes"]] for each in shown] == [["video0"], ["video1"]]
    camera, data = (answer(each) for each in shown)
    assert (camera["class"], data["class"], data["category"]) == ("camera", "video_data", "infrastructure")
    assert data["confidence"] < 0.5 and "port" not in shown[1]["instance"]


def test_an_image_processor_is_one_unit_without_its_statistics(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    tree.bus("platform/isp0", "platform", DRIVER="demoisp")
    names = ("demo_main", "demo_self", "demo_stats", "demo_params")
    shown = _nodes(tmp_path, "platform/isp0", *((f"video{at}", {"name": name}) for at, name in enumerate(names)))
    assert sorted(len(each["instance"]["nodes"]) for each in shown) == [1, 1, 2]


def test_a_panel_on_a_bus_for_chips_is_not_called_by_its_address(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    tree.bus("i2c0/i2c-1/1-0045", "i2c", {"name": "panel9"})
    tree.member("i2c0/i2c-1/1-0045/backlight/1-0045", "backlight", {"max_brightness": "255"})
    ids = {each["id"] for each in probe_root(tmp_path)["devices"]}
    assert "backlight-device" in ids and not any("0045" in each for each in ids)


def test_a_serial_number_that_repeats_the_kind_is_none(tmp_path: Path) -> None:
    Tree(tmp_path).usb("pci0/usb1/1-1", "1f00", "00c1", "1F0000C1")
    [found] = probe_root(tmp_path)["devices"]
    assert "serial" not in found["instance"] and found["instance"]["strength"] == "positional"
