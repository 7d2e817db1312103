"""A product of several functions is one device, whatever the kernel puts between it and its parts."""

from pathlib import Path

import pytest
from sysfs_tree import Tree

from octoform import runtime
from octoform.builtin.probe import probe_root

HUB = "devices/pci0000:00/usb1/1-4"
HID = f"{HUB}/1-4:1.0/0003:1D9C:2A0B.0001"


@pytest.fixture
def hub(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A USB hub of sensors: each of its functions is a platform device with a driver of its own."""
    tree = Tree(tmp_path)
    tree.usb(HUB, "1d9c", "2a0b", "LUX-000417")
    tree.bus(f"{HUB}/1-4:1.0", "usb", DRIVER="usbhid")
    tree.bus(HID, "hid", HID_ID="0003:00001D9C:00002A0B")
    for number, name in enumerate(("als", "accel_3d")):
        cell = f"{HID}/HID-SENSOR-20004{number}.{number}.auto"
        tree.bus(cell, "platform", DRIVER=f"hid_sensor_{name}")
        tree.bus(f"{cell}/iio:device{number}", "iio", {"name": name})
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(tmp_path))
    monkeypatch.delenv("OCTOFORM_INSTANCES", raising=False)
    return tmp_path


def test_probe_lists_the_product_with_all_its_functions(hub: Path) -> None:
    (device,) = probe_root(hub)["devices"]
    assert (device["id"], device["classes"]) == ("usb-1d9c-2a0b", ["hid", "iio"])
    assert "iio[1].name: als" in device["raw_descriptor"]
    assert device["instance"]["strength"] == "strong"


def test_a_call_finds_the_functions_below_the_product(hub: Path) -> None:
    found = runtime.device("usb-1d9c-2a0b").paths("iio")
    assert [path.name for path in found] == ["iio:device0", "iio:device1"]
