"""What a method rests on: a hub without strings was identified by its driver or its class, and by no string."""

import pytest

from octoform.contracts.model import Artifacts
from octoform.contracts.rules.identify.annotation_rules import method_false

HUB = """idVendor: 8087
idProduct: 0024
bcdDevice: 0000
bDeviceClass: 09
driver: usb
interface 00: class 09/00/00 driver=hub
interface 00.modalias: usb:v8087p0024d0000dc09dsc00dp01ic09isc00ip00in00"""
VENDOR_SPECIFIC = "idVendor: 8087\nidProduct: 0024\ninterface 00: class ff/00/00"
HOST_BRIDGE = "vendor: 0x8086\ndevice: 0x0104\nclass: 0x060000\nmodalias: pci:v00008086d00000104bc06sc00i00"
BOARD = f"{VENDOR_SPECIFIC}\nproduct: Bench board"


def refused(raw: str, method: str, interface: str = "usb", drivers: tuple[str, ...] = ("usb",)) -> list[str]:
    """The hints of the findings on one device that is said to be known by ``method``."""
    entry = {"id": "x-1", "name": f"{interface} device 8087:0024", "interface": interface, "raw_descriptor": raw}
    probe = {"platform": {"os": "linux"}, "devices": [{**entry, "drivers": list(drivers), "classes": []}]}
    device = {"id": "x-1", "method": method, "confidence": 0.8, "category": "infrastructure", "evidence": []}
    return [item.hint or "" for item in method_false({"devices": [device]}, Artifacts(probe=probe))]


@pytest.mark.parametrize("method", ["descriptor_driver", "kernel_class"])
def test_a_hub_is_known_by_its_driver_and_by_its_class(method: str) -> None:
    assert refused(HUB, method, drivers=("usb", "hub")) == []


def test_a_device_without_strings_is_known_by_none_and_the_hint_says_by_what() -> None:
    assert refused(HUB, "descriptor_strings", drivers=("usb", "hub")) == ["write descriptor_driver"]
    assert refused(HUB, "descriptor_strings") == ["write kernel_class"]
    assert refused(HOST_BRIDGE, "descriptor_strings", "pci", ()) == ["write kernel_class"]
    (found,) = refused(VENDOR_SPECIFIC, "descriptor_strings")
    assert "id_database" in found


@pytest.mark.parametrize(
    ("raw", "interface"),
    [
        (BOARD, "usb"),
        ("idVendor: 8087\niManufacturer 1 Heron", "usb"),
        ("idVendor: 8087\nID_MODEL=Heron_K20", "usb"),
        (f"{HUB}\ninterface 00.string: Heron", "usb"),
        (f"{HOST_BRIDGE}\nlabel: Onboard Ethernet", "pci"),
        ("name: envsense2", "i2c"),
        ("modalias: platform:gpio", "platform"),
    ],
)
def test_a_string_of_any_key_is_one_and_other_buses_have_names_alone(raw: str, interface: str) -> None:
    assert refused(raw, "descriptor_strings", interface) == []


def test_what_leaves_its_class_to_its_maker_is_known_by_neither_class_nor_general_driver() -> None:
    assert len(refused(VENDOR_SPECIFIC, "kernel_class")) == 1
    assert len(refused(VENDOR_SPECIFIC, "descriptor_driver", drivers=("usb", "usb-generic"))) == 1
    assert len(refused(BOARD, "kernel_class")) == 1
    assert refused("class: 0x060000\nvendor: 0x8086", "kernel_class", "pci") == []
