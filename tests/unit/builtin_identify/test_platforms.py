"""Macs, WSL2, paired devices and network adapters: named where something names them, left out with an honest reason."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts

SCHEMAS = Path(__file__).parents[3] / "protocol/schemas"
Planted = Callable[..., Path]


def onboarded(root: Path) -> tuple[Any, Any, Any]:
    """PROBE, IDENTIFY and INTERFACE of a host, each accepted by its contract."""
    probed: Any = probe_root(root)
    known = identify(probed, IdDatabases(root))
    declared = declare(known, 30)
    assert check("probe", probed, Artifacts(), SCHEMAS) == []
    assert check("identify", known, Artifacts(probe=probed), SCHEMAS) == []
    assert check("interface", declared, Artifacts(probe=probed, identify=known), SCHEMAS) == []
    return probed, known, declared


def by_id(items: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {item["id"]: item for item in items}


def test_a_mac_is_named_and_gets_no_tool(planted: Planted) -> None:
    _, known, declared = onboarded(planted("macos-studio"))
    devices = by_id(known["devices"])
    assert {name: (one["category"], one["class"]) for name, one in devices.items()} == {
        "macos-audio-bluetooth-audio": ("actuator", "audio_out"),
        "macos-audio-studio-speakers": ("actuator", "audio_out"),
        "macos-bluetooth-bluetooth-adapter": ("infrastructure", "bluetooth"),
        "macos-camera-lidview-hd-camera": ("sensor", "camera"),
        "macos-disk-marsh-ssd-ap1024": ("infrastructure", "storage"),
        "macos-gpu-marsh-m9": ("infrastructure", "gpu"),
        "macos-net-airport": ("infrastructure", "network"),
        "macos-net-ethernet": ("infrastructure", "network"),
        "macos-power-rc57": ("infrastructure", "power"),
        "macos-printer-reed-laser-40": ("actuator", "printer"),
        "usb-1d00-2513": ("infrastructure", "hub"),
        "usb-1d9c-0c14": ("sensor", "camera"),
        "usb-2e5c-7001": ("unknown", "serial"),
        "usb-2ee1-0440": ("infrastructure", "storage"),
    }
    assert devices["macos-camera-lidview-hd-camera"]["identified_as"] == "Lidview HD Camera"
    assert all(one["capabilities"] == [] for one in devices.values())
    assert declared["tools"] == []
    fields = {item["id"]: item.get("detail", "") for item in declared["left_out"]}
    assert fields["usb-1d9c-0c14"] == "seen by macOS, for which the embedded agent writes no tools"
    assert "kernel" not in " ".join(fields[name] for name in devices)
    reasons = {item["id"]: item["reason"] for item in declared["left_out"]}
    assert reasons["usb-1d9c-0c14"] == reasons["macos-camera-lidview-hd-camera"] == "no_standard_interface"
    assert reasons["macos-printer-reed-jet-airprint"] == reasons["macos-camera-phone17-2"] == "network_neighbour"
    assert reasons["tty-line"] == "unknown_meaning"


def test_not_even_a_profile_with_commands_gives_a_mac_a_tool() -> None:
    """Its server would look for the line where only Linux has it."""
    entry = {"id": "usb-2e5c-7001", "name": "Marsh Board", "interface": "usb", "classes": ["tty"]}
    entry["raw_descriptor"] = "bus: usb\nproduct: Marsh Board\ninterface 00: class 02/02/01"
    command = {"tool": "rail_move_x", "send": "MOVE_X {steps}", "about": "Move.", "effect": "actuate", "parameters": {}}
    grammar = {"line": {"class": "tty", "baud": 115200}, "commands": [command]}
    profile = {
        "name": "rail",
        "about": "Rail",
        "product": "Rail",
        "holds": [entry["id"]],
        "limits": [],
        "grammar": grammar,
        "body": "",
    }
    databases = IdDatabases(Path("/nowhere"))
    for system, tools in (("linux", 1), ("macos", 0)):
        (device,) = identify({"platform": {"os": system}, "devices": [entry]}, databases, (profile,))["devices"]
        assert len(device["capabilities"]) == tools


def test_a_mac_without_the_registry_is_named_by_its_reports(planted: Planted) -> None:
    _, known, declared = onboarded(planted("macos-older"))
    assert by_id(known["devices"])["usb-1d9c-0c14"]["class"] == "camera"
    assert declared["tools"] == []


def test_what_windows_has_is_left_out_with_the_command_that_hands_it_over(planted: Planted) -> None:
    _, known, declared = onboarded(planted("wsl2"))
    left = by_id(known["left_out"])
    camera = left["windows-usb-1d9c-0c20"]
    assert camera["reason"] == "not_permitted"
    assert camera["detail"] == (
        "Kestrel Lid Camera: belongs to Windows; run there `usbipd bind --hardware-id 1d9c:0c20` as administrator, "
        "then `usbipd attach --wsl --hardware-id 1d9c:0c20`"
    )
    assert left["windows-usb-2e5c-7001"]["reason"] == "duplicate_path"
    assert "bind" not in left["windows-usb-2e5c-7002"]["detail"]
    assert left["windows-pci-1d00-0a16"]["reason"] == "no_standard_interface"
    assert left["windows-software-bluetooth"]["reason"] == "virtual"
    assert [tool["name"] for tool in declared["tools"]] == ["read_network_interfaces"]


@pytest.mark.parametrize(
    ("paired", "profiles", "says"),
    [
        ("audio", "110b audio sink", "no class of the kernel"),
        ("input", "1124 human interface", "input device of its own"),
        ("device", "1812 human interface over low energy", "input device of its own"),
        ("device", "", "no class of the kernel"),
    ],
)
def test_a_paired_device_is_no_device_of_this_host(paired: str, profiles: str, says: str) -> None:
    lines = ["bus: bluetooth", f"paired: {paired}", *([f"profiles: {profiles}"] if profiles else [])]
    entry = {"id": "bluetooth-paired-x", "name": "paired", "interface": "bluetooth", "context": True}
    known = identify({"devices": [{**entry, "raw_descriptor": "\n".join(lines)}]}, IdDatabases(Path("/nowhere")))
    (left,) = known["left_out"]
    assert known["devices"] == []
    assert left["reason"] == "no_standard_interface" and says in left["detail"]


def test_a_connected_keyboard_is_the_device_that_the_kernel_makes_of_it(planted: Planted) -> None:
    last = "group:net /devices/virtual/net/lo"
    place = "/devices/virtual/misc/uhid/0005:2EE0:0441.0007"
    keyboard = [
        f"bus:hid {place} driver=hid-generic modalias=hid:b0005g0001v00002EE0p00000441",
        "  uevent+=HID_ID=0005:00002EE0:00000441\\nHID_NAME=Reed Keys 41\\nHID_UNIQ=02:00:5e:10:00:52",
        f"class:input {place}/input/input21",
        "  name=Reed Keys 41",
        "  capabilities/ev=120013",
        "  capabilities/key=402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe",
    ]
    probed, known, _ = onboarded(planted("laptop", {last: "\n".join([last, *keyboard])}))
    assert by_id(known["devices"])["hid-2ee0-0441"]["class"] == "keyboard"
    assert by_id(known["devices"])["hid-2ee0-0441"]["capabilities"]
    entry = by_id(probed["devices"])["hid-2ee0-0441"]
    assert "context" not in entry and entry["instance"]["serial"] == "02:00:5e:10:00:52"


def test_adapters_are_infrastructure_with_a_read_tool_that_says_no_address(planted: Planted) -> None:
    probed, known, declared = onboarded(planted("laptop"))
    adapter = by_id(known["devices"])["pci-1d00-0a95"]
    assert (adapter["category"], [one["name"] for one in adapter["capabilities"]]) == (
        "infrastructure",
        ["read_network_interfaces"],
    )
    tool = next(tool for tool in declared["tools"] if tool["name"] == "read_network_interfaces")
    assert (tool["effect"], tool["devices"]) == ("read", ["pci-1d00-0a95"])
    address = by_id(probed["devices"])["pci-1d00-0a95"]["instance"]["address"]
    assert address not in json.dumps([known, declared]) and "wlan0" not in json.dumps([known, declared])


def test_a_host_that_shows_nothing_is_onboarded_with_no_tool(tmp_path: Path) -> None:
    probed, known, declared = onboarded(tmp_path)
    assert (probed["devices"], known["devices"], declared["tools"]) == ([], [], [])
    assert check("serve", render(declared), Artifacts(probe=probed, identify=known, interface=declared), SCHEMAS) == []
