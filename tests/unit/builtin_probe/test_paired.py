"""Paired Bluetooth devices and mDNS neighbours: what the system knows already, as context, without names of people."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from octoform.builtin.probe import probe_root

SCHEMA = json.loads((Path(__file__).parents[3] / "protocol/schemas/probe.v1.schema.json").read_text())
Planted = Callable[..., Path]
HEADSET, SCALE = "02:00:5E:10:00:51", "02:00:5E:10:00:52"
INFO = f"""Device {HEADSET} (public)
\tName: Anna's Larkspur
\tAlias: Anna's Larkspur
\tClass: 0x00240404 (2360324)
\tIcon: audio-headset
\tPaired: yes
\tConnected: yes
\tUUID: Audio Sink                (0000110b-0000-1000-8000-00805f9b34fb)
\tUUID: Handsfree                 (0000111e-0000-1000-8000-00805f9b34fb)
\tUUID: Vendor specific           (931c7e8a-540f-4686-b798-e8df0a2ad9f7)
\tModalias: usb:v2EE0p0440d0100
"""
FILE = """[General]
Name=Anna's scale
Appearance=0x0c80
SupportedTechnologies=LE;
Services=00001800-0000-1000-8000-00805f9b34fb;0000180f-0000-1000-8000-00805f9b34fb;

[LongTermKey]
Key=00112233445566778899AABBCCDDEEFF

[DeviceID]
Source=1
Vendor=76
Product=17
"""


def record(root: Path, **outputs: str) -> None:
    folder = root / "recorded/commands"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in outputs.items():
        (folder / name.replace("_", "-")).write_text(text)


def with_bluetooth(root: Path) -> Path:
    """The host with an adapter and two paired devices: one that the tool lists, one in the service's files."""
    adapter = root / "sys/devices/platform/box/bluetooth/hci0"
    adapter.mkdir(parents=True)
    (root / "sys/class/bluetooth").mkdir(parents=True)
    (root / "sys/class/bluetooth/hci0").symlink_to("../../devices/platform/box/bluetooth/hci0")
    listed = f"Device {HEADSET} Anna's Larkspur\nDevice nonsense\n\x1b[0mDevice {HEADSET} twice\n"
    record(root, bluetoothctl_devices=listed, **{f"bluetoothctl_info_{HEADSET.replace(':', '_')}": INFO})
    for address, text in ((SCALE, FILE), ("02:00:5E:10:00:53", "[General]\nName=seen once\n")):
        folder = root / f"var/lib/bluetooth/02:00:5E:10:00:01/{address}"
        folder.mkdir(parents=True)
        (folder / "info").write_text(text)
    return root


def found(artifact: Any) -> dict[str, Any]:
    assert [error.message for error in Draft202012Validator(SCHEMA).iter_errors(artifact)] == []
    return {device["id"]: device for device in artifact["devices"]}


def test_paired_devices_are_context_of_standard_kinds(planted: Planted) -> None:
    root = with_bluetooth(planted("laptop"))
    artifact: Any = probe_root(root)
    devices = found(artifact)
    headset, scale = devices["bluetooth-paired-2ee0-0440"], devices["bluetooth-paired-004c-0011"]
    assert headset["raw_descriptor"].split("\n") == [
        "bus: bluetooth",
        "paired: audio",
        "class_of_device: 0x00240404",
        "maker_number: usb 2ee0",
        "product_number: 0440",
        "profiles: 110b audio sink, 111e hands-free",
    ]
    assert (headset["interface"], headset["context"]) == ("bluetooth", True)
    assert (headset["vid"], headset["pid"]) == ("2ee0", "0440")
    assert headset["instance"]["address"] == HEADSET
    assert headset["instance"]["connected"] is True
    assert "paired: scale" in scale["raw_descriptor"] and "vid" not in scale
    assert {scan["name"]: scan["status"] for scan in artifact["scan_methods"]}["command:bluetoothctl"] == "ok"
    assert len([name for name in devices if name.startswith("bluetooth-paired")]) == 2


def test_no_name_key_or_address_of_a_paired_device_stands_in_a_kind(planted: Planted) -> None:
    artifact: Any = probe_root(with_bluetooth(planted("laptop")))
    whole = json.dumps(artifact)
    assert "Anna" not in whole and "00112233445566778899AABBCCDDEEFF" not in whole and "seen once" not in whole
    for device in artifact["devices"]:
        del device["instance"]
    assert "02:00:5E:10:00" not in json.dumps(artifact).upper()


def test_without_an_adapter_the_tool_is_not_asked(planted: Planted) -> None:
    artifact: Any = probe_root(planted("laptop"))
    scan = next(scan for scan in artifact["scan_methods"] if scan["name"] == "command:bluetoothctl")
    assert (scan["status"], scan["detail"]) == ("unsupported", "no Bluetooth adapter")


@pytest.mark.parametrize(
    "said",
    [
        "",
        "Device\n",
        "Device 02:00:5E:10:00:51",
        "\0" * 100,
        "Device " + "A" * 100_000,
        "Waiting to connect to bluetoothd...",
    ],
)
def test_an_odd_answer_of_the_tool_spoils_nothing(planted: Planted, said: str) -> None:
    root = with_bluetooth(planted("empty-vm"))
    record(root, bluetoothctl_devices=said)
    assert "bluetooth-paired-004c-0011" in found(probe_root(root))


def test_an_older_tool_is_asked_in_its_own_words(planted: Planted) -> None:
    root = with_bluetooth(planted("empty-vm"))
    folder = root / "recorded/commands"
    (folder / "bluetoothctl-devices").rename(folder / "bluetoothctl-paired-devices")
    assert "bluetooth-paired-2ee0-0440" in found(probe_root(root))


def test_an_adapter_without_the_tool_is_not_found(planted: Planted) -> None:
    root = with_bluetooth(planted("empty-vm"))
    (root / "recorded/commands/bluetoothctl-devices").unlink()
    artifact: Any = probe_root(root)
    assert {scan["name"]: scan["status"] for scan in artifact["scan_methods"]}["command:bluetoothctl"] == "not_found"


def test_more_paired_devices_than_anybody_has_are_cut(planted: Planted) -> None:
    root = planted("empty-vm")
    for number in range(60):
        folder = root / f"var/lib/bluetooth/02:00:5E:10:00:01/02:00:5E:20:00:{number:02X}"
        folder.mkdir(parents=True)
        (folder / "info").write_text("[General]\nClass=0x2540\n[LinkKey]\nKey=0\n")
    assert len([name for name in found(probe_root(root)) if name.startswith("bluetooth-paired-input")]) == 32


def test_mdns_neighbours_are_a_number_in_the_one_context_unit(planted: Planted) -> None:
    root = planted("laptop")
    plain: Any = probe_root(root)
    record(
        root,
        avahi_browse="+;wlan0;IPv4;Anna\\039s printer;_ipp._tcp;local\n"
        "+;wlan0;IPv6;Anna\\039s printer;_ipps._tcp;local\n"
        "+;wlan0;IPv4;desk;_ssh._tcp;local\nodd\n+;short\n",
    )
    artifact: Any = probe_root(root)
    unit = found(artifact)["network-neighbours"]
    assert (unit["context"], unit["interface"], unit["instance"]["mdns_names"]) == (True, "network", 2)
    assert "Anna" not in json.dumps(artifact)
    assert unit["raw_descriptor"] == found(plain)["network-neighbours"]["raw_descriptor"]
