"""The items of a recording's `truth.json`, and which unit of a PROBE artifact each of them means.

A truth item names its device the way the recording shows it (ids and port, sysfs path, kernel name). PROBE lists bus
devices; a kernel class device (a video node, a disk) belongs to the unit whose path holds it.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Device = dict[str, Any]

_USB = re.compile(r"^usb ([0-9a-f]{4}):([0-9a-f]{4})(?: at ([\d.-]+))?")
_SERIAL = re.compile(r"^serial port .*\(usb ([0-9a-f]{4}):([0-9a-f]{4})\)$")
_SYSFS = re.compile(r"^sysfs (/\S+)")
_HID = re.compile(r"HID (?:([0-9A-Fa-f]{4}):)?([0-9A-Fa-f]{4}):([0-9A-Fa-f]{4})$")
_HWMON = re.compile(r"^hwmon (.+?)-(?:pci|isa|virtual|acpi|i2c|usb|hid|platform|nvme|scsi)-?.*$")
_CARD = re.compile(r"^ALSA card (\d+)")
_NODE = re.compile(r"^(?:iio |block |net |)(?:/dev/)?([\w:.-]+)")


@dataclass(frozen=True)
class Item:
    """One line of truth. ``by_hand`` items are the ones that test the program; the others were made by rules."""

    recording: str
    match: str
    product: str
    category: str
    also_ok: tuple[str, ...]
    kind: str
    capabilities: tuple[str, ...]
    must_not_be: tuple[str, ...]
    identified_by: str
    by_hand: bool

    @property
    def quoted(self) -> str:
        """The device's own strings, where the match cites them."""
        found = re.search(r'"(.*)"', self.match)
        return found.group(1) if found else ""


def read_items(folder: Path) -> list[Item]:
    """The items of one recording, in the order of its file."""
    document = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    return [
        Item(
            recording=folder.name,
            match=entry["match"],
            product=entry["product"],
            category=entry["category"],
            also_ok=tuple(entry.get("category_also_ok") or ()),
            kind=entry["class"],
            capabilities=tuple(entry.get("capabilities_any_of") or ()),
            must_not_be=tuple(entry.get("must_not_be") or ()),
            identified_by=entry.get("identified_by", "strings"),
            by_hand=entry.get("basis") == "hand",
        )
        for entry in document["devices"]
    ]


class Units:
    """The units of one PROBE artifact, to be found by a truth item's match."""

    def __init__(self, probe: dict[str, Any]) -> None:
        self.devices: list[Device] = list(probe["devices"])
        self._taken: set[str] = set()

    def find(self, item: Item) -> Device | None:
        """The unit that holds the item's device, None when PROBE shows none."""
        found = self._candidates(item)
        if not found:
            return None
        fresh = [device for device in found if device["id"] not in self._taken]
        chosen = (fresh or found)[0]
        self._taken.add(chosen["id"])
        return chosen

    def _candidates(self, item: Item) -> list[Device]:
        match = item.match
        if usb := _USB.match(match):
            return self._by_usb(*usb.groups())
        if serial := _SERIAL.match(match):
            found = self._by_usb(serial.group(1), serial.group(2), None)
            return [d for d in found if _is_called(d, match)] or found
        if sysfs := _SYSFS.match(match):
            return self._by_path(f"/sys{sysfs.group(1)}")
        if hid := _HID.search(match):
            return self._by_hid(hid.group(1), hid.group(2), hid.group(3))
        if hwmon := _HWMON.match(match):
            return [d for d in self.devices if self._is_hwmon(d, hwmon.group(1))]
        if card := _CARD.match(match):
            return self._by_node(f"card{card.group(1)}")
        if node := _NODE.match(match):
            return self._by_node(node.group(1))
        return []

    def _by_usb(self, vendor: str, product: str, port: str | None) -> list[Device]:
        same = [d for d in self.devices if (d.get("vid"), d.get("pid")) == (vendor, product)]
        same = [d for d in same if d["interface"] == "usb"] or same
        at_port = [d for d in same if port and _port(d) == port]
        return at_port or same

    def _by_path(self, path: str) -> list[Device]:
        holders = [(len(held), d) for d in self.devices for held in _paths(d) if _inside(path, held)]
        if not holders:
            return []
        longest = max(length for length, _ in holders)
        return [d for length, d in holders if length == longest]

    def _by_hid(self, bus: str | None, vendor: str, product: str) -> list[Device]:
        tail = f":{vendor}:{product}.".lower()
        wanted = f"{bus.lower()}{tail}" if bus else tail
        found = [d for d in self.devices if any(wanted in held.lower() for held in _paths(d))]
        return found or self._by_usb(vendor.lower(), product.lower(), None)

    def _by_node(self, name: str) -> list[Device]:
        return [d for d in self.devices if any(node["name"] == name for node in d.get("instance", {}).get("nodes", ()))]

    @staticmethod
    def _is_hwmon(device: Device, name: str) -> bool:
        nodes = device.get("instance", {}).get("nodes", ())
        return (
            any(node["class"] == "hwmon" for node in nodes)
            and re.search(rf"(?m)(?:^|[\s:=]){re.escape(name)}(?:$|\s)", device["raw_descriptor"]) is not None
        )


def _port(device: Device) -> str:
    instance = device.get("instance", {})
    return str(instance.get("port") or instance.get("sysfs", "").rsplit("/", 1)[-1])


def _paths(device: Device) -> list[str]:
    instance = device.get("instance", {})
    held = [instance["sysfs"]] if instance.get("sysfs") else []
    return held + list(instance.get("paths", ()))


def _inside(path: str, holder: str) -> bool:
    return path == holder or path.startswith(holder.rstrip("/") + "/")


def _is_called(device: Device, match: str) -> bool:
    """Whether udev's name of the device stands in a match by /dev/serial/by-id."""
    found = re.search(r"(?m)^(?:\w+\[\d+\]\.)?udev\.ID_SERIAL\.name: (.+)$", str(device.get("raw_descriptor", "")))
    return found is not None and found.group(1) in match
