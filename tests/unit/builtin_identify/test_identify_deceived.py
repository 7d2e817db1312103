"""Devices that would lead a reader astray: lent strings, cloned numbers, states, chips, words of another kind.

All makers and products are invented; each row is a way in which real strings mislead. What is asked: the right kind or
`unknown`, and no name with more than even confidence unless the device's own words and numbers bear it out.
"""

from typing import Any

import pytest
from unit.builtin_identify.probes import NO_DATABASES, answer, device, usb

from octoform.base.id_databases import IdDatabases

ACM = ("interface 00: class 02/02/01 driver=cdc_acm", "interface 01: class 0a/00/00 driver=cdc_acm")
AUDIO = ("interface 00: class 01/01/00 driver=snd-usb-audio",)
CAMERA = ("interface 00: class 0e/01/00 driver=uvcvideo",)
DISK = ("interface 00: class 08/06/50 driver=usb-storage",)
HID = ("interface 00: class 03/00/00 driver=usbhid",)
KEYS = ("interface 00: class 03/01/01 driver=usbhid",)
OWN = ("interface 00: class ff/00/00",)
PAD = ("interface 00: class ff/5d/01 driver=xpad", "input[0].name: Kestrel Pad 360", "input[0].kinds: gamepad")
UPS = (*HID, "hid[0].usages: 0084/0004")
TTY = {"nodes": [("tty", "ttyACM0")]}
IDS = """1d9c  Finch Instruments
	0001  Warbler 9 Bluetooth Receiver
	0002  Warbler 4 Sound Adapter
	0003  Warbler 100 Keyboard
	0004  Plover Logic
	0005  Warbler 7 Hub
	000a  Warbler Ethernet Adapter
	000b  Warbler Receipt Printer
	000c  USB Serial Port
	000d  FX2104 UART Bridge
"""
PCI_IDS = """1d9c  Finch Instruments
	0001  Warbler Ethernet Adapter
	0002  Warbler Label Printer
	0003  Warbler DVB Tuner
"""


@pytest.fixture(scope="module")
def databases(tmp_path_factory: pytest.TempPathFactory) -> IdDatabases:
    root = tmp_path_factory.mktemp("ids")
    (root / "usr/share/misc").mkdir(parents=True)
    (root / "usr/share/misc/usb.ids").write_text(IDS, encoding="utf-8")
    (root / "usr/share/misc/pci.ids").write_text(PCI_IDS, encoding="utf-8")
    return IdDatabases(root)


def told(maker: str, product: str, *lines: str, **more: Any) -> dict[str, Any]:
    strings = [f"{key}: {text}" for key, text in (("manufacturer", maker), ("product", product)) if text]
    databases = more.pop("databases", NO_DATABASES)
    drivers = sorted({line.split("driver=")[1] for line in lines if "driver=" in line})
    return answer(usb(*strings, *lines, drivers=drivers, **more), databases)


@pytest.mark.parametrize(
    ("maker", "product", "lines", "kind"),
    [
        ("Generic", "AB9X USB Audio", AUDIO, "audio"),  # a chip's own string, the maker a placeholder
        ("Finch Semiconductor", "FX7601 HiFi", AUDIO, "audio"),  # who makes chips sells to others
        ("Dove from Finch Semiconductor", "USB AUDIO  DAC", AUDIO, "audio"),
        ("FinchMicro", "Finch USB Audio", AUDIO, "audio"),  # a brand, and no model
        ("Reed", "USB2.0 PC CAMERA", CAMERA, "camera"),
        ("HD Camera Manufacturer", "USB 2.0 Camera", CAMERA, "camera"),
        ("Reed", "USB2.0 Cameraÿÿ\\x01\\uffff", CAMERA, "camera"),  # an end that was never written
        ("深圳市", "移动存储设备", DISK, "storage"),
        ("VendorCo", "ProductCode", DISK, "storage"),
        ("Raven Pie", "RX2 Boot", DISK, "storage"),  # waits for its firmware, as a disk
        ("Finch", "STX32  BOOTLOADER", ("interface 00: class fe/01/02",), "mcu"),
        ("Tern", "Controller (TERN 360 For Windows)", PAD, "gamepad"),
        ("", "Controller", PAD, "gamepad"),  # the name stands in the driver's table, not in the device
        ("TERN CORP.", "KESTREL(R)3 Controller", HID, "input"),
        ("Logic9", "Logic9 Gamepad", HID, "input"),  # a maker's name that is also an instrument's word
        ("Vole", "Mechanical RGB Keyboard", KEYS, "keyboard"),
        ("Vole", "2.4GHz Transceiver v8.0", KEYS, "keyboard"),
        ("ABC FOR UPS", "ABC FOR UPS", UPS, "ups"),
        ("Reed", "Reed Power 700", UPS, "ups"),  # sold under many names with the same strings
        ("Finch", "Probe 9 (03.00) Embed with CMSIS-DAP", (*ACM, *DISK), "debugger"),  # it does not name the board
        ("Kestrel", "Kestrel_Android", ("interface 00: class 06/01/01",), "phone"),
        ("Tern", "BC USB to ATA/ATAPI Bridge", DISK, "storage"),
    ],
)
def test_the_kind_is_right_and_no_model_is_claimed(maker: str, product: str, lines: tuple[str, ...], kind: str) -> None:
    found = told(maker, product, *lines)
    assert found["class"] == kind
    assert found["confidence"] < 0.5


@pytest.mark.parametrize(
    ("maker", "product", "lines"),
    [
        ("Finch", "Finch Device", ACM),  # a brand behind a wire
        ("SmallPython", "Board in FS mode", ACM),
        ("Dove", "Preloader", ACM),
        ("Linnet Foundation", "Multifunction Composite Gadget", ACM),
        ("Finch", "USB JTAG/serial debug unit", ACM),
        ("Finch", "FX232H", ("interface 00: class ff/ff/ff driver=finch_sio",)),
        ("Finch", "FX245 USB FIFO", ("interface 00: class ff/ff/ff driver=finch_sio",)),
        (
            "Finch",
            "FX2104 Friend",
            ("interface 00: class ff/00/00 driver=fx210x",),
        ),  # the driver is named after the chip
        ("Finch", "FX2303HXA PHASED OUT", ("interface 00: class ff/00/00 driver=fx2303",)),
    ],
)
def test_a_wire_whose_other_end_is_not_told_is_unknown(maker: str, product: str, lines: tuple[str, ...]) -> None:
    found = told(maker, product, *lines, **TTY)
    assert (found["category"], found["confidence"], found["capabilities"]) == ("unknown", 0.0, [])


def test_a_word_on_one_interface_does_not_name_the_whole() -> None:
    found = told("Wren", "Wren 7 Headset", *AUDIO, "interface 03: class 03/01/01 driver=usbhid label=Keyboard")
    assert (found["class"], "keyboard" in found["identified_as"].lower()) == ("audio", False)


def test_an_instrument_that_also_shows_a_disk_and_a_network_is_the_instrument() -> None:
    lines = (*DISK, "interface 01: class 02/06/00 driver=cdc_ether")
    found = told("Heron", "HeronSDR H1", *lines, nodes=[("net", "usb0"), ("block", "sda")])
    assert (found["class"], found["category"]) == ("sdr", "bidirectional")


@pytest.mark.parametrize(
    ("pid", "maker", "product", "lines"),
    [
        ("0001", "Finch", "Nano Transceiver", HID),  # the registered name brings in another kind
        ("0002", "Finch Instruments", "USB Sound Device", AUDIO),  # a chip maker's number; the product is a customer's
        ("0003", "SoniVole", "Gaming Keyboard", KEYS),  # a clone under a known brand's number
        ("0005", "no manufacturer", "Gadget USB HUB", ("interface 00: class 09/00/00 driver=hub",)),
    ],
)
def test_a_registered_name_gives_way_to_strings(
    pid: str, maker: str, product: str, lines: tuple[str, ...], databases: IdDatabases
) -> None:
    found = told(maker, product, *lines, pid=pid, databases=databases)
    assert "Warbler" not in found["identified_as"]
    assert found["confidence"] < 0.5


@pytest.mark.parametrize(
    ("product", "kind"),
    [
        *(("T9 Thermal Camera", "camera"), ("Thermal Camera", "camera"), ("Тепловая камера", "camera")),
        *(("V3 Video Capture", "capture"), ("P7 Touchscreen", "touchscreen")),
    ],
)
@pytest.mark.parametrize("pid", ["000a", "000b", "000c", "000d"])
def test_a_registered_kind_gives_way_to_the_kind_in_the_string(
    product: str, kind: str, pid: str, databases: IdDatabases
) -> None:
    found = told("Heron", product, *OWN, pid=pid, databases=databases)
    assert (found["class"], found["category"]) == (kind, "sensor")
    assert product.split()[0] in found["identified_as"]


@pytest.mark.parametrize(
    ("product", "kind", "category"),
    [("0001", "capture", "sensor"), ("0002", "capture", "sensor"), ("0003", "sdr", "bidirectional")],
)
def test_a_registered_name_is_no_other_kind_than_the_class_code_allows(
    product: str, kind: str, category: str, databases: IdDatabases
) -> None:
    lines = ("bus: pci", "vendor_id: 1d9c", f"device_id: {product}", "class_code: 0x040000")
    found = answer(device("pci-04", "pci", *lines, vid="1d9c", pid=product), databases)
    assert (found["class"], found["category"]) == (kind, category)


@pytest.mark.parametrize("pid", ["000c", "000d"])
def test_a_registered_wire_is_what_is_left_of_a_string_without_a_kind(pid: str, databases: IdDatabases) -> None:
    found = told("", "", *OWN, pid=pid, databases=databases)
    assert (found["class"], found["category"]) == ("serial", "unknown")
    named = told("Heron", "Marsh T9", *OWN, pid=pid, databases=databases)
    assert (named["class"], named["category"]) == ("serial", "bidirectional")


def test_the_driver_s_serial_line_is_stronger_than_the_word_in_the_string(databases: IdDatabases) -> None:
    lines = ("interface 00: class ff/00/00 driver=fx210x",)
    found = told("Heron", "T9 Thermal Camera", *lines, pid="000c", databases=databases, **TTY)
    assert (found["class"], found["category"]) == ("serial", "bidirectional")


def test_a_number_alone_is_never_more_than_a_hint(databases: IdDatabases) -> None:
    found = told("", "", *OWN, pid="0004", databases=databases)
    assert (found["confidence"] < 0.5, found["capabilities"]) == (True, [])
    hub = told("", "", "interface 00: class 09/00/00 driver=hub", pid="0005", databases=databases)
    assert (hub["class"], hub["confidence"] < 0.5) == ("hub", True)


def test_the_maker_s_own_number_makes_its_name_sure(databases: IdDatabases) -> None:
    registered = told("Finch", "Finch Nightingale 88", *KEYS, pid="0009", databases=databases)
    elsewhere = told("Finch", "Finch Nightingale 88", *KEYS, vid="2e00", databases=databases)
    assert registered["confidence"] > 0.5 > elsewhere["confidence"]
    assert registered["identified_as"] == elsewhere["identified_as"] == "Finch Nightingale 88"
