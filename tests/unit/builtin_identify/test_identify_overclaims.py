"""Names that say less than they seem to: quantities, wires, families of chips, and numbers that other makers share."""

from pathlib import Path

import pytest
from unit.builtin_identify.probes import answer, usb

from octoform.base.id_databases import IdDatabases

SURE = 0.5
HID = "interface 0: class 03/00/00"
KEYS, POINTER = "class 03/01/01", "class 03/01/02"
SERIAL = ("interface 0: class 02/02/01", "interface 1: class 0a/00/00")
VENDOR = "interface 0: class ff/00/00"
VIDEO = ("interface 0: class 0e/01/00", "interface 1: class 0e/02/00")
NETWORK = ("interface 0: class 02/06/00", "interface 1: class 0a/00/00")
DISK = "interface 0: class 08/06/50"


def _named(maker: str, product: str, *interfaces: str) -> list[str]:
    strings = [f"manufacturer: {maker}"] if maker else []
    return [*strings, f"product: {product}", *interfaces]


@pytest.mark.parametrize(
    ("maker", "product", "interfaces"),
    [
        ("Heron Imaging", "HD 4MP WEBCAM", VIDEO),
        ("Heron Imaging", "USB3.0 HD VIDEO CAPTURE", VIDEO),
        ("Heron Networks", "USB 10/100/1G/2.5G LAN", NETWORK),
        ("Heron Networks", "Heron Mobile Broadband", NETWORK),
        ("Heron Networks", "USB 2.0 To 100M LAN Adapter", NETWORK),
        ("Heron Television", "DVB-T TV Stick", (VENDOR,)),
        ("Heron Imaging", "QX Webcam [2 MP Fixed]", VIDEO),
        ("Heron Imaging", "Heron SW: This software has a time limitation.", VIDEO),
        ("Heron Imaging", "USB Camera-B4.09.24.1", VIDEO),
        ("Heron Networks", "802.11ac NIC", NETWORK),
        ("Heronstor", "Heronstor HS917", (DISK,)),
        ("Heron Disks", "USB 2.0 FD", (DISK,)),
        ("Heron Codes", "Barcode Device", (VENDOR,)),
        ("Heron Codes", "Barcode Reader", (f"interface 0: {KEYS}",)),
        ("Heron Climate", "Weather Station", (HID,)),
        ("Heron Keys", "KEYBOARD + LCD", (f"interface 0: {KEYS}",)),
        ("heron.example", "Heronware USB Device", (DISK,)),
        ("Heron Silicon", "USB Multimeter", (VENDOR,)),
        ("Heron Silicon", "Marsh Vue", SERIAL),
        ("Heron Wireless", "QXPRAIRIE-IDP", (VENDOR, "interface 1: class 0e/01/00")),
    ],
)
def test_what_many_products_say_names_none(maker: str, product: str, interfaces: tuple[str, ...]) -> None:
    assert answer(usb(*_named(maker, product, *interfaces)))["confidence"] < SURE


def test_a_model_beside_a_quantity_is_still_a_model() -> None:
    found = answer(usb(*_named("Heron Imaging", "Marsh 4K 60FPS X7", *VIDEO)))
    assert (found["identified_as"], found["confidence"] >= SURE) == ("Heron Imaging Marsh 4K 60FPS X7", True)


def test_a_cable_to_a_printer_is_no_printer() -> None:
    found = answer(usb(*_named("Heron Links", "Tillmaker USB to Printer", VENDOR)))
    assert (found["category"], found["class"]) == ("unknown", "serial")


@pytest.mark.parametrize(
    ("maker", "product"),
    [("Heronic", "HRN32-S2"), ("Marshware", "hrn32f446xx")],
)
def test_a_chip_of_its_maker_behind_a_serial_port_is_asked_about(maker: str, product: str) -> None:
    assert answer(usb(*_named(maker, product, *SERIAL)))["category"] == "unknown"


def test_a_number_that_has_nothing_of_its_makers_name_is_a_product() -> None:
    found = answer(usb(*_named("Heronic", "QX433", *SERIAL)))
    assert (found["identified_as"], found["category"]) == ("Heronic QX433", "bidirectional")


def test_a_sensor_named_by_its_chip_is_not_sure() -> None:
    assert answer(usb(*_named("Heronvision Inc.", "USB Camera-HV580", *VIDEO)))["confidence"] < SURE


def test_a_storage_function_of_a_chip_maker_names_no_board() -> None:
    assert answer(usb(*_named("Heron Microelectronics", "HX32 Linker", DISK)))["confidence"] < SURE


def test_the_serial_number_behind_a_name_is_not_shown() -> None:
    assert answer(usb(*_named("Heron Wireless", "Marsh M7 _SN:D744C4C5", *NETWORK)))["identified_as"].endswith("M7")


def _database(folder: Path, product: str) -> IdDatabases:
    place = folder / "usr/share/misc"
    place.mkdir(parents=True)
    (place / "usb.ids").write_text(f"1d9c  Heron Works\n\t0001  {product}\n", encoding="utf-8")
    return IdDatabases(folder)


def test_a_radio_under_a_shared_number_is_not_the_registered_one(tmp_path: Path) -> None:
    databases = _database(tmp_path, "Marsh Z-Stick Gen5")
    found = answer(usb(*_named("Heron Works", "USB-ZWave", *SERIAL)), databases)
    assert ("Gen5" in found["identified_as"], found["confidence"] < SURE) == (False, True)


def test_a_network_adapter_under_its_chips_number_is_no_registered_product(tmp_path: Path) -> None:
    found = answer(usb(*_named("Heron Works", "802.11ac NIC", *NETWORK)), _database(tmp_path, "QX88 [Tillbrand X7]"))
    assert found["confidence"] < SURE


def test_a_printer_cable_is_not_the_registered_chip(tmp_path: Path) -> None:
    lines = _named("Heron Works", "USB2.0-Print", "interface 0: class 07/01/02")
    assert answer(usb(*lines), _database(tmp_path, "HX340S"))["confidence"] < SURE


def test_an_infrared_transceiver_is_no_radio() -> None:
    assert answer(usb(*_named("Heron", "Marsh Infrared Transceiver", VENDOR)))["class"] == "ir"


def test_of_two_products_under_one_number_the_first_is_shown_and_none_is_sure(tmp_path: Path) -> None:
    found = answer(usb(HID), _database(tmp_path, "Marsh Weather Station / USB Catapult"))
    assert (found["identified_as"], found["confidence"] < SURE) == ("Heron Works Marsh Weather Station", True)


def test_what_stands_in_brackets_is_the_wire_of_a_product(tmp_path: Path) -> None:
    lines = _named("Heron Works", "Heron Reed", *SERIAL, "interface 2: class 03/00/00")
    found = answer(usb(*lines), _database(tmp_path, "Reed (CDC ACM, HID)"))
    assert (found["identified_as"], found["class"], found["confidence"] >= SURE) == ("Heron Reed", "serial", True)


def test_the_sound_of_a_camera_is_recorded_not_played() -> None:
    lines = _named("Heron Imaging", "Marsh Camera", "interface 0: class 01/01/00", "interface 1: class 01/02/00")
    assert answer(usb(*lines))["category"] == "sensor"


def test_a_mouse_with_keys_is_a_mouse() -> None:
    lines = _named("Heron Games", "Game Mouse", f"interface 0: {POINTER}", f"interface 1: {KEYS}")
    assert answer(usb(*lines))["class"] == "mouse"
    assert answer(usb(f"interface 0: {POINTER}", f"interface 1: {KEYS}"))["class"] == "mouse"
    assert answer(usb(f"interface 0: {KEYS}", f"interface 1: {POINTER}"))["class"] == "keyboard"


def test_a_boot_interface_beside_others_gives_no_name() -> None:
    found = answer(usb(HID, f"interface 1: {POINTER}"))
    assert (found["class"], found["identified_as"]) == ("mouse", "USB input device")


def test_a_debug_interface_beside_a_modems_lines_is_no_phone() -> None:
    lines = [f"interface {number}: class ff/00/00" for number in range(4)]
    found = answer(usb(*lines, "interface 4: class ff/42/01"))
    assert (found["class"], found["confidence"] < SURE) == ("modem", True)
    assert answer(usb(*_named("Heron", "Marsh 6", "interface 0: class ff/42/01")))["class"] == "phone"
