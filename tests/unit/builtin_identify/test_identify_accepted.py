"""Whatever the strings of a device, the contracts accept what the embedded agent writes of it."""

import json
from pathlib import Path
from typing import Any

import pytest
from cases import for_each
from hypothesis import example, given
from hypothesis import strategies as st
from unit.builtin_identify.probes import NO_DATABASES, device, probe, usb

from octoform.base.id_databases import IdDatabases
from octoform.builtin.classes.words import TABLES
from octoform.builtin.identify import identify, names_wires, without_refused
from octoform.builtin.interface import declare
from octoform.builtin.probe import kernel_text
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.name_clues import is_chip_name

SCHEMAS = Path(__file__).resolve().parents[3] / "protocol/schemas"
WORD = st.one_of(
    st.sampled_from(
        [
            "USB",
            "to",
            "Serial",
            "UART",
            "Bridge",
            "I2C",
            "SPI",
            "JTAG",
            "RS232",
            "rs 485",
            "TTL",
            "VCP",
            "SMBus",
            "Adapter",
        ]
    ),
    st.sampled_from(
        ["Controller", "Cable", "Converter", "Chip", "Dongle", "Single", "Dual", "FT232R", "CP2102N", "ab3412"]
    ),
    st.sampled_from(
        ["Camera", "Gamepad", "Keyboard", "Lamp", "Printer", "Multimeter", "GPIO", "Mouse", "Audio", "Hub"]
    ),
    st.sampled_from(
        ["Otter", "Inc.", "Technologies", "Co., Ltd", "HD 3000", "X2", "ÖTTER", "Камера", "照相机", "カメラ", "كاميرا"]
    ),
    st.sampled_from(["with", "via", "(", ")", ":", ",", "-", "_", "​", "‮", "é", "ㅤ", "⠀", "﻿", "\\x1b", "🦑", "…"]),
    st.text(max_size=12),
)
SAID = st.builds(
    lambda words, joint: joint.join(words), st.lists(WORD, max_size=7), st.sampled_from([" ", "", "_", "-"])
)
SHAPES: dict[str, dict[str, Any]] = {
    "bare": {},
    "camera": {"nodes": [("video4linux", "video0")], "lines": ["interface 00: class 0e/01/00 driver=uvcvideo"]},
    "serial": {"nodes": [("tty", "ttyUSB0")], "lines": ["interface 00: class ff/00/00 driver=ftdi_sio"]},
    "keys": {
        "nodes": [("input", "input4"), ("input", "event3")],
        "lines": ["input[0].name: keys", "input[0].events: key", "input[0].kinds: keyboard"],
    },
    "gpio": {"nodes": [("gpio", "gpiochip1")], "lines": ["gpio[0].label: lines", "gpio[0].ngpio: 4"]},
    "sound": {"nodes": [("sound", "card1")], "lines": ["interface 00: class 01/01/00 driver=snd-usb-audio"]},
    "printer": {"nodes": [("usbmisc", "lp0")], "lines": ["interface 00: class 07/01/02 driver=usblp"]},
    "disk": {"nodes": [("block", "sdb")], "lines": ["interface 00: class 08/06/50 driver=usb-storage"]},
    "net": {"nodes": [("net", "eth1")], "lines": ["interface 00: class 02/06/00 driver=cdc_ether"]},
    "sensor": {"nodes": [("hwmon", "hwmon3")], "lines": ["hwmon[0].name: chip", "hwmon[0].temp1: input"]},
    "vision": {"lines": ["interface 00: class ef/05/00"]},
    "vendor": {"lines": ["interface 00: class ff/00/00"]},
    "light": {"nodes": [("leds", "led0")], "lines": ["leds[0].name: led", "leds[0].max_brightness: 255"]},
}


def refused(entry: dict[str, Any]) -> list[str]:
    """What the contracts of IDENTIFY and INTERFACE say against the agent's answer about one device."""
    probed = probe(entry)
    found = identify(probed, NO_DATABASES)
    result = check("identify", found, Artifacts(probe=probed), SCHEMAS)
    tools = declare(found, 100)
    result += check("interface", tools, Artifacts(probe=probed, identify=found), SCHEMAS)
    return [f"{one.code}: {one.summary} {json.dumps(found)}" for one in result if one.severity.value == "error"]


@pytest.mark.parametrize("shape", SHAPES)
@given(SAID, SAID, st.sampled_from(["usb", "i2c", "platform"]))
@example("USB to Serial", "", "usb")
@example("Otter USB to Serial", "Otter", "usb")
@example("USB-Serial Controller", "Otter Inc.", "usb")
@example("I2C CP2102N", "A0", "usb")
@example("I2C JTAG", "USB with", "usb")
@example("I2C with X2", "USB with", "usb")
@example("with CardSwipe", "USB Serial", "usb")
@example("Lamp", "", "usb")
@example("Docking Station", "", "usb")
@example("USBPrinter", "", "usb")
@example("Serial \x1f", "", "usb")
@example("( \x1f Serial", "USBUSB", "usb")
def test_no_string_of_a_device_ends_in_a_refusal(shape: str, product: str, maker: str, bus: str) -> None:
    form = SHAPES[shape]
    lines = [
        f"{key}: {kernel_text.value(text)}"
        for key, text in (("manufacturer", maker), ("product", product))
        if text.strip()
    ]
    lines += form.get("lines", [])
    if bus == "usb":
        entry = usb(*lines, nodes=form.get("nodes", ()))
    else:
        lines.append(f"name: {kernel_text.value(product) or 'part'}")
        entry = device(f"{bus}-part", bus, f"bus: {bus}", *lines, nodes=form.get("nodes", ()))
    assert refused(entry) == []


@pytest.mark.parametrize("shape", ["bare", "vendor", "vision"])
@for_each("product", ["", "Kamera", "Otter Drucker", "USB Kopfhörer", "робот", "Тепловая камера", "电机", "Waage 3"])
def test_a_kind_of_thing_in_another_language_is_accepted(shape: str, product: str) -> None:
    """No class of the kernel bears it out: what the quote means does, and USB3 Vision is a camera's class."""
    lines = [f"product: {kernel_text.value(product)}"] if product else []
    assert refused(usb(*lines, *SHAPES[shape].get("lines", []))) == []


PHRASES = sorted({phrase for table in TABLES for phrases, *_ in table for phrase in phrases})
WHERE: dict[str, tuple[list[str], str]] = {
    "in its product string": (["product: Otter {}"], ""),
    "in an interface's label": (["product: USB Serial", "label={}"], ""),
    "in an interface's label alone": (["product: USB Device", "label={}"], ""),
    "in its registered name": ([], "X200 {}"),
    "in its registered name alone": (["product: Generic USB Device"], "X200 {}"),
}
PIPES: dict[str, tuple[str, list[tuple[str, str]]]] = {
    "HID": ("03/00/00 driver=usbhid", [("hidraw", "hidraw0"), ("hid", "0003")]),
    "none": ("ff/00/00", []),
    "line": ("02/02/01 driver=cdc_acm", [("tty", "ttyACM0")]),
}


@for_each("pipe", PIPES, parts=3)
@for_each(("at", "where"), enumerate(WHERE))
def test_each_word_of_class_is_accepted_of_a_raw_line(at: int, where: str, pipe: str) -> None:
    """Class and name follow from the word, wherever it is, and from nothing that the kernel shows."""
    (lines, registered), (interface, nodes) = WHERE[where], PIPES[pipe]
    entries, names = [], {}
    for number, phrase in enumerate(PHRASES[at :: len(WHERE)]):
        said = [line.format(phrase) for line in lines]
        label = "".join(f" {line}" for line in said if line.startswith("label="))
        strings = [line for line in said if line.startswith("product: ")]
        entries.append(usb(*strings, f"interface 00: class {interface}{label}", pid=f"{number:04x}", nodes=nodes))
        names[f"{number:04x}"] = registered.format(phrase)
    assert refused_of(entries, names) == []


def refused_of(entries: list[dict[str, Any]], names: dict[str, str]) -> list[str]:
    """What IDENTIFY's contract reports of the devices of a host whose id database has the names, by product number."""
    probed = probe(*entries)
    known = {each["id"]: f"Otter {names[each['pid']]}" for each in entries if names[each["pid"]]}
    artifacts = Artifacts(probe=probed, registered=known)
    found = check("identify", identify(probed, Registered(names)), artifacts, SCHEMAS)
    return [f"{one.code}: {one.summary}" for one in found]


class Registered(IdDatabases):
    """An id database with the names of some products of one maker."""

    def __init__(self, names: dict[str, str]) -> None:
        """``names`` by the number of the product, "" where it has none."""
        super().__init__(Path("/nonexistent"))
        self.names = names

    def lookup(self, bus: str, vendor: str, product: str) -> tuple[str, str]:
        """The maker and the name; nothing for another bus."""
        name = self.names.get(product, "") if bus == "usb" else ""
        return ("Otter" if name else "", name)


@pytest.mark.parametrize(
    "strings", [(), ("product: Generic USB Device",), ("manufacturer: Generic", "product: USB Device")]
)
@for_each(
    ("kind", "lines"),
    (
        ("sensor", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: 008c/0001"]),
        ("sensor", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: 008d/0001"]),
        ("sensor", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: ff00/0001,000d/0004"]),
        ("sensor", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: 0001/0005"]),
        ("actuator", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: 0059/0001"]),
        ("bidirectional", ["interface 00: class ff/00/00", "udev.ID_SOFTWARE_RADIO: 1"]),
        ("bidirectional", ["interface 00: class dc/01/01"]),
        ("sensor", ["interface 00: class 03/01/02 driver=usbhid"]),
        # A driver's name and an arrangement of a vendor's own interfaces state nothing.
        ("unknown", ["interface 00: class 03/00/00 driver=hid-bench"]),
        ("unknown", ["interface 00: class 03/00/00 driver=usbhid", "hid[0].usages: ff00/0001"]),
        ("unknown", ["interface 00: class ff/5d/01 driver=xpad"]),
        ("unknown", [f"interface 0{at}: class ff/{at:02}/00" for at in (1, 2, 3)]),
        ("unknown", ["interface 00: class ff/00/00", "udev.ID_MM_CANDIDATE: 1"]),
    ),
)
def test_a_device_without_a_word_is_what_a_standard_states(
    kind: str, lines: list[str], strings: tuple[str, ...]
) -> None:
    """A usage of HID, a rule of the system or a class of USB is a statement; without any it is unknown."""
    drivers = [line.split("driver=")[1] for line in lines if "driver=" in line]
    entry = usb(*strings, *lines, drivers=drivers, classes=["hidraw"] if drivers else [])
    (found,) = identify(probe(entry), NO_DATABASES)["devices"]
    assert found["category"] == kind and refused(entry) == []


@given(SAID, SAID)
def test_the_agents_rule_and_the_contracts_agree(name: str, maker: str) -> None:
    raw = f"manufacturer: {kernel_text.value(maker)}"
    assert names_wires(name, raw) == is_chip_name(name, raw)


def test_a_device_with_a_name_of_wires_is_called_by_its_class_or_is_unknown() -> None:
    (keys,) = identify(probe(shaped("keys")), NO_DATABASES)["devices"]
    assert keys["category"] == "sensor" and "serial" not in keys["identified_as"].casefold()
    (line,) = identify(probe(shaped("serial")), NO_DATABASES)["devices"]
    assert (line["category"], line["capabilities"]) == ("unknown", []) and line["missing"]


def shaped(shape: str) -> dict[str, Any]:
    """A USB device of a shape that calls itself by its wires."""
    form = SHAPES[shape]
    return usb("product: USB to Serial", *form["lines"], nodes=form["nodes"])


def test_what_was_refused_is_unknown_the_next_time_and_left_out_the_time_after() -> None:
    artifact = identify(probe(shaped("keys")), NO_DATABASES)
    (entry,) = artifact["devices"]
    again = without_refused(artifact, [entry])
    (unknown,) = again["devices"]
    assert (unknown["category"], unknown["capabilities"]) == ("unknown", []) and unknown["missing"]
    last = without_refused(artifact, [unknown])
    assert last["devices"] == [] and last["left_out"][-1]["reason"] == "unknown_meaning"
