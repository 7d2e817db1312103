"""Numbers that sit on many products: the strings identify the device, never the number.

Every row is a vendor:product pair that is known to be shared: a bridge chip's, a firmware example's, a controller's
that any brand may buy. The products and the id database are invented. For each row: two products under one number are
two answers; the chip's own strings, and no strings at all, are `unknown`, or the class where an interface makes that
sure, with less than even confidence in any name.
"""

from dataclasses import dataclass
from typing import Any

import pytest
from cases import for_each
from unit.builtin_identify.probes import NO_DATABASES, answer, usb

from octoform.base.id_databases import IdDatabases

CERTAIN = 0.5


@dataclass(frozen=True)
class Shared:
    """One shared number: its interfaces with their drivers, the chip's own strings, and what the class makes sure."""

    vid: str
    pid: str
    interfaces: tuple[str, ...]
    chip: tuple[str, str]
    sure: str = ""
    registered: str = "QX34 serial converter"
    node: str = ""


def _serial(vid: str, pid: str, driver: str, *chip: str) -> Shared:
    return Shared(vid, pid, (f"ff/01/02 driver={driver}",), (chip[0], chip[1]), node="ttyUSB0")


def _acm(vid: str, pid: str, *chip: str) -> Shared:
    interfaces = ("02/02/01 driver=cdc_acm", "0a/00/00 driver=cdc_acm")
    return Shared(vid, pid, interfaces, (chip[0], chip[1]), registered="QX55 CDC ACM", node="ttyACM0")


def _of(kind: str, vid: str, pid: str, *chip: str) -> Shared:
    interface, registered = {
        "camera": ("0e/01/00 driver=uvcvideo", "Original Lens 100"),
        "audio": ("01/01/00 driver=snd-usb-audio", "Original Tone 100"),
        "storage": ("08/06/50 driver=usb-storage", "Original Shelf 100"),
        "hub": ("09/00/00 driver=hub", "QX61 Hub"),
        "keyboard": ("03/01/01 driver=usbhid", "Original Typist 100"),
        "input": ("03/00/00 driver=usbhid", "Original Player 100"),
        "gamepad": ("ff/5d/01 driver=xpad", "Original Player 200"),
        "mcu": ("fe/01/02", "QX71 boot loader"),
        "": ("ff/00/00", "Original Gauge 100"),
    }[kind]
    return Shared(vid, pid, (interface,), (chip[0], chip[1]), kind, registered)


SHARED = (
    _serial("1a86", "7523", "ch341", "", "USB Serial"),
    _serial("1a86", "5523", "ch341", "", "USB2.0-Serial"),
    _acm("1a86", "55d3", "wch.cn", "USB Single Serial"),
    _acm("1a86", "55d4", "wch.cn", "USB Enhanced SERIAL"),
    _serial("10c4", "ea60", "cp210x", "Silicon Labs", "CP2102 USB to UART Bridge Controller"),
    _serial("10c4", "ea70", "cp210x", "Silicon Labs", "CP2105 Dual USB to UART Bridge Controller"),
    _serial("0403", "6001", "ftdi_sio", "FTDI", "FT232R USB UART"),
    _serial("0403", "6010", "ftdi_sio", "FTDI", "Dual RS232-HS"),
    _serial("0403", "6014", "ftdi_sio", "FTDI", "UM232H"),
    _serial("0403", "6015", "ftdi_sio", "FTDI", "FT230X Basic UART"),
    _serial("067b", "2303", "pl2303", "Prolific Technology Inc.", "USB-Serial Controller D"),
    _serial("067b", "23a3", "pl2303", "Prolific Technology Inc.", "PL2303GC"),
    _acm("04d8", "000a", "Microchip Technology, Inc.", "CDC RS-232 Emulation Demo"),
    _acm("03eb", "2044", "LUFA Library", "LUFA CDC Demo"),
    _acm("0483", "5740", "STMicroelectronics", "STM32 Virtual ComPort"),
    _acm("1fc9", "0094", "NXP SEMICONDUCTORS", "VCOM Port"),
    _acm("16c0", "05e1", "obdev.at", "CDC-ACM"),
    _acm("16c0", "0483", "", "USB Serial"),
    _acm("1209", "0001", "", "Test PID"),
    _acm("2e8a", "0005", "", "Board in FS mode"),
    _acm("2e8a", "000a", "", "USB Serial Device"),
    _acm("303a", "1001", "Espressif", "USB JTAG/serial debug unit"),
    _acm("239a", "cafe", "", "CDC Device"),
    _acm("1d50", "6018", "", "Debug UART"),
    _of("", "16c0", "05dc", "", "USB Device"),
    _of("", "04b4", "8613", "", "Default Device"),
    _of("", "0925", "3881", "", "USB Composite Device"),
    _of("mcu", "0483", "df11", "STMicroelectronics", "STM32  BOOTLOADER"),
    _of("hub", "05e3", "0608", "GenesysLogic", "USB2.0 Hub"),
    _of("hub", "1a40", "0101", "", "USB 2.0 Hub"),
    _of("audio", "0d8c", "0014", "C-Media Electronics Inc.", "USB Audio Device"),
    _of("audio", "1908", "2070", "", "USB PnP Sound Device"),
    _of("audio", "08bb", "2902", "Burr-Brown from TI", "USB Audio CODEC"),
    _of("camera", "0c45", "6366", "Sonix Technology Co., Ltd.", "USB 2.0 Camera"),
    _of("camera", "05a3", "9230", "", "HD USB Camera"),
    _of("camera", "1bcf", "2b8a", "Generic", "Integrated Camera"),
    _of("camera", "1908", "2311", "", "USB2.0 PC CAMERA"),
    _of("storage", "0bda", "0129", "Generic", "USB2.0-CRW"),
    _of("storage", "058f", "6387", "Generic", "Mass Storage"),
    _of("storage", "abcd", "1234", "VendorCo", "ProductCode"),
    _of("gamepad", "045e", "028e", "", "Controller"),
    _of("input", "0079", "0006", "DragonRise Inc.", "Generic   USB  Joystick"),
    _of("keyboard", "04d9", "1603", "", "USB Keyboard"),
    _of("keyboard", "258a", "0001", "SINO WEALTH", "USB KEYBOARD"),
)
IDS = [f"{row.vid}-{row.pid}" for row in SHARED]
# A product without a telling interface class is identified by a word for what it does.
ONE, OTHER = ("Heron Works", "Heron Humidity H70"), ("Plover", "Plover Lamp P90")


@pytest.fixture(scope="module", params=["without databases", "with databases"])
def databases(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> IdDatabases:
    if request.param == "without databases":
        return NO_DATABASES
    root = tmp_path_factory.mktemp("ids")
    vendors: dict[str, list[str]] = {}
    for row in SHARED:
        vendors.setdefault(row.vid, []).append(f"\t{row.pid}  {row.registered}\n")
    folder = root / "usr/share/misc"
    folder.mkdir(parents=True)
    text = "".join(f"{vid}  Chipworks {vid.upper()}\n{''.join(lines)}" for vid, lines in vendors.items())
    (folder / "usb.ids").write_text(text, encoding="utf-8")
    return IdDatabases(root)


def told(row: Shared, strings: tuple[str, str], databases: IdDatabases) -> dict[str, Any]:
    lines = [f"{key}: {text}" for key, text in zip(("manufacturer", "product"), strings, strict=True) if text]
    lines += [f"interface {number:02}: class {text}" for number, text in enumerate(row.interfaces)]
    drivers = sorted({text.split("driver=")[1] for text in row.interfaces if "driver=" in text})
    nodes = [("tty", row.node)] if row.node else []
    return answer(usb(*lines, vid=row.vid, pid=row.pid, nodes=nodes, drivers=drivers), databases)


def test_there_are_enough_of_them() -> None:
    assert len(set(IDS)) == len(IDS) >= 25


@for_each("row", SHARED)
def test_two_products_under_one_number_are_two_answers(row: Shared, databases: IdDatabases) -> None:
    one, other = told(row, ONE, databases), told(row, OTHER, databases)
    assert one["identified_as"] == "Heron Humidity H70"
    assert other["identified_as"] == "Plover Lamp P90"
    if row.node or not row.sure:
        assert (one["category"], other["category"]) == ("sensor", "actuator")
        assert min(one["confidence"], other["confidence"]) > CERTAIN
    assert "Chipworks" not in str((one["evidence"], other["evidence"]))


@for_each("row", SHARED)
@for_each("strings", ["the chip's", "none"])
def test_a_chip_and_a_number_name_no_product(row: Shared, strings: str, databases: IdDatabases) -> None:
    found = told(row, row.chip if strings == "the chip's" else ("", ""), databases)
    # The class HID alone may be a relay as well, and a vendor's own interface anything that no one names.
    pipes = ("input", "gamepad") if databases is NO_DATABASES else ("input",)
    assert found["confidence"] < CERTAIN
    assert found["capabilities"] == [] or row.sure
    if row.node:
        assert (found["category"], found["confidence"]) == ("unknown", 0.0)
        assert row.registered not in found["identified_as"]
        assert found["missing"]
    elif row.sure and not (strings == "none" and row.sure in pipes):
        assert found["category"] != "unknown"
        assert found["class"] in (row.sure, "gamepad")
    else:
        assert (found["category"], found["confidence"]) == ("unknown", 0.0)
