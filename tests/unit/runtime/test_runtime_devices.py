"""A device is found by identity, where it is now."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree

from octoform import runtime
from octoform.runtime import where

CAMERA = "usb-1f00-00c1"
Instances = Callable[[dict[str, Any]], Path]


def camera(tree: Tree, port: str, number: int, serial: str = "") -> None:
    """A USB camera on a port, with the node that the kernel gave it."""
    tree.usb(f"pci0/usb1/{port}", "1f00", "00c1", serial)
    tree.bus(f"pci0/usb1/{port}/{port}:1.0", "usb")
    node = f"video{number}"
    tree.member(f"pci0/usb1/{port}/{port}:1.0/video4linux/{node}", "video4linux", {"name": "Cam"}, DEVNAME=node)


def at(port: str, **more: str) -> dict[str, str]:
    return {"sysfs": f"/sys/devices/pci0/usb1/{port}", "port": port, "strength": "positional", **more}


def test_the_node_of_a_device_where_it_was_seen(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0)
    instances({CAMERA: at("1-2")})
    found = runtime.device(CAMERA)
    assert found.node("video4linux") == str(tree.root / "dev/video0")
    assert found.path("video4linux").name == "video0"
    assert found.strength == "positional"


def test_a_device_in_another_port_with_another_node_is_found_again(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0)
    instances({CAMERA: at("1-2")})
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")
    tree.unplug("pci0/usb1/1-2")
    camera(tree, "1-4", 3)
    found = runtime.device(CAMERA, actuate=True)
    assert found.node("video4linux").endswith("video3")
    assert found.strength == "weak"


def test_a_serial_number_tells_twins_apart_wherever_they_are(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0, serial="B7")
    camera(tree, "1-3", 1, serial="A5")
    known = {
        CAMERA: at("1-2", serial="A5", strength="strong"),
        f"{CAMERA}-2": at("1-3", serial="B7", strength="strong"),
    }
    instances(known)
    assert runtime.device(CAMERA, actuate=True).node("video4linux").endswith("video1")
    assert runtime.device(f"{CAMERA}-2", actuate=True).node("video4linux").endswith("video0")


def test_another_specimen_is_not_taken_for_a_strongly_identified_one(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0, serial="OTHER")
    instances({CAMERA: at("1-2", serial="A5", strength="strong")})
    with pytest.raises(runtime.DeviceAbsent, match="another serial number"):
        runtime.device(CAMERA)


def test_an_empty_serial_number_is_no_identity(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0)
    instances({CAMERA: at("1-2", serial=" ", strength="strong")})
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")


def test_an_absent_device_is_named(tree: Tree, instances: Instances) -> None:
    instances({CAMERA: at("1-2")})
    with pytest.raises(runtime.DeviceAbsent, match=CAMERA) as caught:
        runtime.device(CAMERA)
    assert caught.value.device == CAMERA


def test_two_twins_in_unknown_ports_are_ambiguous_for_an_actuator_only(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-4", 0)
    camera(tree, "1-5", 1)
    instances({CAMERA: at("1-2")})
    with pytest.raises(runtime.AmbiguousDevice, match="2 equal devices"):
        runtime.device(CAMERA, actuate=True)
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")


def test_a_place_that_another_id_holds_is_not_taken(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-3", 0)
    camera(tree, "1-5", 1)
    instances({CAMERA: at("1-2"), f"{CAMERA}-2": at("1-3")})
    assert runtime.device(CAMERA, actuate=True).node("video4linux").endswith("video1")


def test_a_renumbered_sensor_is_found_by_its_name(tree: Tree, instances: Instances) -> None:
    tree.member("virtual/hwmon/hwmon0", "hwmon", {"name": "wifi"})
    tree.member("virtual/hwmon/hwmon1", "hwmon", {"name": "corechip"})
    instances({"hwmon-corechip": {"sysfs": "/sys/devices/virtual/hwmon/hwmon0", "port": "hwmon0"}})
    assert runtime.device("hwmon-corechip").path("hwmon").name == "hwmon1"


def test_without_instances_kind_and_ordinal_decide(tree: Tree) -> None:
    camera(tree, "1-2", 0)
    camera(tree, "1-10", 1)
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")
    assert runtime.device(f"{CAMERA}-2").node("video4linux").endswith("video1")
    with pytest.raises(runtime.DeviceAbsent):
        runtime.device(f"{CAMERA}-3")
    with pytest.raises(runtime.AmbiguousDevice):
        runtime.device(CAMERA, actuate=True)


def test_a_broken_instances_file_leaves_identity_by_kind(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0)
    instances({}).write_text("{")
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")


def test_a_changed_instances_file_is_read_again(tree: Tree, instances: Instances) -> None:
    camera(tree, "1-2", 0)
    camera(tree, "1-3", 1)
    instances({CAMERA: at("1-2")})
    assert runtime.device(CAMERA).node("video4linux").endswith("video0")
    instances({CAMERA: at("1-3", note="moved")})
    assert runtime.device(CAMERA).node("video4linux").endswith("video1")


def test_what_hangs_on_a_device_below_is_not_its_own(tree: Tree) -> None:
    tree.bus("pci0/0000:00:14.0", "pci", {"vendor": "0x1f01", "device": "0x0001"})
    camera_path = "pci0/0000:00:14.0/usb1/1-1"
    tree.usb(camera_path, "1f00", "00c1")
    tree.member(f"{camera_path}/input/input4", "input", {"name": "Button"})
    tree.member(f"{camera_path}/input/input4/event2", "input", DEVNAME="input/event2")
    assert runtime.device("pci-1f01-0001").paths("input") == []
    with pytest.raises(runtime.DeviceAbsent, match="no input node"):
        runtime.device("pci-1f01-0001").node("input")
    assert runtime.device(CAMERA).nodes("input", "event") == [str(tree.root / "dev/input/event2")]


def test_a_keyboard_behind_a_receiver_is_not_the_receivers(tree: Tree) -> None:
    tree.usb("pci0/usb1/1-1", "1f00", "0aaa")
    for name, pid, number in (("0003:1F00:0AAA.0001", "0AAA", 1), ("0003:1F00:0BBB.0002", "0BBB", 2)):
        tree.bus(f"pci0/usb1/1-1/{name}", "hid", HID_ID=f"0003:00001F00:0000{pid}")
        tree.member(f"pci0/usb1/1-1/{name}/input/input{number}", "input", {"name": "keys"})
    assert [path.name for path in runtime.device("usb-1f00-0aaa").paths("input")] == ["input1"]
    assert [path.name for path in runtime.device("hid-1f00-0bbb").paths("input")] == ["input2"]


def test_a_device_that_goes_away_while_it_is_looked_for_is_not_attached(
    tree: Tree, instances: Instances, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera(tree, "1-2", 0)
    instances({CAMERA: at("1-2")})
    assert where.whereabouts(CAMERA)["attached"]

    def unplugged_meanwhile(node_id: str, actuate: bool = False) -> runtime.Device:
        if actuate:
            tree.unplug("pci0/usb1/1-2")
        return runtime.device(node_id, actuate=actuate)

    monkeypatch.setattr(where, "device", unplugged_meanwhile)
    found = where.whereabouts(CAMERA)
    assert (found["attached"], found["port"]) == (False, "1-2")
