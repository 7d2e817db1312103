"""Bluetooth devices that this host is paired with: surroundings, not parts of it, unless the kernel shows a part.

Read from the files of the Bluetooth service where this user may (they hold keys, which are skipped), and from
`bluetoothctl`, which answers from what the service knows: nothing is scanned, connected or switched on. The name of a
paired device is what a person calls it, so it is left where it is; standard numbers alone give the kind.
"""

import errno
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from octoform.builtin.probe.commands import Command, output
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.unit_model import Node, Unit
from octoform.patterns import regex

SERVICE_FILES = "/var/lib/bluetooth"
LIST = Command("bluetoothctl-devices", ("bluetoothctl", "devices", "Paired"))
LIST_BEFORE_5_65 = Command("bluetoothctl-paired-devices", ("bluetoothctl", "paired-devices"))
MAX_PAIRED = 32
_ADDRESS = regex(r"(?:[0-9A-F]{2}:){5}[0-9A-F]{2}")
_LISTED = regex(rf"^Device ({_ADDRESS.pattern})\b", re.M)
_FACT = regex(r"^\s+(\w[\w ]*): (.*)$", re.M)
_STANDARD = regex(r"\b0000([0-9a-f]{4})-0000-1000-8000-00805f9b34fb\b", re.I)
_MODALIAS = regex(r"^(usb|bluetooth):v([0-9A-F]{4})p([0-9A-F]{4})")
_SECTION = regex(r"^\[(\w+)\]$")
_SOURCES = {"1": "bluetooth", "2": "usb"}
# Bluetooth Assigned Numbers: major classes of devices, categories of appearance, and profiles.
_MAJOR = {1: "computer", 2: "phone", 3: "network", 4: "audio", 5: "input", 6: "imaging", 7: "wearable", 8: "toy"}
_APPEARANCE = {1: "phone", 2: "computer", 3: "wearable", 5: "display", 12: "thermometer", 13: "heart rate sensor"}
_APPEARANCE |= {15: "input", 17: "cycling sensor", 21: "sensor", 33: "audio", 49: "pulse oximeter", 50: "scale"}
PROFILES: Mapping[str, str] = {
    **{
        "1101": "serial port",
        "1105": "object push",
        "1106": "file transfer",
        "1108": "headset",
        "110a": "audio source",
    },
    **{"110b": "audio sink", "110e": "remote control", "1112": "headset gateway", "1115": "network user"},
    **{"111e": "hands-free", "111f": "hands-free gateway", "1124": "human interface", "112f": "phone book"},
    **{"180a": "device information", "180d": "heart rate", "180f": "battery", "1809": "thermometer"},
    **{"1812": "human interface over low energy", "181a": "environmental sensing", "184e": "low energy audio"},
}


@dataclass(slots=True)
class PairedDevice:
    """The facts of one paired device: its kind in standard numbers, and as instance facts address and state."""

    address: str
    kind: str = ""
    class_of_device: str = ""
    profiles: set[str] = field(default_factory=set)
    ids: tuple[str, str, str] = ("", "", "")
    """The assigner of the maker's number (usb or bluetooth), that number, and the maker's of the product."""
    connected: bool | None = None


class Paired:
    """Collects paired devices by address, from whichever source shows them."""

    def __init__(self) -> None:
        """Empty until the scans have run."""
        self.devices: dict[str, PairedDevice] = {}

    def scans(self) -> list[Scan]:
        """The service's files first, then its own tool."""
        return [Scan("files:bluetooth", self._files), Scan("command:bluetoothctl", self._ask)]

    def units(self) -> list[Unit]:
        """One unit for each, marked as context."""
        return [_unit(device) for _, device in sorted(self.devices.items())]

    def known(self, address: str) -> PairedDevice | None:
        """The device of that address, None where it is none or there are too many."""
        address = address.upper().replace("-", ":")
        if not _ADDRESS.fullmatch(address) or (address not in self.devices and len(self.devices) >= MAX_PAIRED):
            return None
        return self.devices.setdefault(address, PairedDevice(address))

    def _files(self, reader: Reader) -> None:
        for adapter in filter(_ADDRESS.fullmatch, reader.names(SERVICE_FILES)):
            for address in filter(_ADDRESS.fullmatch, reader.names_or_none(f"{SERVICE_FILES}/{adapter}")):
                sections = _sections(reader.text(f"{SERVICE_FILES}/{adapter}/{address}/info"))
                paired = any(name.endswith(("LinkKey", "LongTermKey")) for name in sections)
                if paired and (device := self.known(address)):
                    _from_file(device, sections)

    def _ask(self, reader: Reader) -> None:
        if not any(name.startswith("hci") for name in reader.names_or_none("/sys/class/bluetooth")):
            raise OSError(errno.EOPNOTSUPP, "no Bluetooth adapter")
        for address in _listed(reader)[:MAX_PAIRED]:
            about = Command(f"bluetoothctl-info-{address.replace(':', '-')}", ("bluetoothctl", "info", address))
            if device := self.known(address):
                _from_tool(device, output(about, reader))


def _listed(reader: Reader) -> list[str]:
    """Addresses of the paired devices; a tool knows one of the two commands, by its version."""
    failed: list[OSError] = []
    for command in (LIST, LIST_BEFORE_5_65):
        try:
            found = _LISTED.findall(output(command, reader))
        except TimeoutError:
            raise
        except OSError as problem:
            failed.append(problem)
        else:
            if found:
                return list(dict.fromkeys(found))
    if len(failed) > 1:
        raise failed[0]
    return []


def described(device: PairedDevice, number: str, profiles: Iterable[str], ids: tuple[str, str, str]) -> None:
    """Add the class of device, the numbers of standard profiles, and the numbers of maker and product."""
    device.class_of_device = device.class_of_device or number.lower()
    device.kind = device.kind or _MAJOR.get(_number(number) >> 8 & 31, "")
    device.profiles.update(profile.lower() for profile in profiles)
    if not device.ids[1] and ids[1].strip("0") and ids[2]:
        device.ids = ids


def _from_file(device: PairedDevice, sections: Mapping[str, Mapping[str, str]]) -> None:
    general, numbers = sections.get("General", {}), sections.get("DeviceID", {})
    maker, product = (f"{_whole(numbers.get(key)):04x}" for key in ("Vendor", "Product"))
    ids = (_SOURCES.get(numbers.get("Source", ""), ""), maker, product)
    described(device, general.get("Class", ""), _STANDARD.findall(general.get("Services", "")), ids)
    device.kind = device.kind or _APPEARANCE.get(_number(general.get("Appearance", "")) >> 6, "")


def _from_tool(device: PairedDevice, output: str) -> None:
    facts = dict(_FACT.findall(output))
    alias = _MODALIAS.match(facts.get("Modalias", ""))
    ids = (alias[1], alias[2].lower(), alias[3].lower()) if alias else ("", "", "")
    described(device, facts.get("Class", "").partition(" ")[0], _STANDARD.findall(output), ids)
    device.kind = device.kind or _APPEARANCE.get(_number(facts.get("Appearance", "")) >> 6, "")
    if facts.get("Connected") in ("yes", "no"):
        device.connected = facts["Connected"] == "yes"


def _sections(text: str) -> dict[str, dict[str, str]]:
    """The sections of a file of the service; of those that hold keys the name alone."""
    found: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    wanted = False
    for line in text.splitlines():
        if heading := _SECTION.match(line.strip()):
            current = found.setdefault(heading[1], {})
            wanted = heading[1] in ("General", "DeviceID")
        elif wanted and "=" in line:
            key, _, value = line.partition("=")
            current[key.strip()] = value.strip()
    return found


def _unit(device: PairedDevice) -> Unit:
    source, maker, product = device.ids
    kind = f"{maker}-{product}" if maker else device.kind or "device"
    title = f"paired Bluetooth {device.kind or 'device'}"
    node = Node("/bluetooth/paired", "bluetooth", False, kind=f"paired-{kind}", title=title)
    node.address = device.address
    if source == "usb":
        node.vid, node.pid = maker, product
    node.add("paired", device.kind or "device")
    node.add("class_of_device", device.class_of_device)
    node.add("maker_number", f"{source} {maker}" if maker else "")
    node.add("product_number", product)
    named = [f"{number} {PROFILES[number]}" for number in sorted(device.profiles & PROFILES.keys())]
    node.add("profiles", ", ".join(named))
    extra: dict[str, str | int | bool] = {
        "port": "bluetooth",
        "strength": "strong",
        "address": device.address,
    }
    if device.connected is not None:
        extra["connected"] = device.connected
    return Unit(node, context=True, extra=extra)


def _number(text: str) -> int:
    try:
        return int(text, 16)
    except ValueError:
        return 0


def _whole(text: str | None) -> int:
    return int(text) if text and text.isdecimal() and int(text) <= 0xFFFF else 0
